// SPDX-License-Identifier: MIT
#pragma once

#include "CoreMinimal.h"

#include "SplatBusStatus.generated.h"

/** What a view is connected to, and what is wrong, at one moment. */
USTRUCT(BlueprintType)
struct SPLATBUS_API FSplatBusStatus
{
	GENERATED_BODY()

	/** As the server names itself; empty where it speaks 1.0, or none is there. */
	UPROPERTY(BlueprintReadOnly, Category = "SplatBus")
	FString Server;

	/** How far each connection has come: away, greeted, agreed, or old for a server of 1.0. */
	UPROPERTY(BlueprintReadOnly, Category = "SplatBus")
	FString Ipc;

	UPROPERTY(BlueprintReadOnly, Category = "SplatBus")
	FString Message;

	/** Of the image that is shown, in pixels; 0 where none is. */
	UPROPERTY(BlueprintReadOnly, Category = "SplatBus")
	int32 Width = 0;

	UPROPERTY(BlueprintReadOnly, Category = "SplatBus")
	int32 Height = 0;

	/** How many were taken since play began. */
	UPROPERTY(BlueprintReadOnly, Category = "SplatBus")
	int64 Images = 0;

	/** Since the image that is shown was taken; negative where none is. */
	UPROPERTY(BlueprintReadOnly, Category = "SplatBus")
	double AgeSeconds = -1;

	/** In words, each a sentence or two; empty where all is well. */
	UPROPERTY(BlueprintReadOnly, Category = "SplatBus")
	TArray<FString> Problems;
};
