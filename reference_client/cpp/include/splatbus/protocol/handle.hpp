// SPDX-License-Identifier: MIT
// CUDA interprocess handles, as packets carry them [INI-7].
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace splatbus {

/// A CUipcMemHandle or CUipcEventHandle.
using Handle = std::array<unsigned char, 64>;

/// Nothing where it is not 64 bytes in base64, standard alphabet, padded, without stray bits.
inline std::optional<Handle> read_handle(std::string_view text) {
  constexpr std::string_view alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  constexpr std::size_t digits = 86, padding = 2;
  if (text.size() != digits + padding || text.substr(digits) != "==") return std::nullopt;
  Handle handle{};
  std::uint32_t bits = 0;
  int count = 0;
  std::size_t at = 0;
  for (const char each : text.substr(0, digits)) {
    const std::size_t value = alphabet.find(each);
    if (value == alphabet.npos) return std::nullopt;
    bits = bits << 6 | static_cast<std::uint32_t>(value);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    handle[at++] = static_cast<unsigned char>(bits >> count);
    bits &= (1U << count) - 1;
  }
  return bits == 0 ? std::optional(handle) : std::nullopt;
}

}  // namespace splatbus
