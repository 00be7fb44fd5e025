// SPDX-License-Identifier: MIT
// The CUDA driver as a client needs it, loaded at run time: programs are built, and start, without CUDA.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "splatbus/protocol/handle.hpp"

#ifdef _WIN32
#include "splatbus/text/windows.hpp"
#else
#include <dlfcn.h>
#endif

namespace splatbus {
namespace cuda {

using Address = std::uint64_t;  ///< CUdeviceptr
using Context = void*;          ///< CUcontext
using Stream = void*;           ///< CUstream
using Event = void*;            ///< CUevent

/// The driver's functions by their names; each returns a CUresult.
class Driver {
 public:
  int (*init)(unsigned) = nullptr;
  int (*get_error_name)(int, const char**) = nullptr;
  int (*get_error_string)(int, const char**) = nullptr;
  int (*device_get_count)(int*) = nullptr;
  int (*device_get_uuid)(unsigned char*, int) = nullptr;
  int (*primary_ctx_retain)(Context*, int) = nullptr;
  int (*ctx_push)(Context) = nullptr;
  int (*ctx_pop)(Context*) = nullptr;
  int (*ctx_synchronize)() = nullptr;
  int (*mem_alloc)(Address*, std::size_t) = nullptr;
  int (*mem_free)(Address) = nullptr;
  int (*mem_get_address_range)(Address*, std::size_t*, Address) = nullptr;
  int (*mem_host_alloc)(void**, std::size_t, unsigned) = nullptr;
  int (*mem_free_host)(void*) = nullptr;
  int (*memcpy_to_host)(void*, Address, std::size_t, Stream) = nullptr;
  int (*memcpy_on_device)(Address, Address, std::size_t, Stream) = nullptr;
  int (*stream_create)(Stream*, unsigned) = nullptr;
  int (*stream_synchronize)(Stream) = nullptr;
  int (*stream_wait_event)(Stream, Event, unsigned) = nullptr;
  int (*stream_destroy)(Stream) = nullptr;
  int (*event_create)(Event*, unsigned) = nullptr;
  int (*event_record)(Event, Stream) = nullptr;
  int (*event_destroy)(Event) = nullptr;
  int (*ipc_open_mem)(Address*, Handle, unsigned) = nullptr;
  int (*ipc_close_mem)(Address) = nullptr;
  int (*ipc_open_event)(Event*, Handle) = nullptr;

  /// That of this process; null where there is none or it sees no device, and why. It stays for good.
  static const Driver* find(std::string& why) {
    static const Driver& driver = *new Driver;  // for whoever outlives other statics
    why = driver.why_not_;
    return why.empty() ? &driver : nullptr;
  }

  /// Another of its functions, by the name that the library has for it; null where it has none.
  template <class Function>
  Function function(const char* name) const {
#ifdef _WIN32
    return reinterpret_cast<Function>(reinterpret_cast<void*>(GetProcAddress(library_, name)));
#else
    return reinterpret_cast<Function>(dlsym(library_, name));
#endif
  }

  /// Whether a call was done; if not, `why` says which, and what may be the matter.
  bool is_done(int code, const char* call, std::string& why) const {
    if (code == 0) return true;
    const char *name = nullptr, *text = nullptr;
    get_error_name(code, &name);
    get_error_string(code, &text);
    why = std::string(call) + ": " + (text != nullptr ? text : "unknown error") + " (" + (name != nullptr ? name : std::to_string(code)) + ")" + hint(code);
    return false;
  }

 private:
  Driver() {
#ifdef _WIN32
    library_ = LoadLibraryExA("nvcuda.dll", nullptr, LOAD_LIBRARY_SEARCH_SYSTEM32);
#else
    library_ = dlopen("libcuda.so.1", RTLD_NOW | RTLD_LOCAL);
#endif
    if (library_ == nullptr) {
      why_not_ = "there is no CUDA driver on this machine";
      return;
    }
    find(init, "cuInit");
    find(get_error_name, "cuGetErrorName");
    find(get_error_string, "cuGetErrorString");
    find(device_get_count, "cuDeviceGetCount");
    find(device_get_uuid, "cuDeviceGetUuid_v2");
    find(primary_ctx_retain, "cuDevicePrimaryCtxRetain");
    find(ctx_push, "cuCtxPushCurrent_v2");
    find(ctx_pop, "cuCtxPopCurrent_v2");
    find(ctx_synchronize, "cuCtxSynchronize");
    find(mem_alloc, "cuMemAlloc_v2");
    find(mem_free, "cuMemFree_v2");
    find(mem_get_address_range, "cuMemGetAddressRange_v2");
    find(mem_host_alloc, "cuMemHostAlloc");
    find(mem_free_host, "cuMemFreeHost");
    find(memcpy_to_host, "cuMemcpyDtoHAsync_v2");
    find(memcpy_on_device, "cuMemcpyDtoDAsync_v2");
    find(stream_create, "cuStreamCreate");
    find(stream_synchronize, "cuStreamSynchronize");
    find(stream_wait_event, "cuStreamWaitEvent");
    find(stream_destroy, "cuStreamDestroy_v2");
    find(event_create, "cuEventCreate");
    find(event_record, "cuEventRecord");
    find(event_destroy, "cuEventDestroy_v2");
    find(ipc_open_mem, "cuIpcOpenMemHandle_v2");
    find(ipc_close_mem, "cuIpcCloseMemHandle");
    find(ipc_open_event, "cuIpcOpenEventHandle");
    int devices = 0;
    if (!why_not_.empty() || !is_done(init(0), "cuInit", why_not_)) return;
    if (device_get_count(&devices) != 0 || devices == 0) why_not_ = "this process sees no GPU: look at CUDA_VISIBLE_DEVICES";
  }

  template <class Function>
  void find(Function& to, const char* name) {
    to = function<Function>(name);
    if (to == nullptr && why_not_.empty()) why_not_ = std::string("the CUDA driver is too old: it has no ") + name;
  }

  static const char* hint(int code) {
    switch (code) {
      case 1: return "; it was freed, or comes from another machine or container";
      case 201: return "; a process cannot open its own memory: is the server in it?";
      case 205: return "; it is not shared with this process: another container, or WSL 2?";
      case 400: return "; the process that shared it has ended";
      case 801: return "; this platform shares no GPU memory (WSL 2, MIG, a container?)";
      default: return "";
    }
  }

#ifdef _WIN32
  HMODULE library_ = nullptr;
#else
  void* library_ = nullptr;
#endif
  std::string why_not_;
};

}  // namespace cuda
}  // namespace splatbus
