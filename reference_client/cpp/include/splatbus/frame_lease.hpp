// SPDX-License-Identifier: MIT
// An image that the server lends.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>

#include "splatbus/cuda/device.hpp"
#include "splatbus/io/image_memory.hpp"
#include "splatbus/wire.hpp"

namespace splatbus {

class Client;

/// A whole image, to be read where it lies until this ends. The server waits with the next one for that.
/// Rows lie bottom-up: the first row in memory is the bottom one [BUF-1]. Colour is four singles a pixel,
/// red, green, blue, alpha; depth one [BUF-2]; what they mean is in `packet().semantics`.
///
/// Of a server of 1.0 it is a copy of what its buffers hold when it is read first: colour and depth may be
/// of different images, camera and times are not known, and `frame().seq` counts the copies.
class FrameLease {
 public:
  FrameLease() = default;
  FrameLease(FrameLease&& other) noexcept { swap(other); }
  FrameLease& operator=(FrameLease&& other) noexcept {
    FrameLease(std::move(other)).swap(*this);
    return *this;
  }
  inline ~FrameLease();

  /// Whether there is an image.
  explicit operator bool() const { return memory_ != nullptr; }
  /// What it was rendered with, in the axes of the wire: place your own geometry by it. Used again for the next image.
  /// Of a server of 1.0 only `seq` is known.
  const Frame& frame() const { return *frame_; }
  const InitPacket& packet() const { return memory_->packet; }
  bool has_camera() const { return !memory_->is_legacy(); }
  /// Width · height · 4 numbers where the host reads them: where they lie, or a copy from the GPU. Null where
  /// colour was not subscribed to [IMG-22], or the GPU refuses.
  const float* color() const { return has_color_ ? memory_->on_host(Plane::color, frame_->slot) : nullptr; }
  /// Width · height numbers; all else as for `color`.
  const float* depth() const { return has_depth_ ? memory_->on_host(Plane::depth, frame_->slot) : nullptr; }
  /// The GPU that it lies on; null where it lies in memory of the host.
  const cuda::Device* device() const { return memory_->device(); }
  /// Its colour there, a CUdeviceptr, for work on a CUstream of yours: that waits for the image first, and is
  /// waited for when the lease ends. 0 where `device` is null, colour was not subscribed to, or the GPU refuses.
  std::uint64_t color_on_device(void* stream) const { return has_color_ ? memory_->on_device(Plane::color, frame_->slot, stream) : 0; }
  /// Its depth there; all else as for `color_on_device`.
  std::uint64_t depth_on_device(void* stream) const { return has_depth_ ? memory_->on_device(Plane::depth, frame_->slot, stream) : 0; }
  /// Whether the server still lends it: if its connection was lost while it was read, do not show it [CHN-18].
  inline bool is_still_lent() const;

 private:
  friend class Client;

  void swap(FrameLease& other) noexcept {
    std::swap(client_, other.client_);
    std::swap(memory_, other.memory_);
    std::swap(frame_, other.frame_);
    std::swap(ticket_, other.ticket_);
    std::swap(has_color_, other.has_color_);
    std::swap(has_depth_, other.has_depth_);
  }

  Client* client_ = nullptr;
  std::shared_ptr<ImageMemory> memory_;
  std::shared_ptr<const Frame> frame_;
  std::uint64_t ticket_ = 0;
  bool has_color_ = false, has_depth_ = false;
};

}  // namespace splatbus
