// SPDX-License-Identifier: MIT
// Runs a view of the plugin on the stub: a command a line, and after each the state in a line of JSON.
// `set FIELD VALUE`, `settings FIELD VALUE`, `camera X Y Z PITCH YAW ROLL`, `lens DEGREES NEAR`,
// `screen WIDTH HEIGHT`, `actor ID POSE SCALES`, `mover ID POSE SCALES`, `orthographic`, `begin`, `end`,
// `travel`, `second`, `step`, `capture` for a step of another view, `tick` for one without the renderer.
#include <cstdio>
#include <iostream>
#include <optional>
#include <sstream>
#include <thread>

#include "../../reference_client/cpp/programs/sha256.hpp"
#include "Camera/PlayerCameraManager.h"
#include "Components/SceneComponent.h"
#include "Engine/GameInstance.h"
#include "Engine/GameViewportClient.h"
#include "Engine/LocalPlayer.h"
#include "Engine/Texture2D.h"
#include "Engine/World.h"
#include "GameFramework/PlayerController.h"
#include "GlobalShader.h"
#include "Kismet/GameplayStatics.h"
#include "Modules/ModuleManager.h"
#include "PixelShaderUtils.h"
#include "PostProcess/PostProcessInputs.h"
#include "RenderGraphUtils.h"
#include "RenderingThread.h"
#include "SceneTexturesConfig.h"
#include "SceneView.h"
#include "SceneViewExtension.h"
#include "ShaderCore.h"
#include "SplatBusSettings.h"
#include "SplatBusSubsystem.h"
#include "SplatBusViewComponent.h"
#include "TextureResource.h"
#include "UnrealClient.h"

IModuleInterface* StubModule();

namespace
{
	std::vector<std::function<void(FRHICommandListImmediate&)>> Enqueued;
	std::optional<Stub::FDrawn> Drawn;
	std::string Mapped;
	APlayerController Player;
}

namespace Stub
{
	// Words of the tests are ASCII, but for what the server says, of which the rest is left out.
	std::u16string To16(const std::string& Words)
	{
		std::u16string Wide;
		for (const char Each : Words)
		{
			if (static_cast<unsigned char>(Each) < 128)
			{
				Wide.push_back(static_cast<char16_t>(Each));
			}
		}
		return Wide;
	}
	std::string To8(const std::u16string& Words)
	{
		return std::string(Words.begin(), Words.end());
	}
	std::vector<std::string>& Logged()
	{
		static std::vector<std::string> Words;
		return Words;
	}
	void Enqueue(std::function<void(FRHICommandListImmediate&)> Command)
	{
		Enqueued.push_back(std::move(Command));
	}
	void Draw(const FDrawn& It)
	{
		Drawn = It;
	}
}

void FlushRenderingCommands()
{
	FRHICommandListImmediate List;
	for (auto& Each : std::exchange(Enqueued, {}))
	{
		std::exchange(Each, nullptr)(List);
	}
}

void AddShaderSourceDirectoryMapping(const FString& Virtual, const FString& Real)
{
	Mapped = Stub::To8(*Virtual) + "=" + Stub::To8(*Real);
}
void AddCopyTexturePass(FRDGBuilder&, FRDGTextureRef From, FRDGTextureRef To)
{
	check(From && To && From != To && From->Desc.Extent.X == To->Desc.Extent.X);
}
const FGlobalShaderMap* GetGlobalShaderMap(ERHIFeatureLevel::Type)
{
	return nullptr;
}
uint32 GetMax2DTextureDimension()
{
	return 256;
}
APlayerController* UGameplayStatics::GetPlayerController(const UObject*, int32 PlayerIndex)
{
	return PlayerIndex == 0 ? &Player : nullptr;
}
void FMinimalViewInfo::CalculateProjectionMatrixGivenView(const FMinimalViewInfo& View, TEnumAsByte<EAspectRatioAxisConstraint>, FViewport*, FSceneViewProjectionData& Data)
{
	const FIntPoint Size = Data.GetConstrainedViewRect().Size();
	FMatrix Matrix = {};
	Matrix.M[0][0] = 1 / std::tan(static_cast<double>(View.FOV) * FRotator::Degree / 2);
	Matrix.M[1][1] = Matrix.M[0][0] * Size.X / Size.Y;
	Matrix.M[2][3] = 1;
	Matrix.M[3][2] = View.StubNear;
	Data.ProjectionMatrix = Matrix;
}

UTexture2D* UTexture2D::CreateTransient(int32 InWidth, int32 InHeight, EPixelFormat InFormat)
{
	static std::vector<std::unique_ptr<UTexture2D>> Garbage; // collected at the end
	Garbage.push_back(std::make_unique<UTexture2D>());
	UTexture2D* Texture = Garbage.back().get();
	Texture->Width = InWidth;
	Texture->Height = InHeight;
	Texture->Format = InFormat;
	return Texture;
}
void UTexture2D::UpdateResource()
{
	check(!SRGB && NeverStream && Filter == TF_Nearest);
	StubResource = std::make_shared<FTextureResource>();
	Stub::Enqueue([Resource = StubResource, W = Width, H = Height, F = Format](FRHICommandListImmediate&) {
		const auto Made = std::make_shared<FRHITexture>();
		Made->Width = static_cast<uint32>(W);
		Made->Height = static_cast<uint32>(H);
		Made->PixelBytes = F == PF_A32B32G32R32F ? 16 : 4;
		Made->Bytes.resize(size_t(Made->Width) * Made->Height * Made->PixelBytes);
		Resource->TextureRHI = Made;
	});
}
void UTexture2D::UpdateTextureRegions(int32 Mip, uint32 Count, const FUpdateTextureRegion2D* Region, uint32 Pitch, uint32 PixelBytes, uint8* Source,
	TFunction<void(uint8*, const FUpdateTextureRegion2D*)> CleanUp)
{
	check(Mip == 0 && Count == 1);
	Stub::Enqueue([=, Resource = StubResource](FRHICommandListImmediate&) {
		FRHITexture* Texture = Resource->TextureRHI;
		check(Texture->PixelBytes == PixelBytes && Region->Width == Texture->Width && Region->Height == Texture->Height && Pitch == PixelBytes * Region->Width);
		std::memcpy(Texture->Bytes.data(), Source, Texture->Bytes.size());
		CleanUp(Source, Region);
	});
}

namespace
{
	UWorld World;
	UGameInstance Game;
	USplatBusSubsystem Subsystem;
	USplatBusViewComponent View, Second;
	FViewport Viewport;
	UGameViewportClient ViewportClient;
	ULocalPlayer Local;
	APlayerCameraManager Cameras;
	AActor Actor;
	USceneComponent Mover;
	USplatBusSettings& Settings = *const_cast<USplatBusSettings*>(GetDefault<USplatBusSettings>());
	FMinimalViewInfo Seen;
	FSceneViewProjectionData Projected;

	std::string Text(const std::string& Words)
	{
		std::string Written = "\"";
		for (const char Each : Words)
		{
			if (Each == '"' || Each == '\\')
			{
				Written += '\\';
			}
			Written += Each < ' ' ? ' ' : Each;
		}
		return Written + '"';
	}
	std::string Text(const FString& Words) { return Text(Stub::To8(*Words)); }

	template <class List>
	std::string Texts(const List& All)
	{
		std::string Written;
		for (const auto& Each : All)
		{
			Written += (Written.empty() ? "" : ",") + Text(Each);
		}
		return "[" + Written + "]";
	}
	std::string Numbers(std::initializer_list<double> All)
	{
		std::string Written;
		char Buffer[40];
		for (const double Each : All)
		{
			std::snprintf(Buffer, sizeof Buffer, "%s%.17g", Written.empty() ? "" : ",", Each);
			Written += Buffer;
		}
		return "[" + Written + "]";
	}
	std::string Numbers(const FVector4f& It) { return Numbers({double(It.X), double(It.Y), double(It.Z), double(It.W)}); }
	std::string Digest(const FRHITexture& Texture)
	{
		Sha256 Sum;
		Sum.add(Texture.Bytes.data(), Texture.Bytes.size());
		return Text(Sum.hexadecimal());
	}

	std::string State()
	{
		const FSplatBusStatus Status = View.GetStatus();
		const FQuat Turn = Seen.Rotation.Quaternion();
		const auto& M = Projected.ProjectionMatrix.M;
		std::string Written = "{\"server\":" + Text(Status.Server) + ",\"ipc\":" + Text(Status.Ipc) + ",\"message\":" + Text(Status.Message)
			+ ",\"size\":" + Numbers({double(Status.Width), double(Status.Height)}) + ",\"images\":" + std::to_string(Status.Images)
			+ ",\"problems\":" + Texts(Status.Problems) + ",\"logged\":" + Texts(Stub::Logged()) + ",\"mapped\":" + Text(Mapped)
			+ ",\"location\":" + Numbers({Seen.Location.X, Seen.Location.Y, Seen.Location.Z}) + ",\"rotation\":" + Numbers({Turn.X, Turn.Y, Turn.Z, Turn.W})
			+ ",\"projection\":" + Numbers({M[0][0], M[1][1], M[2][0], M[2][1], M[2][3]});
		if (Drawn)
		{
			Written += ",\"lens\":" + Numbers(Drawn->Lens) + ",\"pixels\":" + Numbers(Drawn->Size) + ",\"meaning\":" + Numbers(Drawn->Meaning)
				+ ",\"scene\":" + Numbers(Drawn->Scene) + ",\"color\":" + Digest(*Drawn->Color) + ",\"depth\":" + Digest(*Drawn->Depth);
		}
		return Written + "}";
	}

	/** What the engine does in a frame, in the order in which it does: world, subsystem, views, renderer. */
	void Tick()
	{
		View.TickComponent(0.01f, LEVELTICK_All, &View.PrimaryComponentTick);
		if (const auto& Ticker = FTSTicker::GetCoreTicker().Only.Call)
		{
			Ticker(0.01f);
		}
		std::this_thread::sleep_for(std::chrono::milliseconds(5));
	}
	void Step(bool bIsCapture)
	{
		Tick();
		const auto Extension = FSceneViewExtensions::StubOnly().lock();
		const bool bIsActive = Extension && Extension->StubIsActive({&World}) && !Extension->StubIsActive({nullptr});
		Seen = Cameras.StubView;
		if (bIsActive)
		{
			Extension->SetupViewPoint(&Player, Seen);
		}
		Projected.SetViewRectangle(FIntRect(FIntPoint(0, 0), Viewport.StubSize));
		FMinimalViewInfo::CalculateProjectionMatrixGivenView(Seen, AspectRatio_MaintainXFOV, &Viewport, Projected);
		if (bIsActive)
		{
			Extension->SetupViewProjectionMatrix(Projected);
		}
		FlushRenderingCommands();
		Drawn.reset();
		if (bIsActive)
		{
			FRDGTexture Color{{Viewport.StubSize}}, Depth{{Viewport.StubSize}};
			TRDGUniformBuffer<FSceneTextureUniformParameters> Textures;
			Textures.Contents.SceneColorTexture = &Color;
			Textures.Contents.SceneDepthTexture = &Depth;
			FPostProcessingInputs Inputs;
			Inputs.SceneTextures = &Textures;
			FSceneView Scene;
			Scene.bIsSceneCapture = bIsCapture;
			Scene.PlayerIndex = Local.GetControllerId();
			FRDGBuilder Builder;
			Extension->PrePostProcessPass_RenderThread(Builder, Scene, Inputs);
		}
	}

	FTransform Transform(std::istream& From)
	{
		FTransform It;
		From >> It.Location.X >> It.Location.Y >> It.Location.Z >> It.Rotation.X >> It.Rotation.Y >> It.Rotation.Z >> It.Rotation.W;
		From >> It.Scale.X >> It.Scale.Y >> It.Scale.Z;
		return It;
	}

	void Set(const std::string& Field, const std::string& Value)
	{
		const bool bValue = Value == "true";
		if (Field == "CentimetresPerUnit") View.CentimetresPerUnit = std::stod(Value);
		else if (Field == "FarPlane") View.FarPlane = std::stod(Value);
		else if (Field == "bCompareDepth") View.bCompareDepth = bValue;
		else if (Field == "bFollowImage") View.bFollowImage = bValue;
		else if (Field == "bFitSize") View.bFitSize = bValue;
		else if (Field == "Host") Settings.Host = Stub::To16(Value).c_str();
		else if (Field == "IpcPort") Settings.IpcPort = std::stoi(Value);
		else if (Field == "MessagePort") Settings.MessagePort = std::stoi(Value);
		else std::abort();
	}

	void Do(const std::string& Word, std::istream& Words)
	{
		FMinimalViewInfo& Eye = Cameras.StubView;
		std::string Name, Value;
		if (Word == "camera") Words >> Eye.Location.X >> Eye.Location.Y >> Eye.Location.Z >> Eye.Rotation.Pitch >> Eye.Rotation.Yaw >> Eye.Rotation.Roll;
		else if (Word == "lens") Words >> Eye.FOV >> Eye.StubNear;
		else if (Word == "screen") Words >> Viewport.StubSize.X >> Viewport.StubSize.Y;
		else if (Word == "orthographic") Eye.ProjectionMode = ECameraProjectionMode::Orthographic;
		else if (Word == "set") Words >> Name >> Value, Set(Name, Value);
		else if (Word == "actor")
		{
			Words >> Name;
			Actor.Transform = Transform(Words);
			View.Objects = TMap<FString, TObjectPtr<AActor>>();
			View.Objects.Add(Stub::To16(Name).c_str(), &Actor);
		}
		else if (Word == "mover")
		{
			Words >> Name;
			Mover.Transform = Transform(Words);
			View.MoveObject(Stub::To16(Name).c_str(), &Mover);
		}
		else if (Word == "begin") View.BeginPlay();
		else if (Word == "end") View.EndPlay(EEndPlayReason::Destroyed);
		else if (Word == "travel") View.EndPlay(EEndPlayReason::LevelTransition);
		else if (Word == "tick") Tick();
		else if (Word == "second") Second.BeginPlay();
		else if (Word == "step" || Word == "capture") Step(Word == "capture");
		else std::abort();
	}
}

int main()
{
	Game.StubSubsystem = &Subsystem;
	World.StubGame = &Game;
	View.StubWorld = Second.StubWorld = &World;
	ViewportClient.Viewport = &Viewport;
	Local.ViewportClient = &ViewportClient;
	Player.StubLocal = &Local;
	Player.PlayerCameraManager = &Cameras;
	StubModule()->StartupModule();
	check(View.PrimaryComponentTick.bCanEverTick && View.PrimaryComponentTick.TickGroup == TG_PostUpdateWork);
	FSubsystemCollectionBase Collection;
	Subsystem.Initialize(Collection);
	std::string Line;
	while (std::getline(std::cin, Line))
	{
		std::istringstream Words(Line);
		std::string Word;
		Words >> Word;
		Do(Word, Words);
		std::cout << State() << std::endl;
	}
	Subsystem.Deinitialize();
}
