// SPDX-License-Identifier: MIT
// Poses, and the axes of engines (1.0 chapter 7).
#pragma once

#include <array>
#include <cmath>

#include "splatbus/wire.hpp"

namespace splatbus {

/// Camera-to-world or object-to-world: x, y, z in scene units, and a unit quaternion x, y, z, w. What is
/// sent and read is in the axes of the wire: x right, y down, z forward, the camera looking along z.
struct Pose {
  std::array<double, 3> position{};
  std::array<double, 4> rotation{0, 0, 0, 1};
};

/// Why nobody may send it, or null [JSN-4, POS-2, POS-3].
inline const char* why_not(const Pose& pose) {
  for (const double each : pose.position) {
    if (!(std::abs(each) <= limits::max_position)) return "a position beyond single precision [POS-2]";
  }
  const auto& [x, y, z, w] = pose.rotation;
  const double norm = std::sqrt(x * x + y * y + z * z + w * w);
  return std::abs(norm - 1) <= limits::rotation_norm_tolerance ? nullptr : "a rotation that is no unit quaternion [POS-3]";
}

/// Unreal: x forward, y right, z up, in centimetres; cameras and objects [CNV-5].
namespace unreal {
inline Pose from_wire(const Pose& wire) {
  const auto& [x, y, z] = wire.position;
  const auto& [qx, qy, qz, qw] = wire.rotation;
  return {{100 * z, 100 * x, -100 * y}, {-qz, -qx, qy, qw}};
}
inline Pose to_wire(const Pose& pose) {
  const auto& [x, y, z] = pose.position;
  const auto& [qx, qy, qz, qw] = pose.rotation;
  return {{y / 100, -z / 100, x / 100}, {-qy, qz, -qx, qw}};
}
}  // namespace unreal

/// OpenGL with y up: x right, y up, z backward, the camera looking along -z; cameras and objects [CNV-7].
namespace opengl {
inline Pose from_wire(const Pose& wire) {
  const auto& [x, y, z] = wire.position;
  const auto& [qx, qy, qz, qw] = wire.rotation;
  return {{x, -y, -z}, {qx, -qy, -qz, qw}};
}
inline Pose to_wire(const Pose& pose) { return from_wire(pose); }
}  // namespace opengl

}  // namespace splatbus
