// SPDX-License-Identifier: MIT
using System;

namespace SplatBus
{
    /// <summary>A position, in scene units, and a rotation as a unit quaternion: camera-to-world or object-to-world.</summary>
    /// <remarks>What is sent and read is in the axes of the wire: x right, y down, z forward, the camera looking along z.</remarks>
    public struct Pose
    {
        public double X, Y, Z;
        public double QX, QY, QZ, QW;

        /// <summary>No move and no turn.</summary>
        public static Pose Identity { get { return new Pose { QW = 1 }; } }

        /// <param name="position">x, y, z.</param>
        /// <param name="rotation">x, y, z, w.</param>
        public static Pose Of(double[] position, double[] rotation)
        {
            return new Pose
            {
                X = position[0], Y = position[1], Z = position[2],
                QX = rotation[0], QY = rotation[1], QZ = rotation[2], QW = rotation[3],
            };
        }

        /// <summary>Why nobody may send it, or null [JSN-4, POS-2, POS-3].</summary>
        public string Wrong
        {
            get
            {
                if (!(Math.Abs(X) <= Limits.MaxPosition && Math.Abs(Y) <= Limits.MaxPosition && Math.Abs(Z) <= Limits.MaxPosition))
                    return "a position beyond single precision [POS-2]";
                double norm = Math.Sqrt(QX * QX + QY * QY + QZ * QZ + QW * QW);
                return Math.Abs(norm - 1) <= Limits.RotationNormTolerance ? null : "a rotation that is no unit quaternion [POS-3]";
            }
        }
    }

    /// <summary>
    /// Between the axes of the wire (x right, y down, z forward) and Unity's (x right, y up, z
    /// forward), of cameras and of objects [CNV-4]; exact, since it only turns signs [ACC-7].
    /// </summary>
    public static class UnityAxes
    {
        public static Pose FromWire(Pose wire) { return Flipped(wire); }

        public static Pose ToWire(Pose unity) { return Flipped(unity); }

        /// <summary>y turned round, which is its own inverse.</summary>
        static Pose Flipped(Pose pose)
        {
            pose.Y = -pose.Y;
            pose.QX = -pose.QX;
            pose.QZ = -pose.QZ;
            return pose;
        }
    }
}
