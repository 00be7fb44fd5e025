// SPDX-License-Identifier: MIT
#pragma once

#include "Components/ActorComponent.h"
#include "CoreMinimal.h"
#include "SplatBusStatus.h"

#include "SplatBusViewComponent.generated.h"

class AActor;
class FSplatBusView;
class USceneComponent;
class USplatBusSubsystem;
class UTexture2D;

/**
 * Shows to a player what a SplatBus server renders: the player's camera steers the server, its images are
 * laid over and under the scene by depth. One of them plays at a time; it may be on any actor.
 */
UCLASS(ClassGroup = (SplatBus), meta = (BlueprintSpawnableComponent, DisplayName = "SplatBus View"))
class SPLATBUS_API USplatBusViewComponent : public UActorComponent
{
	GENERATED_BODY()

public:
	USplatBusViewComponent();

	/** Whose camera it is. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "SplatBus")
	int32 PlayerIndex = 0;

	/** Centimetres to a unit of the splats' scene. 0: what the server says of metres, or 100. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "SplatBus")
	double CentimetresPerUnit = 0;

	/** Geometry hides splats, and splats geometry. Off: splats cover all. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "SplatBus")
	bool bCompareDepth = true;

	/** Draw the scene as the camera of the image stood, so that both fit. Off: as the camera stands now. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "SplatBus")
	bool bFollowImage = true;

	/** Ask the server for images as large as the player's view. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "SplatBus")
	bool bFitSize = true;

	/** Nothing farther is rendered by the server, in centimetres; Unreal's own cameras see on. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "SplatBus")
	double FarPlane = 1000000;

	/** Ids of the server's scene, "default" being the main object, and the actors that move them. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "SplatBus")
	TMap<FString, TObjectPtr<AActor>> Objects;

	/** Have a component move an object of the server's scene; none: leave it where it is. Goes before Objects. */
	UFUNCTION(BlueprintCallable, Category = "SplatBus")
	void MoveObject(const FString& Id, USceneComponent* Component);

	UFUNCTION(BlueprintCallable, Category = "SplatBus")
	FSplatBusStatus GetStatus() const;

	virtual void BeginPlay() override;
	virtual void EndPlay(const EEndPlayReason::Type Reason) override;
	virtual void TickComponent(float DeltaTime, ELevelTick TickType, FActorComponentTickFunction* ThisTickFunction) override;

private:
	USplatBusSubsystem* GetSubsystem() const;
	void SendObjects(double Unit);
	void FitTextures(int32 Width, int32 Height);
	void TakeImage();

	UPROPERTY(Transient)
	TMap<FString, TObjectPtr<USceneComponent>> Movers;

	UPROPERTY(Transient)
	TObjectPtr<UTexture2D> ColorTexture;

	UPROPERTY(Transient)
	TObjectPtr<UTexture2D> DepthTexture;

	TSharedPtr<FSplatBusView> View;
};
