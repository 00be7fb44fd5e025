// SPDX-License-Identifier: MIT
// The init packet: where the images are (1.0 chapter 4; 1.1 chapter 3), checked whole before anything is opened.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "splatbus/protocol/handle.hpp"
#include "splatbus/protocol/part.hpp"

namespace splatbus {
namespace init_packets {

inline constexpr std::int64_t color_pixel_bytes = 16, depth_pixel_bytes = 4, alignment = 16;

/// Whether a message of the IPC channel is meant as one [INI-11].
inline bool is_one(Value message) { return message.member("meta") && !message.member("type"); }

/// "1." and a decimal integer without leading zeros; a later one is as good as 1.1 [MEM-18].
inline bool is_own_or_later(std::string_view version) {
  if (version.size() < 3 || version.substr(0, 2) != "1." || version[2] == '0') return false;
  return version.find_first_not_of("0123456789", 2) == version.npos;
}

inline Meta read_meta(const Part& part) {
  Meta meta;
  meta.w = part.member("w", "INI-1").integer(1, limits::max_image_size, "INI-2");
  meta.h = part.member("h", "INI-1").integer(1, limits::max_image_size, "INI-2");
  part.member("fmtColor", "INI-1").one_of({Meta::fmtColor}, "INI-3");
  part.member("fmtDepth", "INI-1").one_of({Meta::fmtDepth}, "INI-3");
  const std::int64_t color = color_pixel_bytes * meta.w, depth = depth_pixel_bytes * meta.w;
  meta.pitchColor = part.member("pitchColor", "INI-1").integer(color, color, "INI-4");
  meta.pitchDepth = part.member("pitchDepth", "INI-1").integer(depth, depth, "INI-4");
  if (const Part it = part.optional("offsetColor"); it.is_there()) meta.offsetColor = it.multiple(color_pixel_bytes, 0, "INI-5");
  if (const Part it = part.optional("offsetDepth"); it.is_there()) meta.offsetDepth = it.multiple(depth_pixel_bytes, 0, "INI-5");
  if (const Part it = part.optional("device"); it.is_there()) meta.device = it.integer(0, limits::max_safe_integer, "INI-6");
  return meta;
}

inline std::string read_handle_of(const Part& part, std::string_view rule) {
  std::string text = part.text(rule);
  if (!read_handle(text)) part.broken("is not 64 bytes in base64", rule);
  return text;
}

inline CudaIpcMemory read_cuda_memory(const Part& part) {
  const Part device = part.member("deviceUuid", "MEM-2");
  CudaIpcMemory memory;
  memory.bytes = part.member("bytes", "MEM-2").integer(1, limits::max_safe_integer, "MEM-2");
  memory.deviceUuid = device.text("MEM-2");
  constexpr std::string_view form = "GPU-xxxxxxxx-xxxx-xxxx-xxxx-xxxxxxxxxxxx";
  const auto fits = [](char each, char wanted) {
    return wanted == 'x' ? (each >= '0' && each <= '9') || (each >= 'a' && each <= 'f') : each == wanted;
  };
  const std::string& uuid = memory.deviceUuid;
  if (!std::equal(uuid.begin(), uuid.end(), form.begin(), form.end(), fits)) device.broken("is not GPU- and a UUID in lower case", "MEM-2");
  memory.handle = read_handle_of(part.member("handle", "MEM-2"), "MEM-2");
  return memory;
}

inline HostShmMemory read_host_memory(const Part& part) {
  const Part named = part.member("name", "MEM-2");
  HostShmMemory memory;
  memory.name = named.text("MEM-7");
  const auto is_good = [](char each) {
    return (each >= 'a' && each <= 'z') || (each >= 'A' && each <= 'Z') || (each >= '0' && each <= '9') || each == '.' || each == '_' || each == '-';
  };
  const bool fits = !memory.name.empty() && memory.name.size() <= static_cast<std::size_t>(limits::max_shm_name_chars) && memory.name[0] != '.';
  if (!fits || !std::all_of(memory.name.begin(), memory.name.end(), is_good)) {
    named.broken("is no name of 1 to 30 of A-Z a-z 0-9 . _ -", "MEM-7");
  }
  memory.bytes = part.member("bytes", "MEM-2").integer(1, limits::max_safe_integer, "MEM-2");
  return memory;
}

inline Memory read_memory(const Part& part) {
  if (part.member("kind", "MEM-2").one_of({MemoryKind::host_shm, MemoryKind::cuda_ipc}, "MEM-2") == MemoryKind::cuda_ipc) return read_cuda_memory(part);
  return read_host_memory(part);
}

/// The buffers of 1.0.
inline void read_legacy(const Part& root, InitPacket& packet) {
  packet.mem_color = read_handle_of(root.member("mem_color", "INI-1"), "INI-7");
  packet.mem_depth = read_handle_of(root.member("mem_depth", "INI-1"), "INI-7");
  packet.evt_done = read_handle_of(root.member("evt_done", "INI-1"), "INI-7");
}

inline Ring read_ring(const Part& part, std::int64_t pixels, bool has_events) {
  constexpr std::string_view rule = "MEM-8";
  Ring ring;
  ring.slots = part.member("slots", rule).integer(1, limits::max_slots, rule);
  ring.colorOffset = part.member("colorOffset", rule).multiple(alignment, 0, rule);
  ring.colorStride = part.member("colorStride", rule).multiple(alignment, color_pixel_bytes * pixels, rule);
  ring.depthOffset = part.member("depthOffset", rule).multiple(alignment, 0, rule);
  ring.depthStride = part.member("depthStride", rule).multiple(alignment, depth_pixel_bytes * pixels, rule);
  if (!has_events) return ring;
  ring.events.emplace();
  for (const Part& each : part.member("events", rule).items(ring.slots, ring.slots, rule)) ring.events->push_back(read_handle_of(each, "INI-7"));
  return ring;
}

/// Every slot lies in the memory, and none in another. No sum of this overflows 64 bits: offsets and
/// strides are below 2⁵³, slots at most 1,024, and lengths are added to what lies in the memory
/// [MEM-9, MEM-10, INI-10].
inline void check_slots(const Part& root, const Ring& ring, std::int64_t pixels, std::int64_t bytes) {
  std::vector<std::pair<std::int64_t, std::int64_t>> extents;
  const auto place = [&](std::int64_t start, std::int64_t length, std::string_view offset) {
    if (start > bytes - length) root.optional("ring").optional(offset).broken("has a slot end beyond the memory", "MEM-10");
    else extents.emplace_back(start, start + length);
  };
  for (std::int64_t slot = 0; slot < ring.slots; ++slot) {
    place(ring.colorOffset + slot * ring.colorStride, color_pixel_bytes * pixels, "colorOffset");
    place(ring.depthOffset + slot * ring.depthStride, depth_pixel_bytes * pixels, "depthOffset");
  }
  std::sort(extents.begin(), extents.end());
  for (std::size_t i = 1; i < extents.size(); ++i) {
    if (extents[i - 1].second > extents[i].first) root.optional("ring").broken("has two slots that overlap", "MEM-9");
  }
}

inline Semantics read_semantics(const Part& part) {
  constexpr std::string_view rule = "MEM-12";
  Semantics semantics;
  part.member("rows", rule).one_of({Semantics::rows}, rule);
  semantics.alpha = part.member("alpha", rule).one_of({SemanticsAlpha::straight, SemanticsAlpha::premultiplied}, rule);
  semantics.colorSpace = part.member("colorSpace", rule).one_of({SemanticsColorSpace::srgb, SemanticsColorSpace::linear}, rule);
  const Part depth = part.member("depth", rule), empty = depth.member("empty", rule), unit = part.member("unitMetres", rule);
  semantics.depth.kind = depth.member("kind", rule).one_of({DepthSemanticsKind::planar_z, DepthSemanticsKind::ray_distance}, rule);
  semantics.depth.estimator =
      depth.member("estimator", rule).one_of({DepthSemanticsEstimator::harmonic, DepthSemanticsEstimator::expected, DepthSemanticsEstimator::median}, rule);
  constexpr double rounds_to_infinity = 0x1.ffffffp127;  // half an ULP of single precision beyond its greatest
  semantics.depth.empty = empty.is("inf") ? std::numeric_limits<double>::infinity() : empty.number(rule);
  if (!empty.is("inf") && !(std::abs(semantics.depth.empty) < rounds_to_infinity)) empty.broken("is beyond single precision", rule);
  if (unit.is_there() && !unit.value()->is_null()) {
    semantics.unitMetres = unit.number(rule);
    if (!(*semantics.unitMetres > 0)) unit.broken("is not positive", rule);
  }
  semantics.origin = part.member("origin", rule).vector<3>(rule);
  return semantics;
}

inline Semantics semantics_of_1_0() {
  Semantics semantics;
  semantics.alpha = SemanticsAlpha::straight;
  semantics.colorSpace = SemanticsColorSpace::srgb;
  semantics.depth.kind = DepthSemanticsKind::planar_z;
  semantics.depth.estimator = DepthSemanticsEstimator::harmonic;
  semantics.depth.empty = std::numeric_limits<double>::infinity();
  return semantics;
}

/// The packet; nothing if it must not be opened, for what is `wrong` [INI-9, MEM-11]. One of 1.0 has no
/// version.
inline std::optional<InitPacket> read(Value message, Wrong& wrong) {
  const Part root(message, "", wrong);
  InitPacket packet;
  if (!root.optional("version").is_there()) {
    packet.meta = read_meta(root.member("meta", "INI-1"));
    read_legacy(root, packet);
    packet.semantics = semantics_of_1_0();
    return wrong.empty() ? std::optional(std::move(packet)) : std::nullopt;
  }
  const Part version = root.member("version", "MEM-1");
  if (!is_own_or_later(version.text("MEM-1"))) version.broken("is no 1.x from 1.1 on", "MEM-1");
  packet.version = "1.1";
  packet.meta = read_meta(root.member("meta", "INI-1"));
  packet.generation = root.member("generation", "MEM-1").integer(1, limits::max_safe_integer, "MEM-1");
  packet.memory = read_memory(root.member("memory", "MEM-2"));
  const auto* on_device = std::get_if<CudaIpcMemory>(&packet.memory);
  for (const std::string_view each : {"mem_color", "mem_depth", "evt_done"}) {
    if (const Part it = root.optional(each); it.is_there() && on_device == nullptr) it.broken("is there with memory of the host", "MEM-3");
  }
  if (on_device != nullptr) read_legacy(root, packet);
  if (on_device == nullptr || root.optional("ring").is_there()) {  // a server without `frames` may have none [MEM-8]
    const std::int64_t pixels = packet.meta.w * packet.meta.h;
    packet.ring = read_ring(root.member("ring", "MEM-8"), pixels, on_device != nullptr);
    const std::int64_t bytes = std::visit([](const auto& it) { return it.bytes; }, packet.memory);
    if (wrong.empty()) check_slots(root, *packet.ring, pixels, bytes);
  }
  packet.semantics = read_semantics(root.member("semantics", "MEM-12"));
  return wrong.empty() ? std::optional(std::move(packet)) : std::nullopt;
}

}  // namespace init_packets
}  // namespace splatbus
