// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "RHI.h"

struct FViewUniformShaderParameters
{
};
template <class T>
struct TUniformBufferRef
{
};
struct FSceneViewProjectionData
{
	FVector ViewOrigin;
	FMatrix ProjectionMatrix;
	void SetViewRectangle(const FIntRect& Rect) { View = Rect; }
	const FIntRect& GetConstrainedViewRect() const { return View; }

private:
	FIntRect View;
};
class FSceneViewFamily
{
};
class FSceneView
{
public:
	TUniformBufferRef<FViewUniformShaderParameters> ViewUniformBuffer;
	bool bIsGameView = true, bIsSceneCapture = false;
	int32 PlayerIndex = 0;
	ERHIFeatureLevel::Type GetFeatureLevel() const { return ERHIFeatureLevel::SM5; }
};
