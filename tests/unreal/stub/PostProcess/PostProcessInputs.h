// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "CoreMinimal.h"

struct FSceneTextureUniformParameters;
template <class T>
class TRDGUniformBuffer
{
public:
	const T* operator->() const { return &Contents; }
	T Contents;
};
template <class T>
using TRDGUniformBufferRef = TRDGUniformBuffer<T>*;
struct FPostProcessingInputs
{
	TRDGUniformBufferRef<FSceneTextureUniformParameters> SceneTextures = nullptr;
};
