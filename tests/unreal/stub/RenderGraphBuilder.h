// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "RHI.h"

struct FRDGTextureDesc
{
	FIntPoint Extent;
};
class FRDGTexture
{
public:
	FRDGTextureDesc Desc;
};
typedef FRDGTexture* FRDGTextureRef;
class FRDGBuilder
{
public:
	FRDGTextureRef CreateTexture(const FRDGTextureDesc& Desc, const TCHAR*)
	{
		Made.push_back(std::make_shared<FRDGTexture>(FRDGTexture{Desc}));
		return Made.back().get();
	}
	template <class T>
	T* AllocParameters()
	{
		const auto Allocated = std::make_shared<T>();
		Parameters.push_back(Allocated);
		return Allocated.get();
	}

private:
	std::vector<std::shared_ptr<FRDGTexture>> Made;
	std::vector<std::shared_ptr<void>> Parameters;
};
struct FRDGEventName
{
};
#define RDG_EVENT_NAME(Name) FRDGEventName()
