// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "Camera/CameraTypes.h"

class UGameViewportClient;
class ULocalPlayer : public UObject
{
public:
	int32 GetControllerId() const { return 3; }
	TObjectPtr<UGameViewportClient> ViewportClient;
	FVector2D Origin = {0, 0}, Size = {1, 1};
	TEnumAsByte<EAspectRatioAxisConstraint> AspectRatioAxisConstraint = AspectRatio_MaintainXFOV;
};
