// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "CoreMinimal.h"

enum EPixelFormat
{
	PF_Unknown,
	PF_A32B32G32R32F,
	PF_R32_FLOAT
};
struct FUpdateTextureRegion2D
{
	uint32 DestX, DestY;
	int32 SrcX, SrcY;
	uint32 Width, Height;
	FUpdateTextureRegion2D() {}
	FUpdateTextureRegion2D(uint32 InDestX, uint32 InDestY, int32 InSrcX, int32 InSrcY, uint32 InWidth, uint32 InHeight)
		: DestX(InDestX), DestY(InDestY), SrcX(InSrcX), SrcY(InSrcY), Width(InWidth), Height(InHeight)
	{
	}
};
class FRHITexture
{
public:
	uint32 Width = 0, Height = 0, PixelBytes = 0;
	std::vector<uint8> Bytes;
};
class FTextureRHIRef
{
public:
	FTextureRHIRef(std::shared_ptr<FRHITexture> InIt = nullptr) : It(std::move(InIt)) {}
	bool IsValid() const { return It != nullptr; }
	operator FRHITexture*() const { return It.get(); }

private:
	std::shared_ptr<FRHITexture> It;
};
uint32 GetMax2DTextureDimension();
namespace ERHIFeatureLevel
{
	enum Type
	{
		SM5
	};
}
