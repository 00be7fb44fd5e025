// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "CoreMinimal.h"

struct FPaths
{
	static FString Combine(const FString& Folder, const FString& Name) { return (std::u16string(*Folder) + u"/" + *Name).c_str(); }
};
