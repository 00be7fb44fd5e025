// SPDX-License-Identifier: MIT
#pragma once

#include "CoreMinimal.h"
#include "Engine/DeveloperSettings.h"

#include "SplatBusSettings.generated.h"

/** Where the server is: in the project's settings, under Plugins. Its token comes from SPLATBUS_TOKEN alone, since settings are kept with the sources, and shipped. */
UCLASS(config = Game, defaultconfig, meta = (DisplayName = "SplatBus"))
class SPLATBUS_API USplatBusSettings : public UDeveloperSettings
{
	GENERATED_BODY()

public:
	/** Empty: SPLATBUS_HOST, or 127.0.0.1. */
	UPROPERTY(config, EditAnywhere, Category = "Server")
	FString Host;

	/** 0: SPLATBUS_IPC_PORT, or 6001. */
	UPROPERTY(config, EditAnywhere, Category = "Server")
	int32 IpcPort = 0;

	/** 0: SPLATBUS_MSG_PORT, or 6000. */
	UPROPERTY(config, EditAnywhere, Category = "Server")
	int32 MessagePort = 0;

	virtual FName GetCategoryName() const override { return TEXT("Plugins"); }
};
