// SPDX-License-Identifier: MIT
// A pixel of the screen: the scene, and the image of a SplatBusView over it. For either pipeline; without
// swizzles, so that the tests can run it as C++.

#ifndef SPLATBUS_PIXEL
#define SPLATBUS_PIXEL

#include "Composite.hlsl"

Texture2D<float4> _SplatBusColor;
Texture2D<float> _SplatBusDepth;
float4 _SplatBusLens;    // fx, fy, cx, cy, in pixels of the image
float4 _SplatBusSize;    // width, height of the image
float4 _SplatBusMeaning; // 1 for ray distance; 1 for premultiplied; 1 for sRGB; the depth of empty pixels
float4 _SplatBusScene;   // units of Unity to one of the image; 1 to compare depths; 1 where frame buffers hold sRGB

float SplatBusChannel(float splat, float alpha, float own)
{
    return SplatBusOver(splat, alpha, _SplatBusMeaning.y, _SplatBusMeaning.z, own, _SplatBusScene.z);
}

// uv: from the bottom left. own: what the scene has there, and how far, in units of Unity.
float4 SplatBusPixel(float2 uv, float4 own, float ownDepth, bool isBackground)
{
    float column = clamp(floor(uv.x * _SplatBusSize.x), 0.0, _SplatBusSize.x - 1.0);
    float up = clamp(floor(uv.y * _SplatBusSize.y), 0.0, _SplatBusSize.y - 1.0); // the first row of the textures is the bottom one
    int3 texel = int3(int(column), int(up), 0);
    float4 splat = _SplatBusColor.Load(texel);
    if (splat.w <= 0.0) return own;
    if (_SplatBusScene.y > 0.5)
    {
        float stored = _SplatBusDepth.Load(texel);
        if (!SplatBusIsSurface(stored, splat.w, _SplatBusMeaning.w)) return own;
        float x = (column + 0.5 - _SplatBusLens.z) / _SplatBusLens.x;
        float y = (_SplatBusSize.y - up - 0.5 - _SplatBusLens.w) / _SplatBusLens.y; // rows of the image are counted from the top
        float depth = SplatBusPlanarDepth(stored, _SplatBusMeaning.x, x, y) * _SplatBusScene.x;
        if (!isBackground && !(depth < ownDepth)) return own;
    }
    return float4(
        SplatBusChannel(splat.x, splat.w, own.x),
        SplatBusChannel(splat.y, splat.w, own.y),
        SplatBusChannel(splat.z, splat.w, own.z),
        splat.w + (1.0 - splat.w) * own.w);
}

#endif
