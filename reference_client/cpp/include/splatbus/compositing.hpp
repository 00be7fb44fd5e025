// SPDX-License-Identifier: MIT
// A pixel of splats over a pixel of the program's own geometry, as a post-process does it on a GPU.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "splatbus/wire.hpp"

namespace splatbus {

/// The planar depth of a pixel in scene units; +∞ where nothing is [BUF-8, BUF-9, MEM-12]. `column`
/// counts from the left, `row` from the top.
inline float planar_depth(float stored, float alpha, const Semantics& semantics, const FrameCamera& camera, std::int64_t column, std::int64_t row) {
  const bool is_surface = stored > 0 && std::isfinite(stored) && stored != static_cast<float>(semantics.depth.empty) && alpha > 0;
  if (!is_surface) return std::numeric_limits<float>::infinity();
  if (semantics.depth.kind == DepthSemanticsKind::planar_z) return stored;
  const double x = (static_cast<double>(column) + 0.5 - camera.cx) / camera.fx;
  const double y = (static_cast<double>(row) + 0.5 - camera.cy) / camera.fy;
  return static_cast<float>(stored / std::sqrt(1 + x * x + y * y));
}

/// One channel: the splat where it is in front, the geometry elsewhere; rounded once [ACC-10]. Both
/// depths are planar; that of a background is +∞.
inline float over(float color, float alpha, float depth, bool is_straight, float own, float own_depth) {
  if (!(depth < own_depth)) return own;
  const double seen = is_straight ? static_cast<double>(alpha) * color : color;
  return static_cast<float>(seen + (1.0 - alpha) * own);
}

}  // namespace splatbus
