// SPDX-License-Identifier: MIT
// What the client tells its user: what was not asked for, what has been answered, how things stand.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "splatbus/protocol/message_session.hpp"

namespace splatbus {

enum class ChannelName { ipc, message };

/// The server is known: from now on its version is spoken.
struct Connected {
  ChannelName channel;
  std::optional<Welcome> welcome;  ///< none where the server speaks 1.0
};
/// A connection, or an attempt at one, came to nothing; another follows.
struct Lost {
  ChannelName channel;
  std::string why;
};
/// There is memory for images, of another size perhaps; or none that can be used, and why.
struct Images {
  std::optional<InitPacket> packet;
  std::string why;
};
/// The server said what went wrong, and answered no request by it.
struct ServerError {
  ChannelName channel;
  Error error;
};
/// The server broke a rule, and was borne.
struct Problem {
  ChannelName channel;
  std::string what;
};
using Event = std::variant<Connected, Lost, Images, ServerError, Problem, Telemetry, Replied>;

namespace words {
inline std::string of(ChannelName channel) { return channel == ChannelName::ipc ? "IPC: " : "message: "; }
inline std::string of(const Connected& it) {
  return of(it.channel) + "connected to " + (it.welcome ? it.welcome->server.name + " " + it.welcome->server.version : "a server of 1.0");
}
inline std::string of(const Lost& it) { return of(it.channel) + it.why + "; trying again"; }
inline std::string of(const Images& it) {
  if (it.packet) return "images of " + std::to_string(it.packet->meta.w) + " x " + std::to_string(it.packet->meta.h);
  return "no images: " + (it.why.empty() ? "the server has none yet" : it.why);
}
inline std::string of(const ServerError& it) { return of(it.channel) + "the server says " + it.error.code + ": " + it.error.message; }
inline std::string of(const Problem& it) { return of(it.channel) + "the server broke a rule: " + it.what; }
inline std::string of(const Telemetry& it) {
  std::string names;
  for (const Series& each : it.series) names += (names.empty() ? "" : ", ") + std::visit([](const auto& one) { return one.name; }, each);
  return "telemetry: " + names;
}
inline std::string of(const Replied& it) {
  const auto* failure = std::get_if<Failure>(&it.reply);
  return "request " + std::to_string(it.request) + (failure != nullptr ? " failed: " + failure->why : " was answered");
}
}  // namespace words

/// What happened, for a person.
inline std::string to_string(const Event& event) {
  return std::visit([](const auto& it) { return words::of(it); }, event);
}

/// What the client is connected to, at one moment.
struct ClientStatus {
  ChannelState ipc = ChannelState::away, message = ChannelState::away;
  std::string server;                     ///< as it names itself; empty where it speaks 1.0, or is none
  std::vector<std::string> capabilities;  ///< what both can do on the message channel
  std::string problem;                    ///< what was last wrong, of either side
};

}  // namespace splatbus
