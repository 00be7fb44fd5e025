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

/// What the client is connected to, at one moment.
struct ClientStatus {
  ChannelState ipc = ChannelState::away, message = ChannelState::away;
  std::string server;                     ///< as it names itself; empty where it speaks 1.0, or is none
  std::vector<std::string> capabilities;  ///< what both can do on the message channel
  std::string problem;                    ///< what was last wrong, of either side
};

}  // namespace splatbus
