// SPDX-License-Identifier: MIT
#include "SplatBusView.h"

#include "Engine/Texture2D.h"
#include "HAL/PlatformTime.h"
#include "RenderingThread.h"
#include "RHICommandList.h"
#include "TextureResource.h"

namespace SplatBusUploads
{
	/** Lives until the renderer's thread has copied what it points to. */
	struct FUpload
	{
		splatbus::FrameLease Lease;
		FUpdateTextureRegion2D Region;
		FSplatBusShown Shown;
	};
	using FUploadRef = TSharedRef<FUpload, ESPMode::ThreadSafe>;

	/** The rows as they lie, the bottom one first [BUF-1]: the shader counts from below. */
	void Copy(const FUploadRef& Upload, UTexture2D* Texture, const float* Plane, uint32 Channels)
	{
		const uint32 PixelBytes = Channels * sizeof(float);
		uint8* Bytes = const_cast<uint8*>(reinterpret_cast<const uint8*>(Plane)); // which the engine only reads
		Texture->UpdateTextureRegions(0, 1, &Upload->Region, Upload->Region.Width * PixelBytes, PixelBytes, Bytes,
			[Upload](uint8*, const FUpdateTextureRegion2D*) {});
	}

	/** The words of SplatBusPixel.ush. */
	FSplatBusShown Meaning(const splatbus::FrameLease& Lease, double Unit)
	{
		const splatbus::Semantics& Semantics = Lease.packet().semantics;
		const splatbus::FrameCamera& Camera = Lease.frame().camera;
		const bool bIsRay = Semantics.depth.kind == splatbus::DepthSemanticsKind::ray_distance;
		const bool bIsPremultiplied = Semantics.alpha == splatbus::SemanticsAlpha::premultiplied;
		const bool bIsSrgb = Semantics.colorSpace == splatbus::SemanticsColorSpace::srgb;
		const double Empty = std::isfinite(Semantics.depth.empty) ? Semantics.depth.empty : 0; // neither is a surface
		FSplatBusShown Shown;
		Shown.Lens = FVector4f(static_cast<float>(Camera.fx), static_cast<float>(Camera.fy), static_cast<float>(Camera.cx), static_cast<float>(Camera.cy));
		Shown.Size = FVector4f(static_cast<float>(Camera.width), static_cast<float>(Camera.height), 0, 0);
		Shown.Meaning = FVector4f(bIsRay ? 1.f : 0.f, bIsPremultiplied ? 1.f : 0.f, bIsSrgb ? 1.f : 0.f, static_cast<float>(Empty));
		Shown.Scene = FVector4f(static_cast<float>(Unit), Lease.depth() ? 1.f : 0.f, 0, 0);
		return Shown;
	}
}

void FSplatBusView::Forget()
{
	Camera.reset();
	ImageProblem.clear();
	Undrawn = 0;
	if (Extension.IsValid())
	{
		Extension->AimAtNothing();
		ENQUEUE_RENDER_COMMAND(SplatBusForget)(
			[To = Extension](FRHICommandListImmediate&) { To->Show(FSplatBusShown()); });
	}
}

void FSplatBusView::Upload(splatbus::FrameLease Lease, UTexture2D* Color, UTexture2D* Depth, double InUnit)
{
	FTextureResource* ColorResource = Color->GetResource();
	FTextureResource* DepthResource = Depth->GetResource();
	if (!ColorResource || !DepthResource || !Extension.IsValid())
	{
		return; // no renderer, as on a server
	}
	Camera = Lease.frame().camera;
	Unit = InUnit;
	TakenAt = FPlatformTime::Seconds();
	++Images;

	const uint32 Width = static_cast<uint32>(Camera->width), Height = static_cast<uint32>(Camera->height);
	const SplatBusUploads::FUploadRef Upload = MakeShared<SplatBusUploads::FUpload, ESPMode::ThreadSafe>();
	Upload->Region = FUpdateTextureRegion2D(0, 0, 0, 0, Width, Height);
	Upload->Shown = SplatBusUploads::Meaning(Lease, Unit);
	Upload->Lease = std::move(Lease);
	SplatBusUploads::Copy(Upload, Color, Upload->Lease.color(), 4);
	if (const float* Plane = Upload->Lease.depth())
	{
		SplatBusUploads::Copy(Upload, Depth, Plane, 1);
	}
	ENQUEUE_RENDER_COMMAND(SplatBusShow)(
		[Upload, ColorResource, DepthResource, To = Extension](FRHICommandListImmediate&)
		{
			if (!Upload->Lease.is_still_lent())
			{
				To->Show(FSplatBusShown()); // the server may have written over it while it was copied
				return;
			}
			Upload->Shown.Color = ColorResource->TextureRHI;
			Upload->Shown.Depth = DepthResource->TextureRHI;
			To->Show(Upload->Shown);
		});
}
