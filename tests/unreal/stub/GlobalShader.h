// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "DataDrivenShaderPlatformInfo.h"

struct FGlobalShaderPermutationParameters
{
	EShaderPlatform Platform = SP_Stub;
};
class FGlobalShader
{
};
class FGlobalShaderMap
{
};
const FGlobalShaderMap* GetGlobalShaderMap(ERHIFeatureLevel::Type);
template <class T>
class TShaderRef
{
};
template <class T>
class TShaderMapRef : public TShaderRef<T>
{
public:
	explicit TShaderMapRef(const FGlobalShaderMap*) {}
};
enum EShaderFrequency
{
	SF_Pixel
};
#define DECLARE_GLOBAL_SHADER(Class) static_assert(true)
#define IMPLEMENT_GLOBAL_SHADER(Class, File, Function, Frequency) static_assert(sizeof(Class::ShouldCompilePermutation({})) == 1 && Frequency == SF_Pixel, File Function)
