// SPDX-License-Identifier: MIT
// The client's headers, which include those of the operating system's sockets and mappings.
#pragma once

#include "CoreMinimal.h"

THIRD_PARTY_INCLUDES_START
#if PLATFORM_WINDOWS
#include "Windows/AllowWindowsPlatformTypes.h"
#endif
#include "splatbus/client.hpp"
#if PLATFORM_WINDOWS
#include "Windows/HideWindowsPlatformTypes.h"
#endif
THIRD_PARTY_INCLUDES_END

DECLARE_LOG_CATEGORY_EXTERN(LogSplatBus, Log, All);

/** Words of the client, for Unreal. */
inline FString SplatBusWords(const std::string& Words)
{
	return FString(UTF8_TO_TCHAR(Words.c_str()));
}

/** Words of Unreal, for the client. */
inline std::string SplatBusText(const FString& Words)
{
	return std::string(TCHAR_TO_UTF8(*Words));
}
