// SPDX-License-Identifier: MIT
// What the shaders' arithmetic needs of HLSL, so that its text runs as C++: a whole screen at a time. TEXT is
// the file, NAMED(it) how it calls its parameters.
#include <cmath>
#include <cstring>

typedef unsigned int uint;

struct float2 { float x, y; };

struct float4
{
    float x, y, z, w;
    float4() : x(0), y(0), z(0), w(0) {}
    float4(float x, float y, float z, float w) : x(x), y(y), z(z), w(w) {}
};

struct int3
{
    int x, y, z;
    int3(int x, int y, int z) : x(x), y(y), z(z) {}
};

template <class T> struct Texture2D
{
    const T* first;
    int width;
    T Load(int3 at) const { return first[at.y * width + at.x]; }
};

static uint asuint(float value)
{
    uint bits;
    std::memcpy(&bits, &value, sizeof bits);
    return bits;
}

static float max(float one, float other) { return one > other ? one : other; }
static float clamp(float value, float least, float most) { return value < least ? least : value > most ? most : value; }
using std::floor;
using std::pow;
using std::sqrt;

#include TEXT

// The textures' rows from the bottom up, the screen's as the engine counts them. four: lens, size, meaning, scene.
extern "C" void screen(const float4* color, const float* depth, const float4* four, int width, int height,
                       const float4* own, const float* ownDepth, float4* out)
{
    NAMED(SplatBusLens) = four[0];
    NAMED(SplatBusSize) = four[1];
    NAMED(SplatBusMeaning) = four[2];
    NAMED(SplatBusScene) = four[3];
    NAMED(SplatBusColor).first = color;
    NAMED(SplatBusDepth).first = depth;
    NAMED(SplatBusColor).width = NAMED(SplatBusDepth).width = int(four[1].x);
    for (int row = 0; row < height; row++)
        for (int column = 0; column < width; column++)
        {
            int at = row * width + column;
            float2 uv = {(column + 0.5f) / width, (row + 0.5f) / height};
            bool isBackground = (asuint(ownDepth[at]) & 0x7f800000u) == 0x7f800000u;
            out[at] = SplatBusPixel(uv, own[at], ownDepth[at], isBackground);
        }
}
