// SPDX-License-Identifier: MIT
// An image that the server lends.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>

#include "splatbus/host_memory.hpp"
#include "splatbus/wire.hpp"

namespace splatbus {

class Client;

/// A whole image, to be read where it lies until this ends. The server waits with the next one for that.
/// Rows lie bottom-up: the first row in memory is the bottom one [BUF-1]. Colour is four singles a pixel,
/// red, green, blue, alpha; depth one [BUF-2]; what they mean is in `packet().semantics`.
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
  const Frame& frame() const { return *frame_; }
  const InitPacket& packet() const { return memory_->packet; }
  /// Width · height · 4 numbers; null where colour was not subscribed to [IMG-22].
  const float* color() const { return has_color_ ? plane(packet().ring->colorOffset, packet().ring->colorStride) : nullptr; }
  /// Width · height numbers; null where depth was not subscribed to [IMG-22].
  const float* depth() const { return has_depth_ ? plane(packet().ring->depthOffset, packet().ring->depthStride) : nullptr; }
  /// Whether the server still lends it: if its connection was lost while it was read, do not show it [CHN-18].
  inline bool is_still_lent() const;

 private:
  friend class Client;

  const float* plane(std::int64_t offset, std::int64_t stride) const {
    return reinterpret_cast<const float*>(memory_->at(offset + frame_->slot * stride));
  }
  void swap(FrameLease& other) noexcept {
    std::swap(client_, other.client_);
    std::swap(memory_, other.memory_);
    std::swap(frame_, other.frame_);
    std::swap(ticket_, other.ticket_);
    std::swap(has_color_, other.has_color_);
    std::swap(has_depth_, other.has_depth_);
  }

  Client* client_ = nullptr;
  std::shared_ptr<const HostMemory> memory_;
  std::shared_ptr<const Frame> frame_;
  std::uint64_t ticket_ = 0;
  bool has_color_ = false, has_depth_ = false;
};

}  // namespace splatbus
