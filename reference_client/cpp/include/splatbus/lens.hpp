// SPDX-License-Identifier: MIT
// Intrinsics: made of a field of view, checked, read and written [CAM-4].
#pragma once

#include <cmath>
#include <cstdint>

#include "splatbus/protocol/part.hpp"

namespace splatbus {

/// A symmetric lens for images of this size.
inline Intrinsics lens_of(double vertical_degrees, std::int64_t width, std::int64_t height, double near_plane, double far_plane) {
  constexpr double pi = 3.14159265358979323846;
  Intrinsics lens;
  lens.fx = lens.fy = static_cast<double>(height) / 2 / std::tan(vertical_degrees * pi / 360);
  lens.cx = static_cast<double>(width) / 2;
  lens.cy = static_cast<double>(height) / 2;
  lens.width = width;
  lens.height = height;
  lens.near_ = near_plane;
  lens.far_ = far_plane;
  return lens;
}

/// Why nobody may send it, or null.
inline const char* why_not(const Intrinsics& lens) {
  constexpr auto most = static_cast<double>(limits::max_lens);
  const auto is_length = [](double value) { return value >= limits::min_lens && value <= most; };
  if (!is_length(lens.fx) || !is_length(lens.fy)) return "has a focal length beyond 1e-6 to 1e9";
  if (!(std::abs(lens.cx) <= most && std::abs(lens.cy) <= most)) return "has a principal point beyond 1e9";
  if (!is_length(lens.near_) || !is_length(lens.far_) || lens.near_ >= lens.far_) return "has no clipping planes from 1e-6 to 1e9";
  const bool has_size = lens.width >= 1 && lens.height >= 1 && lens.width <= limits::max_image_size && lens.height <= limits::max_image_size;
  return has_size ? nullptr : "has a size beyond 1 to 32768";
}

inline Intrinsics read_lens(const Part& part) {
  constexpr std::string_view rule = "CAM-4";
  Intrinsics lens;
  lens.fx = part.member("fx", rule).number(rule);
  lens.fy = part.member("fy", rule).number(rule);
  lens.cx = part.member("cx", rule).number(rule);
  lens.cy = part.member("cy", rule).number(rule);
  lens.width = part.member("width", rule).integer(1, limits::max_image_size, rule);
  lens.height = part.member("height", rule).integer(1, limits::max_image_size, rule);
  lens.near_ = part.member("near", rule).number(rule);
  lens.far_ = part.member("far", rule).number(rule);
  if (const char* wrong = why_not(lens)) part.broken(wrong, rule);
  return lens;
}

inline void write_lens(Outbox& to, const Intrinsics& lens) {
  to.begin_object();
  to.member("fx", lens.fx);
  to.member("fy", lens.fy);
  to.member("cx", lens.cx);
  to.member("cy", lens.cy);
  to.member("width", lens.width);
  to.member("height", lens.height);
  to.member("near", lens.near_);
  to.member("far", lens.far_);
  to.end_object();
}

}  // namespace splatbus
