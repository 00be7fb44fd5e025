// SPDX-License-Identifier: MIT
#pragma once

#include "SplatBusCore.h"

/** Asks the server for images as large as the player's view: one request at a time, and not too often. */
class FSplatBusSizeRequests
{
public:
	/** Of the images that the server has, or will have soon; 0 while unknown. */
	int64 Width = 0, Height = 0;
	/** In words, or empty. */
	std::string Problem;

	bool IsUnderWay() const { return Request != 0; }

	/** The memory that is open, or null. */
	void ImagesAre(const splatbus::InitPacket* Packet);

	/** The server is another, perhaps. */
	void AskAgain();

	/** bAsks: whether to ask at all. Now: in seconds. */
	void Turn(splatbus::Client& Client, bool bAsks, int64 WantedWidth, int64 WantedHeight, double Now);

	/** Some request was answered. */
	void Hear(const splatbus::Replied& Replied, double Now);

private:
	int64 Request = 0, AskedWidth = 0, AskedHeight = 0;
	/** In seconds: when to ask at the soonest, and when for the same size. */
	double Soonest = 0, Again = 0;
};
