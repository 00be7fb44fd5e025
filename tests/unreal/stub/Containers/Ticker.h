// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "CoreMinimal.h"

class FTickerDelegate
{
public:
	template <class T>
	static FTickerDelegate CreateUObject(T* Object, bool (T::*Method)(float))
	{
		FTickerDelegate Delegate;
		Delegate.Call = [Object, Method](float Seconds) { return (Object->*Method)(Seconds); };
		return Delegate;
	}
	std::function<bool(float)> Call;
};

class FTSTicker
{
public:
	typedef int32 FDelegateHandle;
	static FTSTicker& GetCoreTicker()
	{
		static FTSTicker Ticker;
		return Ticker;
	}
	FDelegateHandle AddTicker(const FTickerDelegate& Delegate)
	{
		Only = Delegate;
		return 1;
	}
	void RemoveTicker(FDelegateHandle) { Only = FTickerDelegate(); }
	FTickerDelegate Only;
};
