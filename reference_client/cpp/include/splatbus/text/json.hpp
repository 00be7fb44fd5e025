// SPDX-License-Identifier: MIT
// The values of one payload, read strictly [JSN-1 to JSN-5, JSN-12]. Where other readers are lenient,
// this one is not: names that stand twice, halves of surrogates, numbers that overflow, depth.
#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <unordered_set>
#include <vector>

#if !defined(__cpp_lib_to_chars)
#include <clocale>
#include <cstdlib>
#if defined(__APPLE__)
#include <xlocale.h>
#else
#include <locale.h>
#endif
#endif

#include "splatbus/text/bytes.hpp"
#include "splatbus/text/text.hpp"

namespace splatbus {

/// The double nearest to a number by the grammar of RFC 8259, ties to even; infinity beyond the range [ACC-14].
#if defined(__cpp_lib_to_chars)
inline double number_of(std::string_view spelt) {
  double value = 0;
  const auto read = std::from_chars(spelt.data(), spelt.data() + spelt.size(), value);
  if (read.ec != std::errc::result_out_of_range) return value;
  // Too large, or too small? The place of its first digit that is not 0 tells.
  const bool is_negative = spelt[0] == '-';
  const std::size_t mark = spelt.find_first_of("eE");
  const std::string_view digits = spelt.substr(0, mark);
  std::int64_t order = 0;
  if (mark != spelt.npos) {
    std::string_view exponent = spelt.substr(mark + 1);
    if (exponent[0] == '+') exponent.remove_prefix(1);
    const auto found = std::from_chars(exponent.data(), exponent.data() + exponent.size(), order);
    constexpr std::int64_t beyond_any_payload = 1 << 30;
    if (found.ec != std::errc()) order = exponent[0] == '-' ? -beyond_any_payload : beyond_any_payload;
  }
  const std::size_t first = digits.find_first_of("123456789");
  if (first == digits.npos) return is_negative ? -0.0 : 0.0;
  const std::size_t point = std::min(digits.find('.'), digits.size());
  order += static_cast<std::int64_t>(point) - static_cast<std::int64_t>(first);
  const double magnitude = order > 0 ? std::numeric_limits<double>::infinity() : 0.0;
  return is_negative ? -magnitude : magnitude;
}
#else
inline double number_of(std::string_view spelt) {
  // libc++ has no std::from_chars of double before 20. The global locale may write a comma.
  static const locale_t plain = newlocale(LC_ALL_MASK, "C", nullptr);
  std::array<char, 64> ended{};
  if (spelt.size() >= ended.size()) return strtod_l(std::string(spelt).c_str(), nullptr, plain);
  spelt.copy(ended.data(), spelt.size());
  return strtod_l(ended.data(), nullptr, plain);
}
#endif

class Value;

/// Reads payloads into one table that is used again, so that reading allocates nothing but for what is longer than all before.
class Json {
 public:
  enum class Kind : std::uint8_t { null, no, yes, number, string, array, object };

  /// `most_values`: as many as a payload may have [JSN-12, JSN-13].
  explicit Json(std::int64_t most_values) : most_values_(static_cast<std::size_t>(most_values)) {}

  /// Read a payload, whose escapes are replaced where they stand; its object is valid until the next
  /// one is read, or the bytes change. Nothing where it breaks a rule: ignore it [JSN-8], see `wrong`.
  std::optional<Value> read(Bytes payload);

  /// What is wrong with the payload that was read last, and where.
  std::string wrong() const {
    return std::string(wrong_) + " at byte " + std::to_string(at_);
  }

 private:
  friend class Value;

  struct Node {
    Kind kind = Kind::null;
    std::uint32_t start = 0, length = 0;            ///< of a string, without escapes
    std::uint32_t name_start = 0, name_length = 0;  ///< of a member
    std::uint32_t count = 0;                        ///< of values in an array or object
    std::uint32_t behind = 0;                       ///< the index behind the last value inside
    double number = 0;
  };
  static constexpr std::uint32_t few_members = 16;

  bool fail(const char* what) {
    if (wrong_ == nullptr) wrong_ = what;
    return false;
  }

  char now() const { return at_ < size_ ? text_[at_] : '\0'; }

  void space() {
    while (at_ < size_ && (text_[at_] == ' ' || text_[at_] == '\n' || text_[at_] == '\r' || text_[at_] == '\t')) ++at_;
  }

  bool value(std::int64_t depth, std::uint32_t& index) {
    if (nodes_.size() == most_values_) return fail("more values than a payload may have [JSN-12]");
    index = static_cast<std::uint32_t>(nodes_.size());
    nodes_.emplace_back();
    bool good = false;
    switch (now()) {
      case '{': good = object(index, depth); break;
      case '[': good = items(index, depth); break;
      case '"':
        nodes_[index].kind = Kind::string;
        good = string(nodes_[index].start, nodes_[index].length);
        break;
      case 'n': good = literal(index, "null", Kind::null); break;
      case 'f': good = literal(index, "false", Kind::no); break;
      case 't': good = literal(index, "true", Kind::yes); break;
      default: good = number(index);
    }
    nodes_[index].behind = static_cast<std::uint32_t>(nodes_.size());
    return good;
  }

  bool object(std::uint32_t index, std::int64_t depth) {
    if (!enter(index, depth, Kind::object)) return false;
    std::unordered_set<std::string_view> names;
    for (bool ends = false;;) {
      if (!leave('}', nodes_[index].count, ends)) return false;
      if (ends) return true;
      std::uint32_t start = 0, length = 0, member = 0;
      if (now() != '"') return fail("a member has no name [JSN-1]");
      if (!string(start, length)) return false;
      space();
      if (now() != ':') return fail("a name has no value [JSN-1]");
      ++at_;
      space();
      if (!value(depth + 1, member)) return false;
      nodes_[member].name_start = start;
      nodes_[member].name_length = length;
      ++nodes_[index].count;
      if (!is_new(index, member, names)) return fail("a name stands twice in an object [JSN-3]");
    }
  }

  bool items(std::uint32_t index, std::int64_t depth) {
    if (!enter(index, depth, Kind::array)) return false;
    for (bool ends = false;;) {
      if (!leave(']', nodes_[index].count, ends)) return false;
      if (ends) return true;
      std::uint32_t item = 0;
      if (!value(depth + 1, item)) return false;
      ++nodes_[index].count;
    }
  }

  bool enter(std::uint32_t index, std::int64_t depth, Kind kind) {
    nodes_[index].kind = kind;
    if (depth > limits::max_json_depth) return fail("more than 64 levels [JSN-5]");
    ++at_;
    return true;
  }

  /// Pass the bracket that closes, or else the comma before the next value.
  bool leave(char bracket, std::uint32_t before, bool& ends) {
    space();
    ends = now() == bracket;
    if (ends) ++at_;
    if (ends || before == 0) return true;
    if (now() != ',') return fail("neither a comma nor the end of an array or object [JSN-1]");
    ++at_;
    space();
    return true;
  }

  std::string_view name_of(std::uint32_t index) const {
    return {text_ + nodes_[index].name_start, nodes_[index].name_length};
  }

  bool is_new(std::uint32_t parent, std::uint32_t member, std::unordered_set<std::string_view>& names) {
    const bool is_few = nodes_[parent].count <= few_members;
    if (!is_few && !names.empty()) return names.insert(name_of(member)).second;
    for (std::uint32_t other = parent + 1; other < member; other = nodes_[other].behind) {
      if (is_few && name_of(other) == name_of(member)) return false;
      if (!is_few) names.insert(name_of(other));
    }
    return is_few || names.insert(name_of(member)).second;
  }

  bool literal(std::uint32_t index, std::string_view word, Kind kind) {
    if (std::string_view(text_ + at_, size_ - at_).substr(0, word.size()) != word) return fail("no JSON value [JSN-1]");
    nodes_[index].kind = kind;
    at_ += word.size();
    return true;
  }

  bool number(std::uint32_t index) {
    const std::size_t start = at_;
    if (now() == '-') ++at_;
    if (now() == '0') ++at_;
    else if (!digits()) return false;
    if (now() == '.' && (++at_, !digits())) return false;
    if (now() == 'e' || now() == 'E') {
      ++at_;
      if (now() == '+' || now() == '-') ++at_;
      if (!digits()) return false;
    }
    nodes_[index].kind = Kind::number;
    nodes_[index].number = number_of({text_ + start, at_ - start});
    return std::isinf(nodes_[index].number) ? fail("a number overflows [JSN-4]") : true;
  }

  bool digits() {
    const std::size_t start = at_;
    while (now() >= '0' && now() <= '9') ++at_;
    return at_ > start || fail("no JSON value [JSN-1, JSN-4]");
  }

  /// Read a string, and write what its escapes mean over them: that is never longer.
  bool string(std::uint32_t& start, std::uint32_t& length) {
    start = static_cast<std::uint32_t>(++at_);
    std::size_t to = at_;
    for (;;) {
      if (at_ == size_) return fail("a string does not end [JSN-1]");
      const auto each = static_cast<unsigned char>(text_[at_]);
      if (each == '"') break;
      if (each < 0x20) return fail("a control character in a string [JSN-1]");
      if (each == '\\') {
        if (!escape(to)) return false;
      } else if (each < 0x80) {
        text_[to++] = text_[at_++];
      } else if (!beyond_ascii(to)) {
        return false;
      }
    }
    ++at_;
    length = static_cast<std::uint32_t>(to) - start;
    return true;
  }

  bool escape(std::size_t& to) {
    constexpr std::string_view letters = "\"\\/bfnrt", meanings = "\"\\/\b\f\n\r\t";
    const std::size_t which = at_ + 1 < size_ ? letters.find(text_[at_ + 1]) : letters.npos;
    if (which != letters.npos) {
      text_[to++] = meanings[which];
      at_ += 2;
      return true;
    }
    std::uint32_t code = 0, low = 0;
    if (!unit(code)) return false;
    if (code >= 0xd800 && code < 0xe000) {
      const bool is_pair = code < 0xdc00 && now() == '\\' && unit(low) && low >= 0xdc00 && low < 0xe000;
      if (!is_pair) return fail("half a surrogate pair [JSN-1]");
      code = 0x10000 + ((code - 0xd800) << 10) + low - 0xdc00;
    }
    if (code < 0x80) {
      text_[to++] = static_cast<char>(code);
      return true;
    }
    std::uint32_t more = code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
    text_[to++] = static_cast<char>((more == 1 ? 0xc0u : more == 2 ? 0xe0u : 0xf0u) | code >> 6 * more);
    while (more-- > 0) text_[to++] = static_cast<char>(0x80 | (code >> 6 * more & 0x3f));
    return true;
  }

  /// The code unit of \uXXXX.
  bool unit(std::uint32_t& code) {
    if (size_ - at_ < 6 || text_[at_ + 1] != 'u') return fail("no such escape [JSN-1]");
    const char* first = text_ + at_ + 2;
    const auto read = std::from_chars(first, first + 4, code, 16);
    if (read.ptr != first + 4) return fail("no such escape [JSN-1]");
    at_ += 6;
    return true;
  }

  bool beyond_ascii(std::size_t& to) {
    const std::size_t bytes = character_bytes({text_ + at_, size_ - at_});
    for (std::size_t i = 0; i < bytes; ++i) text_[to++] = text_[at_++];
    return bytes > 0 || fail("no UTF-8 [JSN-1]");
  }

  std::size_t most_values_;
  std::vector<Node> nodes_;
  char* text_ = nullptr;
  std::size_t size_ = 0, at_ = 0;
  const char* wrong_ = nullptr;
};

/// One value of a payload that was read.
class Value {
 public:
  Value(const Json* json, std::uint32_t index) : json_(json), index_(index) {}

  Json::Kind kind() const { return node().kind; }
  bool is_object() const { return kind() == Json::Kind::object; }
  bool is_number() const { return kind() == Json::Kind::number; }
  bool is_string() const { return kind() == Json::Kind::string; }
  bool is_null() const { return kind() == Json::Kind::null; }

  /// How many values an array or object has; 0 for all others.
  std::size_t count() const { return node().count; }

  /// The number; 0 for all that is none.
  double number() const { return node().number; }

  /// The text of a string; empty for all that is none.
  std::string_view text() const { return {json_->text_ + node().start, node().length}; }

  std::string_view name() const { return json_->name_of(index_); }

  bool is(std::string_view wanted) const { return is_string() && text() == wanted; }

  /// An integer from 0 to 2⁵³ − 1, however it is spelt [JSN-6].
  std::optional<std::int64_t> integer() const {
    const double value = number();
    const bool found = is_number() && value >= 0 && value <= static_cast<double>(limits::max_safe_integer) && std::floor(value) == value;
    return found ? std::optional(static_cast<std::int64_t>(value)) : std::nullopt;
  }

  /// An array of exactly as many numbers.
  template <std::size_t Count>
  bool numbers(std::array<double, Count>& to) const {
    if (kind() != Json::Kind::array || count() != Count) return false;
    std::size_t at = 0;
    for (const Value each : *this) {
      if (!each.is_number()) return false;
      to[at++] = each.number();
    }
    return true;
  }

  std::optional<Value> member(std::string_view wanted) const {
    if (is_object()) {
      for (const Value each : *this) {
        if (each.name() == wanted) return each;
      }
    }
    return std::nullopt;
  }

  /// Goes through the values of an array or object.
  struct Inside {
    const Json* json;
    std::uint32_t index;
    Value operator*() const { return {json, index}; }
    Inside& operator++() {
      index = json->nodes_[index].behind;
      return *this;
    }
    bool operator!=(const Inside& other) const { return index != other.index; }
  };
  Inside begin() const { return {json_, index_ + 1}; }
  Inside end() const { return {json_, node().behind}; }

 private:
  const Json::Node& node() const { return json_->nodes_[index_]; }

  const Json* json_;
  std::uint32_t index_;
};

inline std::optional<Value> Json::read(Bytes payload) {
  nodes_.clear();
  text_ = payload.data;
  size_ = payload.size;
  at_ = 0;
  wrong_ = nullptr;
  std::uint32_t root = 0;
  space();
  if (now() != '{') fail("the payload is no JSON object [JSN-1]");
  else if (value(1, root)) {
    space();
    if (at_ != size_) fail("there is more behind the object [JSN-1]");
  }
  return wrong_ == nullptr ? std::optional(Value(this, root)) : std::nullopt;
}

}  // namespace splatbus
