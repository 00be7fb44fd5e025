// SPDX-License-Identifier: MIT
#pragma once

#include "CoreMinimal.h"
#include "RenderGraphBuilder.h"
#include "RHI.h"
#include "SceneView.h"

/** What the shader has to know of an image; see SplatBusPixel.ush. For the renderer's thread. */
struct FSplatBusShown
{
	FTextureRHIRef Color, Depth;
	FVector4f Lens = FVector4f(0, 0, 0, 0);
	FVector4f Size = FVector4f(0, 0, 0, 0);
	FVector4f Meaning = FVector4f(0, 0, 0, 0);
	FVector4f Scene = FVector4f(0, 0, 0, 0);
};

/** Lay it over what the view has drawn. */
void AddSplatBusPass(FRDGBuilder& GraphBuilder, const FSceneView& View, FRDGTextureRef SceneColor, FRDGTextureRef SceneDepth, const FSplatBusShown& Shown);
