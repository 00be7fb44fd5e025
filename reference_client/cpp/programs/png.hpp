// SPDX-License-Identifier: MIT
// An image as a PNG of 8 bits, without compression: small to write, and readable everywhere.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

#include "splatbus/client.hpp"

namespace png {

inline void append(std::string& to, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) to += static_cast<char>(value >> shift);
}

inline std::uint32_t crc(std::string_view of) {
  std::uint32_t sum = 0xffffffff;
  for (const char each : of) {
    sum ^= static_cast<unsigned char>(each);
    for (int i = 0; i < 8; ++i) sum = sum >> 1 ^ (sum & 1 ? 0xedb88320 : 0);
  }
  return ~sum;
}

inline void chunk(std::string& to, std::string_view type, std::string_view data) {
  append(to, static_cast<std::uint32_t>(data.size()));
  const std::string body = std::string(type) + std::string(data);
  to += body;
  append(to, crc(body));
}

/// zlib's stream with stored blocks (RFC 1950, RFC 1951).
inline std::string stored(std::string_view data) {
  std::string stream("\x78\x01", 2);
  std::uint32_t a = 1, b = 0;
  for (const char each : data) {
    a = (a + static_cast<unsigned char>(each)) % 65521;
    b = (b + a) % 65521;
  }
  do {
    const std::string_view block = data.substr(0, 65535);
    data.remove_prefix(block.size());
    const auto length = static_cast<std::uint16_t>(block.size());
    stream += data.empty() ? '\1' : '\0';
    for (const std::uint16_t each : {length, static_cast<std::uint16_t>(~length)}) {
      stream += static_cast<char>(each);
      stream += static_cast<char>(each >> 8);
    }
    stream += block;
  } while (!data.empty());
  append(stream, b << 16 | a);
  return stream;
}

/// A channel of the image as a byte for display.
inline char shown(float value, bool is_linear) {
  double light = std::clamp(static_cast<double>(value), 0.0, 1.0);
  if (is_linear) light = light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
  return static_cast<char>(std::lround(255 * light));
}

/// Write rows from the top, each a byte 0 and then red, green and blue of its pixels.
inline bool save(const char* path, std::size_t width, std::size_t height, std::string_view rows) {
  std::string header;
  append(header, static_cast<std::uint32_t>(width));
  append(header, static_cast<std::uint32_t>(height));
  header += std::string_view("\x08\x02\0\0\0", 5);
  std::string file("\x89PNG\r\n\x1a\n", 8);
  chunk(file, "IHDR", header);
  chunk(file, "IDAT", stored(rows));
  chunk(file, "IEND", "");
  std::FILE* out = std::fopen(path, "wb");
  if (out == nullptr) return false;
  const bool is_whole = std::fwrite(file.data(), 1, file.size(), out) == file.size();
  return std::fclose(out) == 0 && is_whole;
}

/// Write colour over black.
inline bool write(const char* path, const splatbus::FrameLease& lease) {
  const auto& packet = lease.packet();
  const bool is_linear = packet.semantics.colorSpace == splatbus::SemanticsColorSpace::linear;
  const bool is_straight = packet.semantics.alpha == splatbus::SemanticsAlpha::straight;
  const auto width = static_cast<std::size_t>(packet.meta.w), height = static_cast<std::size_t>(packet.meta.h);
  const float* color = lease.color();
  std::string rows;
  for (std::size_t row = height; row-- > 0;) {  // in memory the bottom one is first
    rows += '\0';
    for (std::size_t column = 0; column < width; ++column) {
      const float* pixel = color + 4 * (row * width + column);
      for (int i = 0; i < 3; ++i) rows += shown(is_straight ? pixel[i] * pixel[3] : pixel[i], is_linear);
    }
  }
  return save(path, width, height, rows);
}

}  // namespace png
