// SPDX-License-Identifier: MIT
// Named memory of the host, mapped for reading only [MEM-19, OPN-10].
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <system_error>
#include <utility>
#include <variant>

#include "splatbus/io/image_memory.hpp"

#ifdef _WIN32
#include "splatbus/text/windows.hpp"
#else
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#endif

namespace splatbus {

class HostMemory final : public ImageMemory {
 public:
  /// Map it; nothing where there is none, it is shorter than announced [MEM-6], or not to be read, and why.
  static std::shared_ptr<HostMemory> open(InitPacket packet, std::string& why) {
    auto memory = std::make_shared<HostMemory>();
    const auto& described = std::get<HostShmMemory>(packet.memory);
    memory->size_ = static_cast<std::size_t>(described.bytes);
    why = memory->map(described.name);
    if (!why.empty()) return nullptr;
    memory->packet = std::move(packet);
    return memory;
  }

  /// Where it lies.
  const float* on_host(Plane plane, std::int64_t slot) override {
    const Ring& ring = *packet.ring;
    const bool is_color = plane == Plane::color;
    return reinterpret_cast<const float*>(start_ + (is_color ? ring.colorOffset + slot * ring.colorStride : ring.depthOffset + slot * ring.depthStride));
  }

#ifdef _WIN32
  ~HostMemory() override {
    if (start_ != nullptr) UnmapViewOfFile(start_);
  }

 private:
  std::string map(const std::string& name) {
    const HANDLE object = OpenFileMappingA(FILE_MAP_READ, FALSE, ("Local\\" + name).c_str());
    if (object == nullptr) return "there is no shared memory " + name + ": client and server have to be on one machine, in one session";
    // A view of more than there is fails: that is the measure [MEM-6].
    const void* view = MapViewOfFile(object, FILE_MAP_READ, 0, 0, size_);
    CloseHandle(object);
    start_ = static_cast<const std::byte*>(view);
    return view != nullptr ? std::string() : "the memory is shorter than announced, or cannot be mapped [MEM-6]";
  }
#else
  ~HostMemory() override {
    if (start_ != nullptr) munmap(const_cast<std::byte*>(start_), size_);
  }

 private:
  std::string map(const std::string& name) {
#ifdef __linux__
    // What shm_open means, which stands in another library with older C libraries; no link, no waiting for a pipe.
    const int file = ::open(("/dev/shm/" + name).c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
#else
    const int file = shm_open(("/" + name).c_str(), O_RDONLY, 0);
#endif
    if (file < 0 && errno == ENOENT) return "there is no shared memory " + name + ": client and server have to be on one machine; in containers, with --ipc=host or one /dev/shm";
    if (file < 0 && errno == EACCES) return "shared memory " + name + " is another user's: client and server have to be one user's";
    if (file < 0) return "shared memory " + name + ": " + std::system_category().message(errno);
    struct stat found {};
    std::string why;
    if (fstat(file, &found) != 0 || found.st_size < 0 || static_cast<std::size_t>(found.st_size) < size_) {
      why = "memory is " + std::to_string(found.st_size) + " bytes long, " + std::to_string(size_) + " were announced [MEM-6]";
    } else {
      void* start = mmap(nullptr, size_, PROT_READ, MAP_SHARED, file, 0);
      if (start == MAP_FAILED) why = "it cannot be mapped: " + std::system_category().message(errno);
      else start_ = static_cast<const std::byte*>(start);
    }
    ::close(file);
    return why;
  }
#endif

  const std::byte* start_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace splatbus
