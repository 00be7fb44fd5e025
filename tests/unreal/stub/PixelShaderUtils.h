// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "GlobalShader.h"
#include "RenderGraphBuilder.h"

namespace Stub
{
	/** What was drawn last. */
	struct FDrawn
	{
		const FRHITexture *Color, *Depth;
		FVector4f Lens, Size, Meaning, Scene;
		FIntRect Where;
	};
	void Draw(const FDrawn& Drawn);
}
class FPixelShaderUtils
{
public:
	template <class T>
	static void AddFullscreenPass(FRDGBuilder&, const FGlobalShaderMap*, FRDGEventName&&, const TShaderRef<T>&, typename T::FParameters* It, const FIntRect& Where)
	{
		Stub::Draw({It->SplatBusColor, It->SplatBusDepth, It->SplatBusLens, It->SplatBusSize, It->SplatBusMeaning, It->SplatBusScene, Where});
	}
};
