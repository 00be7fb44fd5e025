// SPDX-License-Identifier: MIT
// Images on a GPU: opened by handle, waited for, read, closed (1.0 chapter 5; 1.1 chapters 3 and 5).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "splatbus/cuda/device.hpp"
#include "splatbus/io/image_memory.hpp"

namespace splatbus {
namespace cuda {

/// The ring of one init packet; reads of a slot happen on the GPU, in their own time.
class Images : public ImageMemory {
 public:
  /// Map it; nothing where it is not there, is shorter than announced [MEM-6], or on no device of this process, and why.
  static std::shared_ptr<Images> open(InitPacket packet, std::string& why) {
    const auto& memory = std::get<CudaIpcMemory>(packet.memory);
    Device* device = Device::with_uuid(memory.deviceUuid, why);
    return device != nullptr ? made<Images>(*device, std::move(packet), why) : nullptr;
  }

  ~Images() override {
    const Device::Current current(device_);
    device_.driver.stream_synchronize(stream_);  // before what it reads is closed [CUD-5]
    for (auto each = undo_.rbegin(); each != undo_.rend(); ++each) (*each)();
  }

  /// Copied at the first call; the same memory is used for every image.
  const float* on_host(Plane plane, std::int64_t slot) override {
    Staged& staged = staged_[static_cast<std::size_t>(plane)];
    if (staged.is_read) return staged.numbers;
    const Driver& driver = device_.driver;
    const Device::Current current(device_);
    const std::size_t bytes = size_of(plane);
    void* room = staged.numbers;
    if (room == nullptr) {
      if (driver.mem_host_alloc(&room, bytes, 0) != 0) return nullptr;
      staged.numbers = static_cast<float*>(room);
      undo_.push_back([&driver, room] { driver.mem_free_host(room); });
    }
    const bool is_copied = order(stream_, slot) && driver.memcpy_to_host(room, address(plane, slot), bytes, stream_) == 0;
    staged.is_read = driver.stream_synchronize(stream_) == 0 && is_copied;
    return staged.is_read ? staged.numbers : nullptr;
  }

  std::uint64_t on_device(Plane plane, std::int64_t slot, Stream stream) override {
    const Device::Current current(device_);
    if (std::find(readers_.begin(), readers_.end(), stream) == readers_.end()) {
      if (!order(stream, slot)) return 0;
      readers_.push_back(stream);
    }
    return address(plane, slot);
  }

  const Device* device() const override { return &device_; }

  void finish() override {
    if (!readers_.empty()) {
      const Device::Current current(device_);
      for (const Stream each : readers_) device_.driver.stream_synchronize(each);
      readers_.clear();
    }
    for (Staged& each : staged_) each.is_read = false;
  }

 protected:
  explicit Images(Device& device) : device_(device) {}

  /// Open all; whether nothing failed.
  virtual bool open_all(std::string& why) {
    const auto& memory = std::get<CudaIpcMemory>(packet.memory);
    std::size_t size = 0;
    if (!open_memory(memory.handle, start_, size, why)) return false;
    if (size < static_cast<std::size_t>(memory.bytes)) {
      why = "memory is " + std::to_string(size) + " bytes long, " + std::to_string(memory.bytes) + " were announced [MEM-6]";
      return false;
    }
    ring_ = *packet.ring;
    return std::all_of(ring_.events->begin(), ring_.events->end(), [&](const std::string& each) {
      events_.emplace_back();
      return open_event(each, events_.back(), why);
    });
  }

  /// Make a stream wait for the image in a slot [BUF-11, IMG-8].
  virtual bool order(Stream stream, std::int64_t slot) {
    return device_.driver.stream_wait_event(stream, events_[static_cast<std::size_t>(slot)], 0) == 0;
  }

  bool open_memory(const std::string& text, Address& to, std::size_t& size, std::string& why) {
    const Handle handle = *read_handle(text);
    if (!device_.open(handle, to, size, why)) return false;
    undo_.push_back([device = &device_, handle] { device->close(handle); });
    return true;
  }

  bool open_event(const std::string& text, Event& to, std::string& why) {
    const Driver& driver = device_.driver;
    if (!driver.is_done(driver.ipc_open_event(&to, *read_handle(text)), "cuIpcOpenEventHandle", why)) return false;
    undo_.push_back([&driver, event = to] { driver.event_destroy(event); });
    return true;
  }

  std::size_t size_of(Plane plane) const {
    const auto pixels = static_cast<std::size_t>(packet.meta.w * packet.meta.h);
    return pixels * (plane == Plane::color ? 16 : 4);
  }

  template <class Kind>
  static std::shared_ptr<Images> made(Device& device, InitPacket packet, std::string& why) {
    std::shared_ptr<Images> images(new Kind(device));
    images->packet = std::move(packet);
    const Device::Current current(device);
    const Driver& driver = device.driver;
    constexpr unsigned non_blocking = 1;
    if (!driver.is_done(driver.stream_create(&images->stream_, non_blocking), "cuStreamCreate", why)) return nullptr;
    images->undo_.push_back([&driver, stream = images->stream_] { driver.stream_destroy(stream); });
    return images->open_all(why) ? images : nullptr;
  }

  Device& device_;
  Address start_ = 0;
  Ring ring_;
  std::vector<Event> events_;  ///< by slot
  Stream stream_ = nullptr;
  std::vector<std::function<void()>> undo_;

 private:
  struct Staged {
    float* numbers = nullptr;
    bool is_read = false;
  };

  Address address(Plane plane, std::int64_t slot) const {
    const bool is_color = plane == Plane::color;
    return start_ + static_cast<Address>(is_color ? ring_.colorOffset + slot * ring_.colorStride : ring_.depthOffset + slot * ring_.depthStride);
  }

  std::array<Staged, 2> staged_;  ///< by plane
  std::vector<Stream> readers_;   ///< whose work the end of the lease waits for
};

/// The buffers of 1.0, which their server overwrites while they are read: looked at by a copy of our own.
/// Even that may be of two images, since nothing in 1.0 keeps a server from writing meanwhile.
class LegacyImages final : public Images {
 public:
  static std::shared_ptr<Images> open(InitPacket packet, std::string& why) {
    const auto* memory = std::get_if<CudaIpcMemory>(&packet.memory);
    Device* device = memory != nullptr ? Device::with_uuid(memory->deviceUuid, why) : Device::numbered(packet.meta.device.value_or(0), why);
    return device != nullptr ? made<LegacyImages>(*device, std::move(packet), why) : nullptr;
  }

  bool is_legacy() const override { return true; }

  void finish() override {
    Images::finish();
    is_taken_ = false;
  }

 private:
  friend class Images;
  explicit LegacyImages(Device& device) : Images(device) {}

  bool open_all(std::string& why) override {
    const Driver& driver = device_.driver;
    packet.semantics.alpha = SemanticsAlpha::straight;  // [MEM-15]
    const bool is_open = open_plane(Plane::color, *packet.mem_color, packet.meta.offsetColor, why) &&
                         open_plane(Plane::depth, *packet.mem_depth, packet.meta.offsetDepth, why) &&
                         open_event(*packet.evt_done, server_event_, why);
    constexpr unsigned disable_timing = 2;
    Event copied = nullptr;
    if (!is_open || !driver.is_done(driver.mem_alloc(&start_, size_of(Plane::color) + size_of(Plane::depth)), "cuMemAlloc", why)) return false;
    undo_.push_back([&driver, start = start_] { driver.mem_free(start); });
    if (!driver.is_done(driver.event_create(&copied, disable_timing), "cuEventCreate", why)) return false;
    undo_.push_back([&driver, copied] { driver.event_destroy(copied); });
    events_.push_back(copied);
    ring_.depthOffset = static_cast<std::int64_t>(size_of(Plane::color));
    return true;
  }

  bool open_plane(Plane plane, const std::string& handle, std::optional<std::int64_t> offset, std::string& why) {
    Address& source = sources_[static_cast<std::size_t>(plane)];
    std::size_t size = 0;
    if (!open_memory(handle, source, size, why)) return false;
    const auto from = static_cast<std::size_t>(offset.value_or(0));
    source += from;
    if (from <= size && size_of(plane) <= size - from) return true;
    why = "an image ends beyond the memory of " + std::to_string(size) + " bytes";
    return false;
  }

  bool order(Stream stream, std::int64_t slot) override { return (is_taken_ || take()) && Images::order(stream, slot); }

  bool take() {
    const Driver& driver = device_.driver;
    is_taken_ = driver.stream_wait_event(stream_, server_event_, 0) == 0;
    for (const Plane each : {Plane::color, Plane::depth}) {
      const Address to = start_ + (each == Plane::depth ? size_of(Plane::color) : 0);
      is_taken_ = is_taken_ && driver.memcpy_on_device(to, sources_[static_cast<std::size_t>(each)], size_of(each), stream_) == 0;
    }
    return is_taken_ = is_taken_ && driver.event_record(events_[0], stream_) == 0;
  }

  std::array<Address, 2> sources_{};  ///< by plane
  Event server_event_ = nullptr;
  bool is_taken_ = false;
};

}  // namespace cuda
}  // namespace splatbus
