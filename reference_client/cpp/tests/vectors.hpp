// SPDX-License-Identifier: MIT
// Each kind of test vector (spec/vectors) tried on this client.
#pragma once

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "splatbus/compositing.hpp"
#include "splatbus/protocol/frames.hpp"

namespace vectors {

using splatbus::Json;
using splatbus::Outbox;
using splatbus::Pose;
using splatbus::Value;

inline int tried = 0, wrong = 0;

inline void check(bool holds, const std::string& what) {
  if (holds) return;
  ++wrong;
  std::puts(what.c_str());
}

inline Value member(Value of, std::string_view name) {
  const auto found = of.member(name);
  if (!found) std::fprintf(stderr, "no member %.*s\n", static_cast<int>(name.size()), name.data()), std::exit(2);
  return *found;
}

inline std::string text(Value of, std::string_view name) { return std::string(member(of, name).text()); }

/// What C's %a printed: independent of how decimals are read.
inline double of_hex(Value hex) { return std::strtod(std::string(hex.text()).c_str(), nullptr); }

inline std::string of_digits(std::string_view digits) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2) bytes += static_cast<char>(std::stoi(std::string(digits.substr(i, 2)), nullptr, 16));
  return bytes;
}

inline std::string printed(double value) {
  char digits[32];
  return std::string(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

/// Numbers that stand twice read as the same double, and are printed so that they read back.
inline void same(Value decimal, Value hex, const std::string& where) {
  if (decimal.kind() == Json::Kind::array) {
    auto beside = hex.begin();
    for (const Value each : decimal) {
      same(each, *beside, where);
      ++beside;
    }
    return;
  }
  if (!decimal.is_number()) return;  // "inf"
  ++tried;
  const double exact = of_hex(hex);
  check(decimal.number() == exact, where + ": " + std::string(hex.text()) + " was read as " + printed(decimal.number()));
  check(splatbus::number_of(printed(exact)) == exact, where + ": was printed as " + printed(exact));
}

inline void spelt(Value value, const std::string& where) {
  const auto decimal = value.member("decimal"), hex = value.member("hex");
  if (decimal && hex) return same(*decimal, *hex, where);
  for (const Value each : value) spelt(each, value.is_object() ? where + "/" + std::string(each.name()) : where);
}

inline std::optional<Value> read(Json& json, std::string& payload) { return json.read({payload.data(), payload.size()}); }

inline std::string times(Value pieces, const char* name, bool is_hex) {
  std::string all;
  for (const Value piece : pieces) {
    const std::string once = is_hex ? of_digits(member(piece, name).text()) : text(piece, name);
    const auto count = piece.member("times");
    for (std::int64_t i = count ? *count->integer() : 1; i > 0; --i) all += once;
  }
  return all;
}

inline void number(Value each, const std::string& what) {
  const std::string verdict = text(each, "verdict");
  if (verdict == "printed") {
    const double value = of_hex(member(member(each, "value"), "hex"));
    const bool is_single = member(each, "precision").is("single");
    const auto held = [&](double it) { return is_single ? static_cast<double>(static_cast<float>(it)) : it; };
    check(held(splatbus::number_of(printed(value))) == value, what + ": printed as " + printed(value));
    for (const Value it : member(each, "enough")) check(held(splatbus::number_of(it.text())) == value, what);
    for (const Value it : member(each, "too_few")) check(held(splatbus::number_of(it.text())) != value, what);
    return;
  }
  const Value spelling = member(each, "spelling");
  std::string payload = R"({"type":"camera_pose","timestamp":)" + (spelling.is_string() ? std::string(spelling.text()) : times(spelling, "text", false)) + "}";
  Json json(1000);
  const auto found = read(json, payload);
  const bool is_taken = found && member(*found, "timestamp").is_number();
  check(verdict == "optional" || is_taken == (verdict == "accepted"), what + (is_taken ? ": accepted" : ": rejected"));
  if (is_taken && verdict != "rejected") {
    check(member(*found, "timestamp").number() == of_hex(member(member(each, "value"), "hex")), what + ": another value");
  }
}

/// A stream, in the pieces that end at these places.
inline void divided(Value each, const std::string& what, const std::string& stream, const std::vector<std::size_t>& cuts) {
  splatbus::PacketReader reader;
  std::vector<std::string> found, expected;
  std::size_t at = 0;
  for (const std::size_t cut : cuts) {
    while (at < cut && !reader.is_broken()) {
      const splatbus::Bytes room = reader.room();
      const std::size_t some = std::min(room.size, cut - at);
      std::memcpy(room.data, stream.data() + at, some);
      reader.received(some);
      at += some;
      while (const auto payload = reader.next()) found.emplace_back(payload->data, payload->size);
    }
  }
  for (const Value packet : member(each, "packets")) expected.push_back(times(packet, "hex", true));
  const char* outcome = reader.is_broken() ? "refused" : reader.is_between_packets() ? "whole" : "incomplete";
  check(member(each, "outcome").is(outcome), what + ": " + outcome);
  check(found == expected, what + ": other packets");
}

inline void stream(Value each, const std::string& what) {
  const std::string bytes = times(member(each, "stream"), "hex", true);
  std::vector<std::size_t> cuts, everywhere;
  for (const Value cut : member(each, "cuts")) cuts.push_back(static_cast<std::size_t>(*cut.integer()));
  cuts.push_back(bytes.size());
  divided(each, what, bytes, cuts);
  for (std::size_t at = 0; at < bytes.size(); at += bytes.size() > 4096 ? 997 : 1) everywhere.push_back(at);
  everywhere.push_back(bytes.size());
  divided(each, what + ", byte by byte", bytes, everywhere);
}

inline void packet(Value each, const std::string& what) {
  std::string payload = text(each, "payload");
  const std::string bytes = of_digits(member(each, "hex").text());
  splatbus::PacketReader reader;
  for (std::size_t at = 0; at < bytes.size();) {
    const splatbus::Bytes room = reader.room();
    const std::size_t some = std::min(room.size, bytes.size() - at);
    std::memcpy(room.data, bytes.data() + at, some);
    reader.received(some);
    at += some;
  }
  const auto found = reader.next();
  check(found && std::string_view(found->data, found->size) == payload, what + ": another payload");
  Json json(splatbus::limits::max_server_values);
  check(read(json, payload).has_value(), what + ": rejected");
}

inline Pose pose_of(Value pose) {
  Pose found;
  member(member(pose, "position"), "decimal").numbers(found.position);
  member(member(pose, "rotation"), "decimal").numbers(found.rotation);
  return found;
}

/// A row of the table of axes, false where it is none of this client's.
inline bool axes(Value each, const std::string& what) {
  const std::string engine = text(each, "engine");
  if (engine != "unreal" && engine != "opengl") return false;
  const bool is_to_wire = member(each, "direction").is("to_wire");
  const Pose pose = pose_of(member(each, "pose")), expected = pose_of(member(each, "expected"));
  const Pose got = engine == "unreal" ? (is_to_wire ? splatbus::unreal::to_wire(pose) : splatbus::unreal::from_wire(pose))
                                      : (is_to_wire ? splatbus::opengl::to_wire(pose) : splatbus::opengl::from_wire(pose));
  check(got.position == expected.position, what + ": another position");
  auto opposite = got.rotation;
  for (double& it : opposite) it = -it;
  check(got.rotation == expected.rotation || opposite == expected.rotation, what + ": another rotation");
  return true;
}

inline void pose(Value each, const std::string& what) {
  const char* why = splatbus::why_not(pose_of(member(each, "pose")));
  check((why == nullptr) == member(each, "verdict").is("accepted"), what + (why == nullptr ? ": accepted" : ": rejected"));
}

inline float single(Value spelt) {
  if (spelt.is_number()) return static_cast<float>(spelt.number());
  return spelt.is("nan") ? std::nanf("") : spelt.is("-inf") ? -HUGE_VALF : HUGE_VALF;
}

/// The numbers of a case, however many.
inline std::vector<float> singles(Value each, std::string_view name) {
  const Value spelt = member(member(each, name), "decimal");
  std::vector<float> found;
  if (spelt.kind() != Json::Kind::array) found.push_back(single(spelt));
  for (const Value it : spelt) found.push_back(single(it));
  return found;
}

/// A pixel of splats over one of geometry, false where the case is about another quantity.
inline bool composite(Value each, const std::string& what) {
  if (!member(each, "quantity").is("composite")) return false;
  const std::vector<float> splat = singles(each, "splat"), own = singles(each, "background"), expected = singles(each, "expected");
  splatbus::Semantics semantics;
  semantics.depth.kind = splatbus::DepthSemanticsKind::planar_z;
  semantics.depth.empty = each.member("depth_empty") ? static_cast<double>(singles(each, "depth_empty")[0]) : HUGE_VAL;
  const float depth = splatbus::planar_depth(singles(each, "splat_depth")[0], splat[3], semantics, {}, 0, 0);
  for (std::size_t i = 0; i < 3; ++i) {
    const float got = splatbus::over(splat[i], splat[3], depth, member(each, "alpha").is("straight"), own[i], singles(each, "background_depth")[0]);
    check(got == expected[i], what + ": " + printed(static_cast<double>(got)));
  }
  return true;
}

}  // namespace vectors
