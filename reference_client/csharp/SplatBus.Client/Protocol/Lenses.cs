// SPDX-License-Identifier: MIT
using System;

namespace SplatBus
{
    /// <summary>Intrinsics: made of a field of view, read, written, and checked [CAM-4].</summary>
    public static class Lenses
    {
        /// <summary>A symmetric lens, for images of this size: a server refuses one of another shape than its images [CAM-6].</summary>
        /// <param name="verticalDegrees">Vertical field of view, as Unity's `Camera.fieldOfView`.</param>
        /// <param name="near">Clipping plane, in scene units.</param>
        /// <param name="far">Clipping plane, in scene units.</param>
        public static Intrinsics FromFieldOfView(double verticalDegrees, long width, long height, double near, double far)
        {
            double focal = height / 2.0 / Math.Tan(verticalDegrees * Math.PI / 360);
            return new Intrinsics { Fx = focal, Fy = focal, Cx = width / 2.0, Cy = height / 2.0, Width = width, Height = height, Near = near, Far = far };
        }

        internal static Intrinsics Read(Part part)
        {
            const string rule = "CAM-4";
            var lens = new Intrinsics
            {
                Fx = part.Member("fx", rule).Number(rule),
                Fy = part.Member("fy", rule).Number(rule),
                Cx = part.Member("cx", rule).Number(rule),
                Cy = part.Member("cy", rule).Number(rule),
                Width = part.Member("width", rule).Integer(1, Limits.MaxImageSize, rule),
                Height = part.Member("height", rule).Integer(1, Limits.MaxImageSize, rule),
                Near = part.Member("near", rule).Number(rule),
                Far = part.Member("far", rule).Number(rule),
            };
            string wrong = Wrong(lens);
            if (wrong != null) throw part.Broken(wrong, rule);
            return lens;
        }

        /// <summary>Why nobody may send it, or null.</summary>
        internal static string Wrong(Intrinsics lens)
        {
            if (!IsLength(lens.Fx) || !IsLength(lens.Fy)) return "has a focal length beyond 1e-6 to 1e9 [CAM-4]";
            if (!(Math.Abs(lens.Cx) <= Limits.MaxLens && Math.Abs(lens.Cy) <= Limits.MaxLens)) return "has a principal point beyond 1e9 [CAM-4]";
            if (!IsLength(lens.Near) || !IsLength(lens.Far) || lens.Near >= lens.Far) return "has clipping planes beyond 1e-6 to 1e9, or near not before far [CAM-4]";
            if (lens.Width < 1 || lens.Width > Limits.MaxImageSize || lens.Height < 1 || lens.Height > Limits.MaxImageSize) return "has a size beyond 1 to 32768 [CAM-4]";
            return null;
        }

        static bool IsLength(double value) { return value >= Limits.MinLens && value <= Limits.MaxLens; }

        internal static void Write(PacketWriter writer, Intrinsics lens)
        {
            writer.BeginObject();
            writer.Member("fx", lens.Fx);
            writer.Member("fy", lens.Fy);
            writer.Member("cx", lens.Cx);
            writer.Member("cy", lens.Cy);
            writer.Member("width", lens.Width);
            writer.Member("height", lens.Height);
            writer.Member("near", lens.Near);
            writer.Member("far", lens.Far);
            writer.EndObject();
        }
    }
}
