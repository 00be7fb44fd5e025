// SPDX-License-Identifier: MIT
namespace SplatBus.Unity
{
    using System;
    using UnityEngine;
    using Pose = SplatBus.Pose;

    /// <summary>An object of the splats' scene, and the transform that moves it.</summary>
    [Serializable]
    public sealed class SplatObject
    {
        const float Uniform = 1e-3f;

        [Tooltip("As the server's scene names it; \"default\" is the main one.")]
        public string id = "default";
        [Tooltip("Its scale has to be the same along all axes.")]
        public Transform transform;

        string sentId, wrong;
        Pose sentPose;
        double sentScale;
        bool isUneven;

        /// <summary>In words, or null.</summary>
        public string Problem
        {
            get
            {
                if (wrong != null) return "the object \"" + id + "\" cannot be sent: " + wrong;
                return isUneven ? "the object \"" + id + "\" is scaled by x along all axes, its transform is not" : null;
            }
        }

        /// <summary>Whether only a server with the capability `objects` moves it so [OBJ-2].</summary>
        internal bool IsMany { get { return sentId != null && (sentId != "default" || sentScale != 1); } }

        /// <summary>Nothing has been sent: the client is new.</summary>
        internal void Forget()
        {
            sentId = wrong = null;
            isUneven = false;
        }

        /// <summary>Say where it is, if that is new.</summary>
        internal void Send(SplatBusClient client, float sceneUnit)
        {
            if (transform == null || string.IsNullOrEmpty(id)) return;
            Vector3 scale = transform.lossyScale;
            isUneven = Math.Abs(scale.y - scale.x) > Uniform * Math.Abs(scale.x) || Math.Abs(scale.z - scale.x) > Uniform * Math.Abs(scale.x);
            Pose pose = Axes.ToWire(transform.position, transform.rotation, sceneUnit);
            if (id == sentId && scale.x == sentScale && Axes.Same(pose, sentPose)) return;
            sentId = id;
            sentPose = pose;
            sentScale = scale.x;
            try
            {
                client.SendObject(id, pose, scale.x);
                wrong = null;
            }
            catch (ArgumentException refused) { wrong = refused.Message; }
        }
    }
}
