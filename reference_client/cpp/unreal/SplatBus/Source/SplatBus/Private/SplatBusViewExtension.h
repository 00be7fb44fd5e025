// SPDX-License-Identifier: MIT
#pragma once

#include "SceneViewExtension.h"
#include "SplatBusComposite.h"
#include "SplatBusCore.h"

#include <atomic>

class APlayerController;
class UWorld;

/** Draws the image over the scene of one player, and the scene through the camera of the image. */
class FSplatBusViewExtension final : public FSceneViewExtensionBase
{
public:
	FSplatBusViewExtension(const FAutoRegister& AutoRegister, UWorld* InWorld, int32 InPlayerIndex);

	/** For the game's thread: draw this player's scene from there; Unit in centimetres. */
	void Aim(const splatbus::FrameCamera& Camera, double Unit);
	void AimAtNothing();

	/** For the renderer's thread. */
	void Show(const FSplatBusShown& InShown) { Shown = InShown; }
	void CompareDepth(bool bCompare) { bCompares = bCompare; }
	/** How many times it was drawn since the last call, from any thread. */
	int32 TakeDrawn() { return Drawn.exchange(0); }

	virtual void SetupViewFamily(FSceneViewFamily&) override {}
	virtual void SetupView(FSceneViewFamily&, FSceneView&) override {}
	virtual void BeginRenderViewFamily(FSceneViewFamily&) override {}
	virtual void SetupViewPoint(APlayerController* Player, FMinimalViewInfo& InViewInfo) override;
	virtual void SetupViewProjectionMatrix(FSceneViewProjectionData& InOutProjectionData) override;
	virtual void PrePostProcessPass_RenderThread(FRDGBuilder& GraphBuilder, const FSceneView& View, const FPostProcessingInputs& Inputs) override;

protected:
	virtual bool IsActiveThisFrame_Internal(const FSceneViewExtensionContext& Context) const override;

private:
	const TWeakObjectPtr<UWorld> World;
	const int32 PlayerIndex;

	FVector Location = FVector(0, 0, 0);
	FRotator Rotation = FRotator(0, 0, 0);
	splatbus::FrameCamera Lens;
	bool bIsAimed = false, bIsThisPlayer = false;

	/** By which the renderer knows the player; none before the first view. */
	std::atomic<int32> ControllerId{-1};
	FSplatBusShown Shown;
	bool bCompares = true;
	std::atomic<int32> Drawn{0};
};
