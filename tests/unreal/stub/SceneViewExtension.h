// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "CoreMinimal.h"

class APlayerController;
class FRDGBuilder;
class FSceneView;
class FSceneViewFamily;
class UWorld;
struct FMinimalViewInfo;
struct FPostProcessingInputs;
struct FSceneViewProjectionData;

struct FSceneViewExtensionContext
{
	UWorld* GetWorld() const { return StubWorld; }
	UWorld* StubWorld = nullptr;
};
struct FAutoRegister
{
};
class FSceneViewExtensionBase
{
public:
	explicit FSceneViewExtensionBase(const FAutoRegister&) {}
	virtual ~FSceneViewExtensionBase() = default;
	virtual void SetupViewFamily(FSceneViewFamily&) = 0;
	virtual void SetupView(FSceneViewFamily&, FSceneView&) = 0;
	virtual void BeginRenderViewFamily(FSceneViewFamily&) = 0;
	virtual void SetupViewPoint(APlayerController*, FMinimalViewInfo&) {}
	virtual void SetupViewProjectionMatrix(FSceneViewProjectionData&) {}
	virtual void PrePostProcessPass_RenderThread(FRDGBuilder&, const FSceneView&, const FPostProcessingInputs&) {}
	bool StubIsActive(const FSceneViewExtensionContext& Context) const { return IsActiveThisFrame_Internal(Context); }

protected:
	virtual bool IsActiveThisFrame_Internal(const FSceneViewExtensionContext&) const { return true; }
};
class FSceneViewExtensions
{
public:
	static std::weak_ptr<FSceneViewExtensionBase>& StubOnly()
	{
		static std::weak_ptr<FSceneViewExtensionBase> Only;
		return Only;
	}
	template <class T, class... A>
	static TSharedRef<T, ESPMode::ThreadSafe> NewExtension(A&&... Arguments)
	{
		const auto Made = std::make_shared<T>(FAutoRegister(), std::forward<A>(Arguments)...);
		StubOnly() = Made;
		return TSharedRef<T, ESPMode::ThreadSafe>(Made);
	}
};
