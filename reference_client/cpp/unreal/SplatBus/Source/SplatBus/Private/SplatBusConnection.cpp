// SPDX-License-Identifier: MIT
#include "SplatBusConnection.h"

#include "HAL/PlatformTime.h"
#include "RenderingThread.h"

#include <algorithm>

namespace SplatBusNews
{
	constexpr const char* Channels[] = {"images", "messages"};

	/** Log it, unless it is what was there. */
	void Keep(std::string& Place, const std::string& What, size_t Channel)
	{
		if (Place != What)
		{
			UE_LOG(LogSplatBus, Warning, TEXT("%s: %s"), UTF8_TO_TCHAR(Channels[Channel]), *SplatBusWords(What));
		}
		Place = What;
	}
}

FSplatBusConnection::~FSplatBusConnection()
{
	FlushRenderingCommands();
}

void FSplatBusConnection::HearNews()
{
	while (const std::optional<splatbus::Event> Event = Client.next_event())
	{
		std::visit([this](const auto& It) { Hear(It); }, *Event);
	}
}

bool FSplatBusConnection::Has(std::string_view Capability) const
{
	return std::find(Capabilities.begin(), Capabilities.end(), Capability) != Capabilities.end();
}

void FSplatBusConnection::IsFollowed()
{
	if (bIsBusy)
	{
		bIsBusy = false;
		Said[static_cast<size_t>(splatbus::ChannelName::message)].clear();
	}
}

void FSplatBusConnection::ListProblems(TArray<FString>& To) const
{
	for (size_t At = 0; At < 2; ++At)
	{
		const std::string Channel = std::string(SplatBusNews::Channels[At]) + ": ";
		if (!LostWhy[At].empty())
		{
			To.Add(SplatBusWords(Channel + LostWhy[At]));
		}
		if (!Said[At].empty())
		{
			To.Add(SplatBusWords(Channel + "the server says " + Said[At]));
		}
		if (!Broken[At].empty())
		{
			To.Add(SplatBusWords(Channel + "the server broke a rule: " + Broken[At]));
		}
	}
	if (!NoImages.empty())
	{
		To.Add(SplatBusWords("no images: " + NoImages));
	}
	if (!Sizes.Problem.empty())
	{
		To.Add(SplatBusWords(Sizes.Problem));
	}
}

void FSplatBusConnection::Hear(const splatbus::Connected& Event)
{
	const size_t At = static_cast<size_t>(Event.channel);
	LostWhy[At].clear();
	Said[At].clear();
	Broken[At].clear();
	const std::string Server = Event.welcome ? Event.welcome->server.name + " " + Event.welcome->server.version : "a server of 1.0";
	UE_LOG(LogSplatBus, Log, TEXT("%s: %s"), UTF8_TO_TCHAR(SplatBusNews::Channels[At]), *SplatBusWords(Server));
	if (Event.channel == splatbus::ChannelName::message)
	{
		Capabilities = Event.welcome ? Event.welcome->capabilities : std::vector<std::string>();
		bIsKnown = true;
		bIsBusy = false;
		Sizes.AskAgain();
	}
}

void FSplatBusConnection::Hear(const splatbus::Lost& Event)
{
	const size_t At = static_cast<size_t>(Event.channel);
	SplatBusNews::Keep(LostWhy[At], Event.why, At);
	if (Event.channel == splatbus::ChannelName::message)
	{
		Capabilities.clear();
		bIsKnown = false;
		return;
	}
	++Losses;
	Images.reset();
	NoImages.clear();
	Sizes.ImagesAre(nullptr);
}

void FSplatBusConnection::Hear(const splatbus::Images& Event)
{
	Images = Event.packet;
	if (Images)
	{
		NoImages.clear();
	}
	else
	{
		++Losses;
		SplatBusNews::Keep(NoImages, Event.why.empty() ? "the server has none yet" : Event.why, static_cast<size_t>(splatbus::ChannelName::ipc));
	}
	Sizes.ImagesAre(GetImages());
}

void FSplatBusConnection::Hear(const splatbus::ServerError& Event)
{
	const size_t At = static_cast<size_t>(Event.channel);
	bIsBusy |= Event.error.code == splatbus::ErrorCode::busy && Event.channel == splatbus::ChannelName::message;
	SplatBusNews::Keep(Said[At], Event.error.code + ": " + Event.error.message, At);
}

void FSplatBusConnection::Hear(const splatbus::Problem& Event)
{
	const size_t At = static_cast<size_t>(Event.channel);
	SplatBusNews::Keep(Broken[At], Event.what, At);
}

void FSplatBusConnection::Hear(const splatbus::Replied& Event)
{
	Sizes.Hear(Event, FPlatformTime::Seconds());
}
