// SPDX-License-Identifier: MIT
// A stub of Unreal's header of this name: ours, without a line of Unreal's, made from what the plugin
// uses. It lets a compiler check names and types, and the tests run the plugin; it proves nothing of Unreal.
#pragma once

#include "CoreMinimal.h"
#include "RHICommandList.h"

namespace Stub
{
	/** The renderer's thread: it runs what was enqueued when the driver says so, or somebody flushes. */
	void Enqueue(std::function<void(FRHICommandListImmediate&)> Command);
}
void FlushRenderingCommands();
#define ENQUEUE_RENDER_COMMAND(Name) \
	struct Name; \
	Stub::Enqueue
