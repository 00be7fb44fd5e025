// SPDX-License-Identifier: MIT
// Poses and lenses between a scene of Unreal and the wire. Units are centimetres to one of the splats' scene.
#pragma once

#include "SplatBusCore.h"

#include <cmath>

namespace SplatBusAxes
{
	inline splatbus::Pose ToWire(const FVector& Location, const FQuat& Rotation, double Unit)
	{
		const double Scale = 100 / Unit; // the core counts on a unit of 100 cm
		return splatbus::unreal::to_wire({{Location.X * Scale, Location.Y * Scale, Location.Z * Scale}, {Rotation.X, Rotation.Y, Rotation.Z, Rotation.W}});
	}

	inline void FromWire(const splatbus::Pose& Wire, double Unit, FVector& Location, FQuat& Rotation)
	{
		const splatbus::Pose Pose = splatbus::unreal::from_wire(Wire);
		const double Scale = Unit / 100;
		Location = FVector(Pose.position[0] * Scale, Pose.position[1] * Scale, Pose.position[2] * Scale);
		Rotation = FQuat(Pose.rotation[0], Pose.rotation[1], Pose.rotation[2], Pose.rotation[3]).GetNormalized();
	}

	/** Whether nothing has to be sent. */
	inline bool AreSame(const splatbus::Pose& One, const splatbus::Pose& Other)
	{
		return One.position == Other.position && One.rotation == Other.rotation;
	}

	inline bool AreSame(const splatbus::Intrinsics& One, const splatbus::Intrinsics& Other)
	{
		return One.fx == Other.fx && One.fy == Other.fy && One.cx == Other.cx && One.cy == Other.cy && One.width == Other.width
			&& One.height == Other.height && One.near_ == Other.near_ && One.far_ == Other.far_;
	}

	/** Whether these are one pose, but for rounding. */
	inline bool AreAlike(const splatbus::Pose& One, const splatbus::Pose& Other)
	{
		const auto IsNear = [](double A, double B) { return std::abs(A - B) <= 1e-6 * (1 + std::abs(A)); };
		for (size_t At = 0; At < 3; ++At)
		{
			if (!IsNear(One.position[At], Other.position[At]))
			{
				return false;
			}
		}
		for (size_t At = 0; At < 4; ++At)
		{
			if (!IsNear(One.rotation[At], Other.rotation[At]))
			{
				return false;
			}
		}
		return true;
	}

	/**
	 * The lens that a projection has for images of this size. The engine made it of the horizontal field of view,
	 * and of what its settings say of the shape. Where the images have another shape, their pixels are no squares.
	 */
	inline splatbus::Intrinsics LensOf(const FMatrix& Projection, int64 Width, int64 Height, double NearPlane, double FarPlane)
	{
		const double HalfWidth = 0.5 * static_cast<double>(Width), HalfHeight = 0.5 * static_cast<double>(Height);
		splatbus::Intrinsics Lens;
		Lens.fx = Projection.M[0][0] * HalfWidth;
		Lens.fy = Projection.M[1][1] * HalfHeight;
		Lens.cx = (1 + Projection.M[2][0]) * HalfWidth;
		Lens.cy = (1 - Projection.M[2][1]) * HalfHeight;
		Lens.width = Width;
		Lens.height = Height;
		Lens.near_ = NearPlane;
		Lens.far_ = FarPlane;
		return Lens;
	}

	/** The way back: have a projection see through the lens of an image, between the planes that it has. */
	inline void SeeThrough(const splatbus::FrameCamera& Camera, FMatrix& Projection)
	{
		const double Width = static_cast<double>(Camera.width), Height = static_cast<double>(Camera.height);
		Projection.M[0][0] = 2 * Camera.fx / Width;
		Projection.M[1][1] = 2 * Camera.fy / Height;
		Projection.M[2][0] = 2 * Camera.cx / Width - 1;
		Projection.M[2][1] = 1 - 2 * Camera.cy / Height;
	}
}
