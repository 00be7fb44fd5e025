// SPDX-License-Identifier: MIT
#pragma once

#include "Containers/Ticker.h"
#include "CoreMinimal.h"
#include "Subsystems/GameInstanceSubsystem.h"

#include "SplatBusSubsystem.generated.h"

class FSplatBusConnection;

/**
 * The connection to the server, while a view plays. It belongs to the game's instance and not to a world, so
 * that it outlives a change of level, and that neither the editor's worlds nor previews have one.
 */
UCLASS()
class SPLATBUS_API USplatBusSubsystem : public UGameInstanceSubsystem
{
	GENERATED_BODY()

public:
	virtual void Initialize(FSubsystemCollectionBase& Collection) override;
	virtual void Deinitialize() override;

	/** What is wrong, in words; empty where all is well, or no view plays. */
	UFUNCTION(BlueprintCallable, Category = "SplatBus")
	TArray<FString> GetProblems() const;

	/** Render the scene at this time, in seconds. False where nobody may send it, or no view plays. */
	UFUNCTION(BlueprintCallable, Category = "SplatBus")
	bool SendTime(double Seconds);

	/** A view begins to play; it has the connection, unless another view has it. */
	bool Begin(const UObject* View);

	/** It plays no more. The connection is ended, unless the level changes. */
	void End(const UObject* View, bool bLevelChanges);

	/** Null where none plays, or the settings are wrong. */
	FSplatBusConnection* GetConnection() const { return Connection.Get(); }

private:
	bool Turn(float DeltaSeconds);
	void Connect();

	TSharedPtr<FSplatBusConnection> Connection;
	const UObject* Owner = nullptr; // compared, and never looked into
	FString StartProblem;
	FTSTicker::FDelegateHandle Ticker;
};
