// SPDX-License-Identifier: MIT
#include "SplatBusSizeRequests.h"

#include <limits>

namespace SplatBusSizes
{
	constexpr double BusyPause = 0.5, FailurePause = 1, Ever = std::numeric_limits<double>::infinity();
}

void FSplatBusSizeRequests::ImagesAre(const splatbus::InitPacket* Packet)
{
	Width = Packet ? Packet->meta.w : 0;
	Height = Packet ? Packet->meta.h : 0;
}

void FSplatBusSizeRequests::AskAgain()
{
	Again = 0;
	Problem.clear();
}

void FSplatBusSizeRequests::Turn(splatbus::Client& Client, bool bAsks, int64 WantedWidth, int64 WantedHeight, double Now)
{
	constexpr int64 Most = splatbus::limits::max_image_size;
	if (IsUnderWay() || !bAsks || Width == 0 || WantedWidth < 1 || WantedHeight < 1 || WantedWidth > Most || WantedHeight > Most)
	{
		return;
	}
	const bool bIsNew = WantedWidth != AskedWidth || WantedHeight != AskedHeight;
	const bool bFits = WantedWidth == Width && WantedHeight == Height;
	if (bIsNew || bFits)
	{
		Problem.clear();
	}
	if (bFits || Now < Soonest || (!bIsNew && Now < Again))
	{
		return;
	}
	AskedWidth = WantedWidth;
	AskedHeight = WantedHeight;
	Request = Client.ask_for_viewport(AskedWidth, AskedHeight);
}

void FSplatBusSizeRequests::Hear(const splatbus::Replied& Replied, double Now)
{
	if (Request == 0 || Replied.request != Request)
	{
		return;
	}
	Request = 0;
	Soonest = Now + splatbus::limits::ask_again_min_seconds;
	Again = Now + SplatBusSizes::FailurePause;
	const auto* Failed = std::get_if<splatbus::Failure>(&Replied.reply);
	if (!Failed)
	{
		Width = AskedWidth;
		Height = AskedHeight;
		return;
	}
	if (!Failed->error)
	{
		return; // the connection, of which others tell
	}
	const bool bIsBusy = Failed->error->code == splatbus::ErrorCode::busy;
	if (bIsBusy)
	{
		Soonest = Now + SplatBusSizes::BusyPause; // [VPT-9]
	}
	Again = bIsBusy ? Now + SplatBusSizes::BusyPause : SplatBusSizes::Ever;
	Problem = "the server does not give images of " + std::to_string(AskedWidth) + " x " + std::to_string(AskedHeight) + ": " + Failed->why;
}
