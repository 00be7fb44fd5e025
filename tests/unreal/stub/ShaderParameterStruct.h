// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "RenderGraphBuilder.h"
#include "SceneView.h"

enum class ERenderTargetLoadAction
{
	ELoad
};
struct FRenderTargetBinding
{
	FRenderTargetBinding() {}
	FRenderTargetBinding(FRDGTextureRef InTexture, ERenderTargetLoadAction) : Texture(InTexture) {}
	FRDGTextureRef Texture = nullptr;
};
#define BEGIN_SHADER_PARAMETER_STRUCT(Name, Api) \
	struct Name \
	{
#define END_SHADER_PARAMETER_STRUCT() \
	} \
	;
#define SHADER_PARAMETER(Type, Name) Type Name;
#define SHADER_PARAMETER_TEXTURE(Type, Name) FRHITexture* Name = nullptr;
#define SHADER_PARAMETER_RDG_TEXTURE(Type, Name) FRDGTextureRef Name = nullptr;
#define SHADER_PARAMETER_STRUCT_REF(Type, Name) TUniformBufferRef<Type> Name;
#define RENDER_TARGET_BINDING_SLOTS() FRenderTargetBinding RenderTargets[8];
#define SHADER_USE_PARAMETER_STRUCT(Class, Base) static_assert(true)
