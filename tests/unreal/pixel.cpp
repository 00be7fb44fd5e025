// SPDX-License-Identifier: MIT
// What SplatBusPixel.ush needs of HLSL, so that its text runs as C++: a whole screen at a time.
#include <cmath>
#include <cstring>

typedef unsigned int uint;

struct float2
{
	float x, y;
};

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

template <class T>
struct Texture2D
{
	const T* First;
	int Width;
	T Load(int3 At) const { return First[At.y * Width + At.x]; }
};

static uint asuint(float Value)
{
	uint Bits;
	std::memcpy(&Bits, &Value, sizeof Bits);
	return Bits;
}

static float max(float One, float Other) { return One > Other ? One : Other; }
static float clamp(float Value, float Least, float Most) { return Value < Least ? Least : Value > Most ? Most : Value; }
using std::floor;
using std::pow;
using std::sqrt;

#include "SplatBusPixel.ush"

// Rows of the image from the bottom up, those of the screen from the top down. Four: lens, size, meaning, scene.
extern "C" void screen(const float4* Color, const float* Depth, const float4* Four, int Width, int Height, const float4* Own, const float* OwnDepth, float4* Out)
{
	SplatBusLens = Four[0];
	SplatBusSize = Four[1];
	SplatBusMeaning = Four[2];
	SplatBusScene = Four[3];
	SplatBusColor.First = Color;
	SplatBusDepth.First = Depth;
	SplatBusColor.Width = SplatBusDepth.Width = int(SplatBusSize.x);
	for (int Row = 0; Row < Height; ++Row)
	{
		for (int Column = 0; Column < Width; ++Column)
		{
			int At = Row * Width + Column;
			float2 UV = {(Column + 0.5f) / Width, (Row + 0.5f) / Height};
			bool bIsBackground = (asuint(OwnDepth[At]) & 0x7f800000u) == 0x7f800000u;
			Out[At] = SplatBusPixel(UV, Own[At], OwnDepth[At], bIsBackground);
		}
	}
}
