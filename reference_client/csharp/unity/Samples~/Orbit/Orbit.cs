// SPDX-License-Identifier: MIT
using UnityEngine;

/// <summary>Moves a camera around a point, once in so many seconds; a SplatBusView beside it follows.</summary>
public sealed class Orbit : MonoBehaviour
{
    public Vector3 centre = new Vector3(0, 0, 4);
    public float distance = 4, height = 1, seconds = 20;

    void Update()
    {
        float turn = Time.time / seconds * 360;
        Quaternion heading = Quaternion.Euler(0, turn, 0);
        transform.position = centre + heading * new Vector3(0, height, -distance);
        transform.LookAt(centre);
    }
}
