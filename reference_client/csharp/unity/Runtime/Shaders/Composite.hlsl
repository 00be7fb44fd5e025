// SPDX-License-Identifier: MIT
// What SplatBus.Client/Compositing.cs does for a pixel, in words that HLSL and C share: the tests run it as C.
// Arguments that are named `is` hold 1 for yes and 0 for no.

#ifndef SPLATBUS_COMPOSITE
#define SPLATBUS_COMPOSITE

// Whether a depth is that of a surface [BUF-8, BUF-9, MEM-12]. It looks at the bits: to a compiler for
// GPUs every number may be finite, and a comparison with NaN anything.
bool SplatBusIsSurface(float stored, float alpha, float empty)
{
    uint bits = asuint(stored);
    return bits > 0u && bits < 0x7f800000u && stored != empty && alpha > 0.0;
}

// Planar depth, in scene units; x and y are the ray's, (column + 0.5 - cx) / fx and so on.
float SplatBusPlanarDepth(float stored, float isRay, float x, float y)
{
    return isRay > 0.5 ? stored / sqrt(1.0 + x * x + y * y) : stored;
}

// From linear to sRGB and back (IEC 61966-2-1).
float SplatBusToSrgb(float value)
{
    return value <= 0.0031308 ? 12.92 * value : 1.055 * pow(max(value, 0.0031308), 1.0 / 2.4) - 0.055;
}

float SplatBusToLinear(float value)
{
    return value <= 0.04045 ? value / 12.92 : pow((max(value, 0.04045) + 0.055) / 1.055, 2.4);
}

// `value` of one colour space in the other.
float SplatBusInSpace(float value, float isSrgb, float toSrgb)
{
    if (isSrgb > 0.5 && toSrgb < 0.5) return SplatBusToLinear(value);
    if (isSrgb < 0.5 && toSrgb > 0.5) return SplatBusToSrgb(value);
    return value;
}

// One channel of a splat that is in front. It is mixed in the space that the server announces, the
// background brought into that first; `own` and the result are in that of the frame buffer.
float SplatBusOver(float color, float alpha, float isPremultiplied, float isSrgb, float own, float isSrgbHere)
{
    float behind = SplatBusInSpace(own, isSrgbHere, isSrgb);
    float seen = isPremultiplied > 0.5 ? color : alpha * color;
    return SplatBusInSpace(seen + (1.0 - alpha) * behind, isSrgb, isSrgbHere);
}

#endif
