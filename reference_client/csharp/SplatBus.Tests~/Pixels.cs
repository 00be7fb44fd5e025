// SPDX-License-Identifier: MIT
namespace SplatBus.Tests
{
    /// <summary>Test vectors of poses that may be sent, and of splats over geometry.</summary>
    static class Pixels
    {
        internal static void Taken(JsonValue each, string what)
        {
            bool isTaken = Vectors.OfMember(each, "pose").Wrong == null;
            Vectors.Check(isTaken == Vectors.Member(each, "verdict").Is("accepted"), what + (isTaken ? ": accepted" : ": rejected"));
        }

        internal static void Composite(JsonValue each, string what)
        {
            float[] splat = new float[4], own = new float[3], expected = new float[3];
            Numbers(each, "splat", splat);
            Numbers(each, "background", own);
            Numbers(each, "expected", expected);
            JsonValue empty;
            var semantics = new Semantics { Depth = new DepthSemantics { Kind = DepthSemanticsKind.PlanarZ, Empty = double.PositiveInfinity } };
            if (each.TryMember("depth_empty", out empty)) semantics.Depth.Empty = Single(Spelt(each, "depth_empty"));
            float alpha = splat[3], ownDepth = Single(Spelt(each, "background_depth"));
            float depth = Compositing.PlanarDepth(Single(Spelt(each, "splat_depth")), alpha, semantics, null, 0, 0);
            for (int i = 0; i < 3; i++)
            {
                float got = Compositing.Over(splat[i], alpha, depth, Vectors.Member(each, "alpha").Is(SemanticsAlpha.Straight), own[i], ownDepth);
                Vectors.Check(got == expected[i], what + ": " + got);
            }
        }

        static void Numbers(JsonValue each, string name, float[] to)
        {
            int at = 0;
            foreach (JsonValue number in Spelt(each, name)) to[at++] = Single(number);
        }

        static JsonValue Spelt(JsonValue each, string name) { return Vectors.Member(Vectors.Member(each, name), "decimal"); }

        static float Single(JsonValue spelt)
        {
            if (spelt.Kind == JsonKind.Number) return (float)spelt.Number;
            return spelt.Is("nan") ? float.NaN : spelt.Is("-inf") ? float.NegativeInfinity : float.PositiveInfinity;
        }
    }
}
