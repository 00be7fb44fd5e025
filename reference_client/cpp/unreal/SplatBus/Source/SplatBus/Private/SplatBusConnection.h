// SPDX-License-Identifier: MIT
#pragma once

#include "SplatBusCore.h"
#include "SplatBusSizeRequests.h"

#include <array>

/** The client, what is known of its server, and what is wrong. For the game's thread. */
class FSplatBusConnection
{
public:
	explicit FSplatBusConnection(splatbus::ClientOptions Options) : Client(std::move(Options)) {}
	/** Waits until the renderer has no image of the client's any more. */
	~FSplatBusConnection();

	splatbus::Client Client;
	FSplatBusSizeRequests Sizes;

	/** Take the client's events, and log what is new of them. */
	void HearNews();

	/** The memory that is open, or null. */
	const splatbus::InitPacket* GetImages() const { return Images ? &*Images : nullptr; }
	/** Another number whenever what the server lent is gone. */
	int32 GetLosses() const { return Losses; }
	/** Whether it is known what the server has on the message channel. */
	bool IsKnown() const { return bIsKnown; }
	bool Has(std::string_view Capability) const;
	/** The images show the pose that was sent: nobody else steers. */
	void IsFollowed();
	void ListProblems(TArray<FString>& To) const;

private:
	void Hear(const splatbus::Connected& Event);
	void Hear(const splatbus::Lost& Event);
	void Hear(const splatbus::Images& Event);
	void Hear(const splatbus::ServerError& Event);
	void Hear(const splatbus::Problem& Event);
	void Hear(const splatbus::Telemetry&) {}
	void Hear(const splatbus::Replied& Event);

	std::optional<splatbus::InitPacket> Images;
	std::vector<std::string> Capabilities;
	/** By channel: why there is no connection; what the server said; what it did wrong. */
	std::array<std::string, 2> LostWhy, Said, Broken;
	std::string NoImages;
	int32 Losses = 0;
	bool bIsKnown = false, bIsBusy = false;
};
