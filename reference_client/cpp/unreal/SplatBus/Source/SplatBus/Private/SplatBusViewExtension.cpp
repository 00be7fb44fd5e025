// SPDX-License-Identifier: MIT
#include "SplatBusViewExtension.h"

#include "Camera/CameraTypes.h"
#include "Engine/LocalPlayer.h"
#include "Engine/World.h"
#include "GameFramework/PlayerController.h"
#include "Kismet/GameplayStatics.h"
#include "PostProcess/PostProcessInputs.h"
#include "SceneTexturesConfig.h"
#include "SplatBusAxes.h"

FSplatBusViewExtension::FSplatBusViewExtension(const FAutoRegister& AutoRegister, UWorld* InWorld, int32 InPlayerIndex)
	: FSceneViewExtensionBase(AutoRegister), World(InWorld), PlayerIndex(InPlayerIndex)
{
}

void FSplatBusViewExtension::Aim(const splatbus::FrameCamera& Camera, double Unit)
{
	FQuat Turn;
	SplatBusAxes::FromWire({Camera.position, Camera.rotation}, Unit, Location, Turn);
	Rotation = Turn.Rotator();
	Lens = Camera;
	bIsAimed = true;
}

void FSplatBusViewExtension::AimAtNothing()
{
	bIsAimed = false;
}

void FSplatBusViewExtension::SetupViewPoint(APlayerController* Player, FMinimalViewInfo& InViewInfo)
{
	bIsThisPlayer = Player && Player == UGameplayStatics::GetPlayerController(World.Get(), PlayerIndex);
	if (const ULocalPlayer* Local = bIsThisPlayer ? Player->GetLocalPlayer() : nullptr)
	{
		ControllerId = Local->GetControllerId();
	}
	if (bIsAimed && bIsThisPlayer)
	{
		InViewInfo.Location = Location;
		InViewInfo.Rotation = Rotation;
	}
}

/** The engine asks for the point of a view first, and for its projection then. */
void FSplatBusViewExtension::SetupViewProjectionMatrix(FSceneViewProjectionData& InOutProjectionData)
{
	if (bIsAimed && bIsThisPlayer)
	{
		SplatBusAxes::SeeThrough(Lens, InOutProjectionData.ProjectionMatrix);
	}
}

/** Before the tone mapper, which then acts on both. */
void FSplatBusViewExtension::PrePostProcessPass_RenderThread(FRDGBuilder& GraphBuilder, const FSceneView& View, const FPostProcessingInputs& Inputs)
{
	if (!Shown.Color.IsValid() || !View.bIsGameView || View.bIsSceneCapture || View.PlayerIndex != ControllerId)
	{
		return;
	}
	FSplatBusShown Now = Shown;
	if (!bCompares)
	{
		Now.Scene.Y = 0;
	}
	AddSplatBusPass(GraphBuilder, View, (*Inputs.SceneTextures)->SceneColorTexture, (*Inputs.SceneTextures)->SceneDepthTexture, Now);
	++Drawn;
}

bool FSplatBusViewExtension::IsActiveThisFrame_Internal(const FSceneViewExtensionContext& Context) const
{
	return World.IsValid() && Context.GetWorld() == World.Get();
}
