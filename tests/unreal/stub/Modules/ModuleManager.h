// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

class IModuleInterface
{
public:
	virtual ~IModuleInterface() = default;
	virtual void StartupModule() {}
};
#define IMPLEMENT_MODULE(Class, Name) \
	IModuleInterface* StubModule() \
	{ \
		static Class Module; \
		return &Module; \
	}
