// SPDX-License-Identifier: MIT
#include "SplatBusViewComponent.h"

#include "Camera/PlayerCameraManager.h"
#include "Components/SceneComponent.h"
#include "Engine/GameInstance.h"
#include "Engine/GameViewportClient.h"
#include "Engine/LocalPlayer.h"
#include "Engine/Texture2D.h"
#include "Engine/World.h"
#include "GameFramework/Actor.h"
#include "GameFramework/PlayerController.h"
#include "HAL/PlatformTime.h"
#include "Kismet/GameplayStatics.h"
#include "RenderingThread.h"
#include "RHI.h"
#include "SplatBusAxes.h"
#include "SplatBusSubsystem.h"
#include "SplatBusView.h"
#include "UnrealClient.h"

namespace SplatBusEyes
{
	constexpr double Uniform = 1e-3;
	constexpr int32 TicksToDraw = 30;

	/** What a player sees, wherever the scene is drawn from. */
	struct FEye
	{
		FVector Location = FVector(0, 0, 0);
		FQuat Rotation = FQuat(0, 0, 0, 1);
		FMatrix Projection;
		FIntPoint Size = FIntPoint(0, 0);
		double NearPlane = 10;
		bool bIsOrthographic = false;
	};

	/** Nothing where the player is no local one, or has no camera yet. */
	std::optional<FEye> Open(const UObject* Context, int32 PlayerIndex)
	{
		const APlayerController* Player = UGameplayStatics::GetPlayerController(Context, PlayerIndex);
		const ULocalPlayer* Local = Player ? Player->GetLocalPlayer() : nullptr;
		if (!Local || !Player->PlayerCameraManager || !Local->ViewportClient || !Local->ViewportClient->Viewport)
		{
			return std::nullopt;
		}
		FMinimalViewInfo View = Player->PlayerCameraManager->GetCameraCacheView();
		View.FOV = Player->PlayerCameraManager->GetFOVAngle();
		FViewport* Viewport = Local->ViewportClient->Viewport;
		const FIntPoint All = Viewport->GetSizeXY();
		const FIntPoint From(FMath::TruncToInt32(Local->Origin.X * All.X), FMath::TruncToInt32(Local->Origin.Y * All.Y));
		const FIntPoint Size(FMath::TruncToInt32(Local->Size.X * All.X), FMath::TruncToInt32(Local->Size.Y * All.Y));
		if (Size.X < 1 || Size.Y < 1)
		{
			return std::nullopt;
		}
		FSceneViewProjectionData Data;
		Data.ViewOrigin = View.Location;
		Data.SetViewRectangle(FIntRect(From, FIntPoint(From.X + Size.X, From.Y + Size.Y)));
		FMinimalViewInfo::CalculateProjectionMatrixGivenView(View, Local->AspectRatioAxisConstraint, Viewport, Data);
		FEye Eye;
		Eye.Location = View.Location;
		Eye.Rotation = View.Rotation.Quaternion();
		Eye.Projection = Data.ProjectionMatrix;
		Eye.Size = Data.GetConstrainedViewRect().Size();
		Eye.NearPlane = View.GetFinalPerspectiveNearClipPlane();
		Eye.bIsOrthographic = View.ProjectionMode == ECameraProjectionMode::Orthographic;
		return Eye;
	}

	/** Centimetres to a unit of the splats' scene. */
	double UnitOf(double Set, const splatbus::InitPacket* Packet)
	{
		return Set > 0 ? Set : 100 * (Packet ? Packet->semantics.unitMetres.value_or(1) : 1);
	}

	/** Say where the camera is, if that is new. */
	void Send(FSplatBusConnection& Connection, FSplatBusView& View, const FEye& Eye, double Unit, double FarPlane)
	{
		const splatbus::Pose Pose = SplatBusAxes::ToWire(Eye.Location, Eye.Rotation, Unit);
		// Only a lens of the images' shape is taken [CAM-6], and what that is the server says meanwhile.
		const FSplatBusSizeRequests& Sizes = Connection.Sizes;
		std::optional<splatbus::Intrinsics> Lens;
		View.bIsOrthographic = Eye.bIsOrthographic;
		if (Sizes.Width > 0 && !Sizes.IsUnderWay() && !Eye.bIsOrthographic)
		{
			Lens = SplatBusAxes::LensOf(Eye.Projection, Sizes.Width, Sizes.Height, Eye.NearPlane / Unit, FarPlane / Unit);
		}
		const bool bIsSameLens = !Lens || (View.SentLens && SplatBusAxes::AreSame(*Lens, *View.SentLens));
		if (View.SentPose && SplatBusAxes::AreSame(Pose, *View.SentPose) && bIsSameLens)
		{
			return;
		}
		View.SentPose = Pose;
		View.SentLens = Lens;
		const char* Wrong = Connection.Client.send_camera(Pose, Lens ? &*Lens : nullptr);
		View.CameraProblem = Wrong ? std::string("the camera cannot be sent: ") + Wrong : std::string();
	}
}

USplatBusViewComponent::USplatBusViewComponent()
{
	PrimaryComponentTick.bCanEverTick = true;
	PrimaryComponentTick.bTickEvenWhenPaused = true;
	PrimaryComponentTick.TickGroup = TG_PostUpdateWork; // after the cameras
}

void USplatBusViewComponent::MoveObject(const FString& Id, USceneComponent* Component)
{
	if (Component)
	{
		Movers.Add(Id, Component);
	}
	else
	{
		Movers.Remove(Id);
	}
}

USplatBusSubsystem* USplatBusViewComponent::GetSubsystem() const
{
	const UGameInstance* Game = GetWorld() ? GetWorld()->GetGameInstance() : nullptr;
	return Game ? Game->GetSubsystem<USplatBusSubsystem>() : nullptr;
}

void USplatBusViewComponent::BeginPlay()
{
	Super::BeginPlay();
	USplatBusSubsystem* Subsystem = GetSubsystem();
	if (Subsystem && Subsystem->Begin(this))
	{
		View = MakeShared<FSplatBusView>();
		View->Extension = FSceneViewExtensions::NewExtension<FSplatBusViewExtension>(GetWorld(), PlayerIndex);
	}
	else if (Subsystem)
	{
		UE_LOG(LogSplatBus, Warning, TEXT("another SplatBus View plays already"));
	}
}

void USplatBusViewComponent::EndPlay(const EEndPlayReason::Type Reason)
{
	if (View.IsValid())
	{
		View->Forget();
		View.Reset();
		if (USplatBusSubsystem* Subsystem = GetSubsystem())
		{
			Subsystem->End(this, Reason == EEndPlayReason::LevelTransition);
		}
	}
	Super::EndPlay(Reason);
}

void USplatBusViewComponent::TickComponent(float DeltaTime, ELevelTick TickType, FActorComponentTickFunction* ThisTickFunction)
{
	Super::TickComponent(DeltaTime, TickType, ThisTickFunction);
	USplatBusSubsystem* Subsystem = View.IsValid() ? GetSubsystem() : nullptr;
	FSplatBusConnection* Connection = Subsystem ? Subsystem->GetConnection() : nullptr;
	if (!Connection)
	{
		return;
	}
	if (View->Losses != Connection->GetLosses())
	{
		View->Losses = Connection->GetLosses();
		View->Forget();
	}
	if (View->Subscribed != bCompareDepth)
	{
		View->Subscribed = bCompareDepth; // depth is sent only where it is used
		Connection->Client.subscribe(true, bCompareDepth);
		ENQUEUE_RENDER_COMMAND(SplatBusCompareDepth)(
			[To = View->Extension, bCompare = bCompareDepth](FRHICommandListImmediate&) { To->CompareDepth(bCompare); });
	}
	const double Unit = SplatBusEyes::UnitOf(CentimetresPerUnit, Connection->GetImages());
	if (const std::optional<SplatBusEyes::FEye> Eye = SplatBusEyes::Open(this, PlayerIndex))
	{
		const bool bAsks = bFitSize && Connection->Has(splatbus::Capability::viewport);
		Connection->Sizes.Turn(Connection->Client, bAsks, Eye->Size.X, Eye->Size.Y, FPlatformTime::Seconds());
		SplatBusEyes::Send(*Connection, *View, *Eye, Unit, FarPlane);
	}
	SendObjects(Unit);
	TakeImage();
	if (View->Camera && bFollowImage)
	{
		View->Extension->Aim(*View->Camera, View->Unit);
	}
	else
	{
		View->Extension->AimAtNothing();
	}
	const bool bIsDrawn = View->Extension->TakeDrawn() > 0 || !View->Camera;
	View->Undrawn = bIsDrawn ? 0 : View->Undrawn + 1;
}

void USplatBusViewComponent::SendObjects(double Unit)
{
	splatbus::Client& Client = GetSubsystem()->GetConnection()->Client;
	const auto Send = [this, Unit, &Client](const FString& Id, const FTransform& Transform)
	{
		const std::string Name = SplatBusText(Id);
		FSplatBusView::FMoved& Moved = View->Moved[Name];
		const FVector Scale = Transform.GetScale3D();
		const double Most = SplatBusEyes::Uniform * FMath::Abs(Scale.X);
		Moved.bIsUneven = FMath::Abs(Scale.Y - Scale.X) > Most || FMath::Abs(Scale.Z - Scale.X) > Most;
		const splatbus::Pose Pose = SplatBusAxes::ToWire(Transform.GetLocation(), Transform.GetRotation(), Unit);
		if (Moved.Pose && Moved.Scale == Scale.X && SplatBusAxes::AreSame(Pose, *Moved.Pose))
		{
			return;
		}
		Moved.Pose = Pose;
		Moved.Scale = Scale.X;
		const char* Wrong = Client.send_object(Name, Pose, Scale.X);
		Moved.Wrong = Wrong ? Wrong : "";
	};
	for (const TPair<FString, TObjectPtr<AActor>>& Each : Objects)
	{
		if (Each.Value && !Movers.Contains(Each.Key))
		{
			Send(Each.Key, Each.Value->GetActorTransform());
		}
	}
	for (const TPair<FString, TObjectPtr<USceneComponent>>& Each : Movers)
	{
		if (Each.Value)
		{
			Send(Each.Key, Each.Value->GetComponentTransform());
		}
	}
}

void USplatBusViewComponent::FitTextures(int32 Width, int32 Height)
{
	if (ColorTexture && ColorTexture->GetSizeX() == Width && ColorTexture->GetSizeY() == Height)
	{
		return;
	}
	const auto Plane = [Width, Height](EPixelFormat Format)
	{
		UTexture2D* Texture = UTexture2D::CreateTransient(Width, Height, Format);
		Texture->SRGB = false;
		Texture->Filter = TF_Nearest;
		Texture->NeverStream = true;
		Texture->UpdateResource();
		return Texture;
	};
	ColorTexture = Plane(PF_A32B32G32R32F);
	DepthTexture = Plane(PF_R32_FLOAT);
}

void USplatBusViewComponent::TakeImage()
{
	FSplatBusConnection& Connection = *GetSubsystem()->GetConnection();
	splatbus::FrameLease Lease = Connection.Client.take_frame();
	if (Lease && !Lease.has_camera())
	{
		View->ImageProblem = "the server speaks 1.0, which does not say what camera an image is of";
	}
	else if (Lease && Lease.color())
	{
		const splatbus::Meta& Meta = Lease.packet().meta;
		const int64 Most = static_cast<int64>(GetMax2DTextureDimension());
		if (Meta.w > Most || Meta.h > Most)
		{
			View->ImageProblem = "an image of " + std::to_string(Meta.w) + " x " + std::to_string(Meta.h) + " is more than this GPU takes";
		}
		else
		{
			View->ImageProblem.clear();
			FitTextures(static_cast<int32>(Meta.w), static_cast<int32>(Meta.h));
			const double Unit = SplatBusEyes::UnitOf(CentimetresPerUnit, &Lease.packet());
			View->Upload(std::move(Lease), ColorTexture, DepthTexture, Unit);
		}
	}
	if (View->Camera && View->SentPose && SplatBusAxes::AreAlike(*View->SentPose, {View->Camera->position, View->Camera->rotation}))
	{
		Connection.IsFollowed();
	}
}

FSplatBusStatus USplatBusViewComponent::GetStatus() const
{
	static const TCHAR* const States[] = {TEXT("away"), TEXT("greeted"), TEXT("agreed"), TEXT("old")};
	FSplatBusStatus Status;
	const USplatBusSubsystem* Subsystem = View.IsValid() ? GetSubsystem() : nullptr;
	if (!Subsystem)
	{
		Status.Ipc = Status.Message = States[0];
		Status.Problems.Add(TEXT("it does not play, or another SplatBus View does"));
		return Status;
	}
	Status.Problems = Subsystem->GetProblems();
	const FSplatBusConnection* Connection = Subsystem->GetConnection();
	const splatbus::ClientStatus Told = Connection ? Connection->Client.status() : splatbus::ClientStatus();
	Status.Server = SplatBusWords(Told.server);
	Status.Ipc = States[static_cast<int32>(Told.ipc)];
	Status.Message = States[static_cast<int32>(Told.message)];
	Status.Images = View->Images;
	if (View->Camera)
	{
		Status.Width = static_cast<int32>(View->Camera->width);
		Status.Height = static_cast<int32>(View->Camera->height);
		Status.AgeSeconds = FPlatformTime::Seconds() - View->TakenAt;
	}
	const auto Add = [&Status](const std::string& Problem)
	{
		if (!Problem.empty())
		{
			Status.Problems.Add(SplatBusWords(Problem));
		}
	};
	Add(View->bIsOrthographic ? "the camera is orthographic: splats are seen through a perspective lens only" : "");
	Add(View->CameraProblem);
	Add(View->ImageProblem);
	for (const auto& [Id, Moved] : View->Moved)
	{
		const bool bIsMany = Id != "default" || Moved.Scale != 1; // only a server with the capability `objects` moves it so [OBJ-2]
		if (!Moved.Wrong.empty())
		{
			Add("the object \"" + Id + "\" cannot be sent: " + Moved.Wrong);
		}
		else if (Moved.bIsUneven)
		{
			Add("the object \"" + Id + "\" is scaled by x along all axes, what moves it is not");
		}
		else if (bIsMany && Connection && Connection->IsKnown() && !Connection->Has(splatbus::Capability::objects))
		{
			Add("the server moves the object \"default\" alone, at scale 1");
		}
	}
	Add(View->Undrawn > SplatBusEyes::TicksToDraw ? "nothing draws the images: the player's view is not rendered, or not by the deferred renderer" : "");
	return Status;
}
