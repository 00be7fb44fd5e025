// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "Components/ActorComponent.h"

class USceneComponent : public UActorComponent
{
public:
	const FTransform& GetComponentTransform() const { return Transform; }
	FTransform Transform;
};
