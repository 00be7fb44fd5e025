// SPDX-License-Identifier: MIT
// `hello`, `welcome` and `error` (1.1 chapter 2).
#pragma once

#include <algorithm>
#include <array>
#include <cstdlib>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

#include "splatbus/protocol/part.hpp"
#include "splatbus/text/text.hpp"

#ifdef _WIN32
#include "splatbus/text/windows.hpp"
#endif

namespace splatbus {

/// Where the server is, and who asks.
struct ClientOptions {
  std::string host{framing::host};
  int ipc_port = framing::ipc_port;
  int message_port = framing::message_port;
  /// The server's secret; never take it from a command line [NEG-21].
  std::optional<std::string> token;
  /// Of the program, for the server's log.
  std::string name = "splatbus-cpp";
  std::string version = "0.2.0";

  /// What the environment says, and what is usual where it says nothing [CHN-2, NEG-21]. A port that is
  /// no number is 0, and the client says so when it would connect.
  static ClientOptions from_environment() {
    ClientOptions options;
    if (const auto it = variable(framing::host_variable)) options.host = *it;
    if (const auto it = variable(framing::ipc_port_variable)) options.ipc_port = std::atoi(it->c_str());
    if (const auto it = variable(framing::message_port_variable)) options.message_port = std::atoi(it->c_str());
    options.token = variable("SPLATBUS_TOKEN");
    return options;
  }

 private:
  /// As UTF-8.
  static std::optional<std::string> variable(std::string_view name) {
#ifdef _WIN32
    // What getenv tells there is in the system's code page, which lacks most characters.
    const std::wstring wide(name.begin(), name.end());
    std::wstring found(GetEnvironmentVariableW(wide.c_str(), nullptr, 0), L'\0');
    const DWORD units = GetEnvironmentVariableW(wide.c_str(), found.data(), static_cast<DWORD>(found.size()));
    std::string value(3 * found.size(), '\0');
    const int bytes = WideCharToMultiByte(CP_UTF8, 0, found.data(), static_cast<int>(units), value.data(), static_cast<int>(value.size()), nullptr, nullptr);
    value.resize(static_cast<std::size_t>(bytes));
#else
    const char* found = std::getenv(std::string(name).c_str());
    const std::string value = found != nullptr ? found : "";
#endif
    return value.empty() ? std::nullopt : std::optional(value);
  }
};

/// Why nobody may say `hello` so, or null [NEG-2].
inline const char* why_not(const ClientOptions& options) {
  const bool has_names = is_text(options.name, 0, limits::max_name_chars) && is_text(options.version, 0, limits::max_name_chars);
  if (!has_names) return "the program's name or version is no UTF-8 of at most 64 characters";
  const bool has_token = !options.token || is_text(*options.token, 1, limits::max_token_chars);
  return has_token ? nullptr : "the token is no UTF-8 of 1 to 256 characters";
}

/// How far a connection has come.
enum class ChannelState {
  away,     ///< there is none; another attempt follows
  greeted,  ///< `hello` is said, and not answered yet
  agreed,   ///< 1.1 is spoken
  old,      ///< the server speaks 1.0
};

namespace negotiation {

inline constexpr std::string_view own = "1.1", former = "1.0";

template <class Capabilities>
void write_hello(Outbox& to, const ClientOptions& options, const Capabilities& capabilities) {
  to.begin("hello");
  to.name("versions");
  to.texts(std::array{own, former});
  to.name("client");
  to.begin_object();
  to.member("name", options.name);
  to.member("version", options.version);
  to.end_object();
  to.name("capabilities");
  to.texts(capabilities);
  if (options.token) to.member("token", *options.token);
  to.end();
}

/// Nothing if it breaks NEG-30: ignore it.
inline std::optional<Welcome> read_welcome(Value message, Wrong& wrong) {
  constexpr std::string_view rule = "NEG-30";
  const Part root(message, "", wrong);
  const Part server = root.member("server", rule);
  Welcome welcome;
  welcome.version = root.member("version", rule).text(0, limits::max_name_chars, rule);
  welcome.server.name = server.member("name", rule).text(0, limits::max_name_chars, rule);
  welcome.server.version = server.member("version", rule).text(0, limits::max_name_chars, rule);
  for (const Part& each : root.member("capabilities", rule).items(0, limits::max_capabilities, rule)) {
    std::string name = each.text(0, limits::max_name_chars, rule);
    const auto& all = welcome.capabilities;
    if (std::find(all.begin(), all.end(), name) != all.end()) each.broken("is there twice", rule);
    welcome.capabilities.push_back(std::move(name));
  }
  return wrong.empty() ? std::optional(std::move(welcome)) : std::nullopt;
}

/// What can be read of it: a client bears one that breaks a rule [NEG-24].
inline Error read_error(Value message) {
  const auto text = [&](std::string_view name) {
    const auto found = message.member(name);
    return std::string(found ? found->text() : std::string_view());
  };
  Error error;
  error.code = text("code");
  error.message = text("message");
  if (const auto id = message.member("id")) error.id = id->integer();
  if (message.member("pointer")) error.pointer = text("pointer");
  return error;
}

inline bool lists(const std::optional<Welcome>& welcome, std::string_view capability) {
  if (!welcome) return false;
  const auto& all = welcome->capabilities;
  return std::find(all.begin(), all.end(), capability) != all.end();
}

inline constexpr const char* grants_nothing =
    "the server grants nothing that is done on the IPC channel: are the two ports swapped?";

}  // namespace negotiation
}  // namespace splatbus
