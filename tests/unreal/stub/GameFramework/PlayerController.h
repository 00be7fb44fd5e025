// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "GameFramework/Actor.h"

class APlayerCameraManager;
class ULocalPlayer;
class APlayerController : public AActor
{
public:
	ULocalPlayer* GetLocalPlayer() const { return StubLocal; }
	TObjectPtr<APlayerCameraManager> PlayerCameraManager;
	ULocalPlayer* StubLocal = nullptr;
};
