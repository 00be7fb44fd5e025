// SPDX-License-Identifier: MIT
// UTF-8, as a text on the wire has to be [JSN-1].
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace splatbus {

/// How many bytes the character has that a text begins with: the shortest form of it, and no surrogate; else 0.
inline std::size_t character_bytes(std::string_view text) {
  const auto byte = [text](std::size_t at) { return static_cast<unsigned char>(text[at]); };
  if (text.empty()) return 0;
  const std::uint32_t lead = byte(0);
  if (lead < 0x80) return 1;
  const std::uint32_t more = lead >= 0xf0 ? 3 : lead >= 0xe0 ? 2 : 1;
  if (lead < 0xc2 || lead > 0xf4 || text.size() <= more) return 0;
  std::uint32_t code = lead & (0x3fu >> more);
  for (std::uint32_t i = 1; i <= more; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
    code = code << 6 | (byte(i) & 0x3fu);
  }
  const std::uint32_t least = more == 1 ? 0x80 : more == 2 ? 0x800 : 0x10000;
  const bool is_one = code >= least && code <= 0x10ffff && (code < 0xd800 || code >= 0xe000);
  return is_one ? more + 1 : 0;
}

/// Whether it is UTF-8 of so many characters, which are code points.
inline bool is_text(std::string_view text, std::int64_t least, std::int64_t most) {
  std::int64_t characters = 0;
  for (; !text.empty(); ++characters) {
    const std::size_t bytes = character_bytes(text);
    if (bytes == 0) return false;
    text.remove_prefix(bytes);
  }
  return characters >= least && characters <= most;
}

}  // namespace splatbus
