// SPDX-License-Identifier: MIT
// What the values of a message have to be, and where they are not. Nothing throws: the first thing
// that is wrong is kept, and what is read behind it counts for nothing.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "splatbus/text/json.hpp"

namespace splatbus {

/// The first thing that is wrong with a message, with its JSON pointer and the requirement; empty if nothing is.
using Wrong = std::string;

/// A value of a message, or its absence, and its place.
class Part {
 public:
  Part(std::optional<Value> value, std::string pointer, Wrong& wrong)
      : value_(value), pointer_(std::move(pointer)), wrong_(&wrong) {}

  const std::optional<Value>& value() const { return value_; }
  bool is_there() const { return value_.has_value(); }
  bool is(std::string_view text) const { return value_ && value_->is(text); }

  /// A member that may be absent.
  Part optional(std::string_view name) const {
    return {value_ ? value_->member(name) : std::nullopt, pointer_ + "/" + std::string(name), *wrong_};
  }

  Part member(std::string_view name, std::string_view rule) const {
    if (value_ && !value_->is_object()) broken("is no object", rule);
    Part found = optional(name);
    if (!found.is_there()) found.broken("is missing", rule);
    return found;
  }

  std::int64_t integer(std::int64_t least, std::int64_t most, std::string_view rule) const {
    const auto found = value_ ? value_->integer() : std::nullopt;
    if (found && *found >= least && *found <= most) return *found;
    broken("is no integer from " + std::to_string(least) + " to " + std::to_string(most), rule);
    return least;
  }

  std::int64_t multiple(std::int64_t unit, std::int64_t least, std::string_view rule) const {
    const std::int64_t found = integer(least, limits::max_safe_integer, rule);
    if (found % unit != 0) broken("is no multiple of " + std::to_string(unit), rule);
    return found;
  }

  double number(std::string_view rule) const {
    if (value_ && value_->is_number()) return value_->number();
    broken("is no number", rule);
    return 0;
  }

  /// A string of any length.
  std::string text(std::string_view rule) const {
    if (value_ && value_->is_string()) return std::string(value_->text());
    broken("is no string", rule);
    return {};
  }

  /// A string of so many characters, which are code points.
  std::string text(std::int64_t least, std::int64_t most, std::string_view rule) const {
    std::string found = text(rule);
    const auto characters = std::count_if(found.begin(), found.end(), [](char each) { return (each & 0xc0) != 0x80; });
    if (characters < least || characters > most) broken("has " + std::to_string(characters) + " characters", rule);
    return found;
  }

  std::string one_of(std::initializer_list<std::string_view> values, std::string_view rule) const {
    std::string wanted;
    for (const std::string_view each : values) {
      if (is(each)) return std::string(each);
      wanted += (wanted.empty() ? "" : ", ") + std::string(each);
    }
    broken("is none of " + wanted, rule);
    return std::string(*values.begin());
  }

  template <std::size_t Count>
  std::array<double, Count> vector(std::string_view rule) const {
    std::array<double, Count> found{};
    if (!value_ || !value_->numbers(found)) broken("is no array of " + std::to_string(Count) + " numbers", rule);
    return found;
  }

  /// The values of an array of so many; none where it is none.
  std::vector<Part> items(std::int64_t least, std::int64_t most, std::string_view rule) const {
    std::vector<Part> found;
    const bool is_array = value_ && value_->kind() == Json::Kind::array;
    const auto count = is_array ? static_cast<std::int64_t>(value_->count()) : 0;
    if (!is_array || count < least || count > most) {
      broken("is no array of " + std::to_string(least) + " to " + std::to_string(most), rule);
      return found;
    }
    for (const Value each : *value_) found.emplace_back(each, pointer_ + "/" + std::to_string(found.size()), *wrong_);
    return found;
  }

  void broken(const std::string& what, std::string_view rule) const {
    if (wrong_->empty()) *wrong_ = "'" + pointer_ + "' " + what + " [" + std::string(rule) + "]";
  }

 private:
  std::optional<Value> value_;
  std::string pointer_;
  Wrong* wrong_;
};

}  // namespace splatbus
