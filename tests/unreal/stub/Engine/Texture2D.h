// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "RHI.h"

class FTextureResource;
enum TextureFilter
{
	TF_Nearest
};
class UTexture2D : public UObject
{
public:
	static UTexture2D* CreateTransient(int32 Width, int32 Height, EPixelFormat Format);
	FTextureResource* GetResource() const { return StubResource.get(); }
	void UpdateResource();
	int32 GetSizeX() const { return Width; }
	int32 GetSizeY() const { return Height; }
	void UpdateTextureRegions(int32 Mip, uint32 Count, const FUpdateTextureRegion2D* Regions, uint32 SourcePitch, uint32 SourceBytesPerPixel, uint8* Source,
		TFunction<void(uint8*, const FUpdateTextureRegion2D*)> CleanUp);
	bool SRGB = true, NeverStream = false;
	TextureFilter Filter;

private:
	int32 Width = 0, Height = 0;
	EPixelFormat Format = PF_Unknown;
	std::shared_ptr<FTextureResource> StubResource;
};
