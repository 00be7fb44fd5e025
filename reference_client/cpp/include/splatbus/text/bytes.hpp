// SPDX-License-Identifier: MIT
// Packets of one connection, found in what comes and made of what is said [FRM-1 to FRM-4]; no I/O.
#pragma once

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "splatbus/wire.hpp"

namespace splatbus {

/// Bytes that somebody else owns, and that may be changed where they lie.
struct Bytes {
  char* data = nullptr;
  std::size_t size = 0;
};

/// Finds packets in the bytes of one direction; allocates only for one that is longer than all before.
class PacketReader {
 public:
  /// Where the next bytes are to be received; valid until the next call. Never empty.
  Bytes room() {
    if (begin_ == end_ || end_ == buffer_.size()) move_to_front();
    const std::size_t wanted = std::max(announced() + 1, end_ + 1);
    if (wanted > buffer_.size()) buffer_.resize(std::max(wanted, 2 * buffer_.size()));
    return {buffer_.data() + end_, buffer_.size() - end_};
  }

  /// Say how many bytes were put there.
  void received(std::size_t count) { end_ += count; }

  /// The payload of the next whole packet, valid until the next call of `room`.
  std::optional<Bytes> next() {
    const std::size_t size = announced();
    if (is_broken_ || size == 0 || end_ - begin_ < size) return std::nullopt;
    const Bytes payload{buffer_.data() + begin_ + framing::header_bytes, size - framing::header_bytes};
    begin_ += size;
    return payload;
  }

  /// A header announced a length of 0, or one that is too large: close [FRM-3].
  bool is_broken() const { return is_broken_; }

  /// Whether the stream stands between two packets, where it may end [FRM-6].
  bool is_between_packets() const { return begin_ == end_; }

 private:
  /// Bytes of the packet that begins here, header included; 0 before it is known.
  std::size_t announced() {
    if (end_ - begin_ < static_cast<std::size_t>(framing::header_bytes)) return 0;
    std::uint32_t length = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      length |= static_cast<std::uint32_t>(static_cast<unsigned char>(buffer_[begin_ + i])) << (8 * i);
    }
    if (length < limits::min_payload_bytes || length > limits::max_payload_bytes) is_broken_ = true;
    return is_broken_ ? 0 : length + static_cast<std::size_t>(framing::header_bytes);
  }

  void move_to_front() {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
  }

  std::vector<char> buffer_ = std::vector<char>(4096);
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  bool is_broken_ = false;
};

/// Writes packets one behind the other, in the order in which TCP is to take them; commas and lengths
/// are its own affair. Allocates only while more waits than ever before.
class Outbox {
 public:
  bool is_empty() const { return begin_ == bytes_.size(); }

  /// What TCP has not taken yet.
  std::string_view waiting() const { return std::string_view(bytes_).substr(begin_); }

  /// Say how many bytes TCP took.
  void taken(std::size_t count) {
    begin_ += count;
    if (is_empty()) {
      bytes_.clear();
      begin_ = 0;
    }
  }

  /// Begin a message of this type.
  void begin(std::string_view type) {
    start_ = bytes_.size();
    bytes_.append(static_cast<std::size_t>(framing::header_bytes), '\0');
    comma_ = false;
    begin_object();
    member("type", type);
  }

  /// End it; it waits from now on.
  void end() {
    end_object();
    const std::size_t length = bytes_.size() - start_ - static_cast<std::size_t>(framing::header_bytes);
    for (std::size_t i = 0; i < 4; ++i) bytes_[start_ + i] = static_cast<char>(length >> (8 * i));
  }

  /// Begin a member. No name may stand twice in an object [JSN-3].
  void name(std::string_view name) {
    text(name);
    bytes_ += ':';
    comma_ = false;
  }

  void member(std::string_view its, std::string_view value) { name(its), text(value); }
  void member(std::string_view its, double value) { name(its), number(value); }
  void member(std::string_view its, std::int64_t value) { name(its), number(value); }

  void begin_object() { open('{'); }
  void end_object() { close('}'); }
  void begin_array() { open('['); }
  void end_array() { close(']'); }

  void null() {
    separate();
    bytes_ += "null";
  }

  void boolean(bool value) {
    separate();
    bytes_ += value ? "true" : "false";
  }

  /// A finite number or an integer, which reads back as it is [ACC-1, JSN-4].
  template <class Number>
  void number(Number value) {
    separate();
    char digits[32];
    bytes_.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
  }

  /// UTF-8, which its caller has looked at [JSN-1].
  void text(std::string_view value) {
    separate();
    bytes_ += '"';
    for (const char each : value) {
      if (each == '"' || each == '\\') bytes_ += '\\';
      if (static_cast<unsigned char>(each) < 0x20) {
        constexpr std::string_view hex = "0123456789abcdef";
        bytes_ += "\\u00";
        bytes_ += hex[static_cast<std::size_t>(each >> 4)];
        bytes_ += hex[static_cast<std::size_t>(each & 15)];
      } else {
        bytes_ += each;
      }
    }
    bytes_ += '"';
  }

  template <class Texts>
  void texts(const Texts& values) {
    begin_array();
    for (const auto& each : values) text(each);
    end_array();
  }

 private:
  void open(char bracket) {
    separate();
    bytes_ += bracket;
    comma_ = false;
  }

  void close(char bracket) {
    bytes_ += bracket;
    comma_ = true;
  }

  void separate() {
    if (comma_) bytes_ += ',';
    comma_ = true;
  }

  std::string bytes_;
  std::size_t begin_ = 0;
  std::size_t start_ = 0;
  bool comma_ = false;
};

}  // namespace splatbus
