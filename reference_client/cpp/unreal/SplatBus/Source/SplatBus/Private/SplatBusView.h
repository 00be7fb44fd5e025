// SPDX-License-Identifier: MIT
#pragma once

#include "SplatBusConnection.h"
#include "SplatBusViewExtension.h"

#include <map>

class UTexture2D;

/** What a view keeps while it plays. */
class FSplatBusView
{
public:
	/** The pose and the lens that were said last. */
	std::optional<splatbus::Pose> SentPose;
	std::optional<splatbus::Intrinsics> SentLens;
	std::string CameraProblem;
	bool bIsOrthographic = false;

	/** Of an object: what was said last, and why it cannot be, or empty. */
	struct FMoved
	{
		std::optional<splatbus::Pose> Pose;
		double Scale = 1;
		bool bIsUneven = false;
		std::string Wrong;
	};
	std::map<std::string, FMoved, std::less<>> Moved;

	/** What depth was last subscribed to. */
	std::optional<bool> Subscribed;

	/** The camera of the image that is shown, the frame itself being used again for the next; none where none is. */
	std::optional<splatbus::FrameCamera> Camera;
	double Unit = 100;
	double TakenAt = 0;
	int64 Images = 0;
	std::string ImageProblem;
	int32 Losses = 0;
	/** How long it has not been drawn, in ticks. */
	int32 Undrawn = 0;

	TSharedPtr<FSplatBusViewExtension, ESPMode::ThreadSafe> Extension;

	/** Nothing is shown any more. */
	void Forget();

	/** Copies the image into the textures, in the renderer's thread, and lets go of it then. */
	void Upload(splatbus::FrameLease Lease, UTexture2D* Color, UTexture2D* Depth, double InUnit);
};
