// SPDX-License-Identifier: MIT
#include "SplatBusComposite.h"

#include "DataDrivenShaderPlatformInfo.h"
#include "GlobalShader.h"
#include "PixelShaderUtils.h"
#include "RenderGraphUtils.h"
#include "ShaderParameterStruct.h"

class FSplatBusCompositePS : public FGlobalShader
{
public:
	DECLARE_GLOBAL_SHADER(FSplatBusCompositePS);
	SHADER_USE_PARAMETER_STRUCT(FSplatBusCompositePS, FGlobalShader);

	BEGIN_SHADER_PARAMETER_STRUCT(FParameters, )
		SHADER_PARAMETER_STRUCT_REF(FViewUniformShaderParameters, View)
		SHADER_PARAMETER_RDG_TEXTURE(Texture2D, SplatBusSceneColor)
		SHADER_PARAMETER_RDG_TEXTURE(Texture2D, SplatBusSceneDepth)
		SHADER_PARAMETER_TEXTURE(Texture2D, SplatBusColor)
		SHADER_PARAMETER_TEXTURE(Texture2D, SplatBusDepth)
		SHADER_PARAMETER(FVector4f, SplatBusLens)
		SHADER_PARAMETER(FVector4f, SplatBusSize)
		SHADER_PARAMETER(FVector4f, SplatBusMeaning)
		SHADER_PARAMETER(FVector4f, SplatBusScene)
		RENDER_TARGET_BINDING_SLOTS()
	END_SHADER_PARAMETER_STRUCT()

	static bool ShouldCompilePermutation(const FGlobalShaderPermutationParameters& Parameters)
	{
		return IsFeatureLevelSupported(Parameters.Platform, ERHIFeatureLevel::SM5);
	}
};

IMPLEMENT_GLOBAL_SHADER(FSplatBusCompositePS, "/Plugin/SplatBus/Private/SplatBusComposite.usf", "MainPS", SF_Pixel);

void AddSplatBusPass(FRDGBuilder& GraphBuilder, const FSceneView& View, FRDGTextureRef SceneColor, FRDGTextureRef SceneDepth, const FSplatBusShown& Shown)
{
	// A pass may not read what it writes: it reads a copy, since what is mixed in sRGB no blend state can mix.
	const FRDGTextureRef Behind = GraphBuilder.CreateTexture(SceneColor->Desc, TEXT("SplatBus.SceneColor"));
	AddCopyTexturePass(GraphBuilder, SceneColor, Behind);

	FSplatBusCompositePS::FParameters* Parameters = GraphBuilder.AllocParameters<FSplatBusCompositePS::FParameters>();
	Parameters->View = View.ViewUniformBuffer;
	Parameters->SplatBusSceneColor = Behind;
	Parameters->SplatBusSceneDepth = SceneDepth;
	Parameters->SplatBusColor = Shown.Color;
	Parameters->SplatBusDepth = Shown.Depth;
	Parameters->SplatBusLens = Shown.Lens;
	Parameters->SplatBusSize = Shown.Size;
	Parameters->SplatBusMeaning = Shown.Meaning;
	Parameters->SplatBusScene = Shown.Scene;
	Parameters->RenderTargets[0] = FRenderTargetBinding(SceneColor, ERenderTargetLoadAction::ELoad);

	const FGlobalShaderMap* ShaderMap = GetGlobalShaderMap(View.GetFeatureLevel());
	const TShaderMapRef<FSplatBusCompositePS> PixelShader(ShaderMap);
	// Over the whole texture: which part of it the view has, the shader knows by the view's uniforms.
	const FIntRect Everywhere(FIntPoint(0, 0), SceneColor->Desc.Extent);
	FPixelShaderUtils::AddFullscreenPass(GraphBuilder, ShaderMap, RDG_EVENT_NAME("SplatBus"), PixelShader, Parameters, Everywhere);
}
