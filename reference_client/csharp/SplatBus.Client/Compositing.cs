// SPDX-License-Identifier: MIT
using System;

namespace SplatBus
{
    /// <summary>A pixel of splats over a pixel of the program's own geometry, as the shaders of `unity/` do it on a GPU.</summary>
    public static class Compositing
    {
        /// <summary>The planar depth of a pixel, in scene units; +∞ where nothing is [BUF-8, BUF-9, MEM-12].</summary>
        /// <param name="stored">What the depth buffer holds there.</param>
        /// <param name="alpha">What the colour buffer holds there.</param>
        /// <param name="column">From the left.</param>
        /// <param name="row">From the top.</param>
        public static float PlanarDepth(float stored, float alpha, Semantics semantics, FrameCamera camera, int column, int row)
        {
            bool isSurface = stored > 0 && !float.IsInfinity(stored) && stored != (float)semantics.Depth.Empty && alpha > 0;
            if (!isSurface) return float.PositiveInfinity;
            if (semantics.Depth.Kind == DepthSemanticsKind.PlanarZ) return stored;
            double x = (column + 0.5 - camera.Cx) / camera.Fx, y = (row + 0.5 - camera.Cy) / camera.Fy;
            return (float)(stored / Math.Sqrt(1 + x * x + y * y));
        }

        /// <summary>One channel: the splat where it is in front, the geometry elsewhere; rounded once [ACC-10].</summary>
        /// <param name="depth">Planar, of the splats.</param>
        /// <param name="own">Colour of the geometry, in the image's colour space.</param>
        /// <param name="ownDepth">Planar, of the geometry; +∞ for a background.</param>
        public static float Over(float color, float alpha, float depth, bool isStraight, float own, float ownDepth)
        {
            if (!(depth < ownDepth)) return own;
            double seen = isStraight ? (double)alpha * color : color;
            return (float)(seen + (1.0 - alpha) * own);
        }
    }
}
