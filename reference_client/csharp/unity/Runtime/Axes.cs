// SPDX-License-Identifier: MIT
namespace SplatBus.Unity
{
    using System;
    using UnityEngine;
    using Pose = SplatBus.Pose;

    /// <summary>Poses between a scene of Unity and the wire.</summary>
    static class Axes
    {
        const double Near = 1e-6;

        /// <param name="sceneUnit">Units of Unity to one of the splats' scene.</param>
        internal static Pose ToWire(Vector3 position, Quaternion rotation, float sceneUnit)
        {
            return UnityAxes.ToWire(new Pose
            {
                X = (double)position.x / sceneUnit, Y = (double)position.y / sceneUnit, Z = (double)position.z / sceneUnit,
                QX = rotation.x, QY = rotation.y, QZ = rotation.z, QW = rotation.w,
            });
        }

        /// <summary>Whether nothing has to be sent.</summary>
        internal static bool Same(Pose one, Pose other)
        {
            return one.X == other.X && one.Y == other.Y && one.Z == other.Z
                && one.QX == other.QX && one.QY == other.QY && one.QZ == other.QZ && one.QW == other.QW;
        }

        /// <summary>Whether these are one pose, but for rounding.</summary>
        internal static bool Alike(Pose one, Pose other)
        {
            return IsNear(one.X, other.X) && IsNear(one.Y, other.Y) && IsNear(one.Z, other.Z)
                && IsNear(one.QX, other.QX) && IsNear(one.QY, other.QY) && IsNear(one.QZ, other.QZ) && IsNear(one.QW, other.QW);
        }

        static bool IsNear(double one, double other) { return Math.Abs(one - other) <= Near * (1 + Math.Abs(one)); }
    }
}
