// SPDX-License-Identifier: MIT
// What images are read from.
#pragma once

#include <cstdint>

#include "splatbus/wire.hpp"

namespace splatbus {

namespace cuda {
class Device;
}

enum class Plane { color, depth };

/// The memory of one init packet; unmapped with the last who holds it.
class ImageMemory {
 public:
  InitPacket packet;

  ImageMemory() = default;
  ImageMemory(const ImageMemory&) = delete;
  ImageMemory& operator=(const ImageMemory&) = delete;
  virtual ~ImageMemory() = default;

  /// Whether it is that of 1.0, whose server writes whenever it likes.
  virtual bool is_legacy() const { return false; }
  /// A plane of a slot, where the host reads it; null where it cannot.
  virtual const float* on_host(Plane plane, std::int64_t slot) = 0;
  /// A plane of a slot where it lies on a GPU, for work on a stream, which waits for the image first; 0 where it cannot.
  virtual std::uint64_t on_device(Plane, std::int64_t, void*) { return 0; }
  /// That GPU, or null.
  virtual const cuda::Device* device() const { return nullptr; }
  /// All that was read of a slot has been seen to be read [IMG-13].
  virtual void finish() {}
};

}  // namespace splatbus
