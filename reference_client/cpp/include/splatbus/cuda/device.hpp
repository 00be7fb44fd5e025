// SPDX-License-Identifier: MIT
// A GPU, and the memory of other processes that is open on it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "splatbus/cuda/driver.hpp"

namespace splatbus {
namespace cuda {

/// A device and its primary context, the one that the CUDA runtime uses too; there for as long as the process.
class Device {
 public:
  const Driver& driver;
  const int ordinal;  ///< as this process counts

  /// Makes the context this thread's until it ends.
  class Current {
   public:
    explicit Current(const Device& device) : driver_(device.driver) { driver_.ctx_push(device.context_); }
    ~Current() {
      Context popped;
      driver_.ctx_pop(&popped);
    }
    Current(const Current&) = delete;
    Current& operator=(const Current&) = delete;

   private:
    const Driver& driver_;
  };

  /// The device with this UUID, `GPU-` and so on, however this process counts its devices [MEM-17]; null, and why.
  static Device* with_uuid(const std::string& uuid, std::string& why) {
    const Driver* driver = Driver::find(why);
    if (driver == nullptr) return nullptr;
    std::string seen;
    int count = 0;
    driver->device_get_count(&count);
    for (int ordinal = 0; ordinal < count; ++ordinal) {
      const std::string found = uuid_of(*driver, ordinal);
      if (found == uuid) return numbered(ordinal, why);
      seen += (seen.empty() ? "" : ", ") + found;
    }
    why = "the images are on device " + uuid + ", and this process sees " + seen + ": look at CUDA_VISIBLE_DEVICES";
    return nullptr;
  }

  /// The device with this number, which is right where the server counts alike [CUD-6]; null, and why.
  static Device* numbered(std::int64_t ordinal, std::string& why) {
    const Driver* driver = Driver::find(why);
    if (driver == nullptr) return nullptr;
    int count = 0;
    driver->device_get_count(&count);
    if (ordinal >= count) {
      why = "the images are on device " + std::to_string(ordinal) + ", and this process sees " + std::to_string(count) + ": look at CUDA_VISIBLE_DEVICES";
      return nullptr;
    }
    static std::mutex gate;
    static auto& known = *new std::map<std::int64_t, std::unique_ptr<Device>>;  // for whoever outlives other statics
    const std::lock_guard lock(gate);
    std::unique_ptr<Device>& device = known[ordinal];
    if (device) return device.get();
    Context context = nullptr;
    if (!driver->is_done(driver->primary_ctx_retain(&context, static_cast<int>(ordinal)), "cuDevicePrimaryCtxRetain", why)) return nullptr;
    device.reset(new Device(*driver, static_cast<int>(ordinal), context));
    return device.get();
  }

  /// Map what another process shares, once however many read it [CUD-2]; `close` it once for each call.
  /// Its context has to be current.
  bool open(const Handle& handle, Address& address, std::size_t& size, std::string& why) {
    const std::lock_guard lock(gate_);
    Opened& opened = opened_[handle];
    if (opened.users == 0) {
      constexpr unsigned lazy_peer_access = 1;
      const bool is_open = driver.is_done(driver.ipc_open_mem(&opened.address, handle, lazy_peer_access), "cuIpcOpenMemHandle", why);
      const bool is_known = is_open && driver.is_done(driver.mem_get_address_range(nullptr, &opened.size, opened.address), "cuMemGetAddressRange", why);
      if (is_open && !is_known) driver.ipc_close_mem(opened.address);
      if (!is_known) {
        opened_.erase(handle);
        return false;
      }
    }
    ++opened.users;
    address = opened.address;
    size = opened.size;
    return true;
  }

  /// What was read of it has been read [CUD-5].
  void close(const Handle& handle) {
    const std::lock_guard lock(gate_);
    const auto at = opened_.find(handle);
    if (--at->second.users > 0) return;
    driver.ipc_close_mem(at->second.address);
    opened_.erase(at);
  }

 private:
  struct Opened {
    Address address = 0;
    std::size_t size = 0;
    int users = 0;
  };

  Device(const Driver& with, int number, Context context) : driver(with), ordinal(number), context_(context) {}

  static std::string uuid_of(const Driver& driver, int ordinal) {
    unsigned char bytes[16] = {};
    driver.device_get_uuid(bytes, ordinal);
    constexpr const char* digits = "0123456789abcdef";
    std::string text = "GPU-";
    for (int i = 0; i < 16; ++i) {
      if (i == 4 || i == 6 || i == 8 || i == 10) text += '-';
      text += digits[bytes[i] >> 4];
      text += digits[bytes[i] & 15];
    }
    return text;
  }

  const Context context_;
  std::mutex gate_;
  std::map<Handle, Opened> opened_;
};

}  // namespace cuda
}  // namespace splatbus
