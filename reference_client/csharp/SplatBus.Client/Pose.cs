// SPDX-License-Identifier: MIT
namespace SplatBus
{
    /// <summary>A position, in scene units, and a rotation as a unit quaternion: camera-to-world or object-to-world.</summary>
    public struct Pose
    {
        public double X, Y, Z;
        public double QX, QY, QZ, QW;
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
