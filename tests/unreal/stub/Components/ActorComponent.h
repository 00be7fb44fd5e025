// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "CoreMinimal.h"

namespace EEndPlayReason
{
	enum Type
	{
		Destroyed,
		LevelTransition
	};
}
enum ELevelTick
{
	LEVELTICK_All
};
enum ETickingGroup
{
	TG_PrePhysics,
	TG_PostUpdateWork
};
struct FActorComponentTickFunction
{
	bool bCanEverTick = false, bTickEvenWhenPaused = false;
	ETickingGroup TickGroup = TG_PrePhysics;
};
class UWorld;
class UActorComponent : public UObject
{
public:
	virtual void BeginPlay() {}
	virtual void EndPlay(const EEndPlayReason::Type) {}
	virtual void TickComponent(float, ELevelTick, FActorComponentTickFunction*) {}
	UWorld* GetWorld() const { return StubWorld; }
	FActorComponentTickFunction PrimaryComponentTick;
	UWorld* StubWorld = nullptr;
};
