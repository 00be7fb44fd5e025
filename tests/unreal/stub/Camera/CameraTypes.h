// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "CoreMinimal.h"

enum EAspectRatioAxisConstraint : int
{
	AspectRatio_MaintainXFOV
};
template <class T>
class TEnumAsByte
{
public:
	TEnumAsByte(T InIt) : It(InIt) {}
	operator T() const { return It; }

private:
	T It;
};
namespace ECameraProjectionMode
{
	enum Type : int
	{
		Perspective,
		Orthographic
	};
}
class FViewport;
struct FSceneViewProjectionData;
struct FMinimalViewInfo
{
	FVector Location = FVector(0, 0, 0);
	FRotator Rotation = FRotator(0, 0, 0);
	float FOV = 90;
	float StubNear = 10;
	TEnumAsByte<ECameraProjectionMode::Type> ProjectionMode = ECameraProjectionMode::Perspective;
	float GetFinalPerspectiveNearClipPlane() const { return StubNear; }
	/** Of a field of view that is horizontal, whatever the constraint. */
	static void CalculateProjectionMatrixGivenView(const FMinimalViewInfo&, TEnumAsByte<EAspectRatioAxisConstraint>, FViewport*, FSceneViewProjectionData&);
};
