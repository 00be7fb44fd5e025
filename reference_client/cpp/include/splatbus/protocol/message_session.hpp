// SPDX-License-Identifier: MIT
// One connection to the message channel, without I/O: payloads in, steps and packets out.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "splatbus/protocol/replies.hpp"
#include "splatbus/protocol/wishes.hpp"

namespace splatbus {

/// Why a request has no reply: the server's `error`, or the connection's end.
struct Failure {
  std::string why;
  std::optional<Error> error;
};

/// What became of a request, by the number that it was given.
struct Replied {
  std::int64_t request;
  std::variant<ViewportSize, Camera, Scene, Pong, Failure> reply;
};

/// A question to the server, in the order of `Replied`.
struct Request {
  std::int64_t number = 0;
  std::variant<GetViewportSize, SetViewport, GetCameraPose, GetScene, Ping> message;
  double until = 0;    ///< when the wait for its reply ends, in seconds
  bool has_id = false;  ///< said to a server of 1.1, after its welcome
};

/// What a message on the message channel asks of who owns the connection.
enum class MessageStep {
  nothing,
  agreed,     ///< the server is known, see `state`
  telemetry,  ///< `telemetry` came
  error,      ///< `error` came, and answers no request
  close,      ///< close the connection, for `problem`
};

class MessageSession {
 public:
  /// `json` reads the payloads, and no other session may use it at the time; `wishes` are said; `now` in seconds.
  MessageSession(const ClientOptions& options, Json& json, Wishes& wishes, double now) : json_(json), wishes_(wishes) {
    constexpr std::array capabilities{Capability::intrinsics, Capability::objects, Capability::scene,    Capability::viewport,
                                      Capability::time,       Capability::ping,    Capability::telemetry};
    wishes_.unsay();
    negotiation::write_hello(out, options, capabilities);
    // Its reply, or a welcome before it, tells which version the server speaks [NEG-13].
    send(Request{}, now);
  }

  Outbox out;
  ChannelState state = ChannelState::greeted;
  std::optional<Welcome> welcome;
  Error error;
  Telemetry telemetry;
  /// What has been answered; who reads it clears it.
  std::vector<Replied> replied;
  /// What the server last did wrong; who reads it clears it.
  Wrong problem;

  /// When the wait for the oldest reply ends.
  double deadline() const { return asked_.empty() ? std::numeric_limits<double>::infinity() : asked_.front().until; }

  /// Say what is wanted, once TCP has taken what was said before: the newest is enough.
  void say_wishes() {
    if (out.is_empty()) wishes_.say(out, welcome);
  }

  /// Send a request; false while it is not known whether the server takes it.
  bool try_ask(const Request& request, double now) {
    if (state == ChannelState::greeted) return false;
    constexpr std::string_view of_1_0;
    constexpr std::array needs{of_1_0, Capability::viewport, of_1_0, Capability::scene, Capability::ping};
    const std::string_view needed = needs[request.message.index()];
    if (needed.empty() || negotiation::lists(welcome, needed)) send(request, now);
    else replied.push_back({request.number, Failure{"the server does not have " + std::string(needed), std::nullopt}});
    return true;
  }

  MessageStep receive(Bytes payload) {
    const std::optional<Value> message = json_.read(payload);
    if (!message) return unreadable();
    const auto type = message->member("type");
    if (!type) return on_untyped(*message);
    if (type->is(Welcome::type)) return on_welcome(*message);
    if (type->is(Error::type)) return on_error(*message);
    if (state != ChannelState::agreed) return MessageStep::nothing;
    if (type->is(Telemetry::type)) return on_telemetry(*message);
    for (const std::string_view each : reply_types) {
      if (type->is(each)) return on_reply(*message, each);
    }
    return MessageStep::nothing;
  }

  /// The connection is lost: nothing is answered any more.
  void lost(const std::string& why) {
    for (const Request& each : asked_) {
      if (each.number != 0) replied.push_back({each.number, Failure{why, std::nullopt}});
    }
    asked_.clear();
  }

 private:
  /// By the kind of a request.
  static constexpr std::array<std::string_view, 5> reply_types{ViewportSize::type, ViewportSize::type, Camera::type, Scene::type, Pong::type};

  void send(Request request, double now) {
    std::visit([this](const auto& message) { out.begin(message.type), write(message); }, request.message);
    request.has_id = welcome.has_value();
    if (request.has_id) out.member("id", request.number);
    out.end();
    request.until = now + static_cast<double>(limits::reply_seconds);
    asked_.push_back(std::move(request));
  }

  void write(const GetViewportSize&) {}
  void write(const GetScene&) {}
  void write(const GetCameraPose& it) { out.member("cam_idx", it.cam_idx); }
  void write(const Ping& it) { out.member("t", it.t); }
  void write(const SetViewport& it) {
    out.member("width", it.width);
    out.member("height", it.height);
  }

  MessageStep on_welcome(Value message) {
    if (state != ChannelState::greeted) return MessageStep::nothing;
    Wrong wrong;
    auto found = negotiation::read_welcome(message, wrong);
    if (!found) {
      problem = "a welcome whose " + wrong;
      return MessageStep::nothing;
    }
    if (found->version == negotiation::former) {
      state = ChannelState::old;
    } else if (found->version != negotiation::own) {
      return close("a welcome to a version that hello did not list [NEG-16]");
    } else {
      state = ChannelState::agreed;
      welcome = std::move(found);
      wishes_.say_more();
    }
    return MessageStep::agreed;
  }

  /// An object without a type is a reply of 1.0, or none at all.
  MessageStep on_untyped(Value message) {
    if (state == ChannelState::agreed || asked_.empty()) return MessageStep::nothing;
    if (state == ChannelState::old) return answer(message);
    if (!message.member("viewport_size")) return MessageStep::nothing;
    state = ChannelState::old;
    return answer(message) == MessageStep::close ? MessageStep::close : MessageStep::agreed;
  }

  MessageStep on_reply(Value message, std::string_view type) {
    if (asked_.empty()) return MessageStep::nothing;
    const auto id = message.member("id");
    const bool is_its = asked_.front().has_id ? id && id->integer() == asked_.front().number : !id;
    if (reply_types[asked_.front().message.index()] != type || !is_its) return close("a reply to another request than the oldest [NEG-28]");
    return answer(message);
  }

  MessageStep answer(Value message) {
    Wrong wrong;
    Replied found{asked_.front().number, {}};
    switch (asked_.front().message.index()) {
      case 2: found.reply = replies::read_camera(message, wrong); break;
      case 3: found.reply = replies::read_scene(message, wrong); break;
      case 4: found.reply = replies::read_pong(message, wrong); break;
      default: found.reply = replies::read_size(message, wrong);
    }
    if (!wrong.empty()) return close("a reply that is none: " + wrong);
    settle(std::move(found));
    return MessageStep::nothing;
  }

  MessageStep on_error(Value message) {
    error = negotiation::read_error(message);
    if (asked_.empty() || state != ChannelState::agreed) return MessageStep::error;
    // What was asked before the welcome has no id; only `busy` is about a pose [NEG-29].
    const bool is_its = error.id ? asked_.front().has_id && *error.id == asked_.front().number : !asked_.front().has_id && error.code != ErrorCode::busy;
    if (!is_its) return MessageStep::error;
    settle({asked_.front().number, Failure{error.code + ": " + error.message, error}});
    return MessageStep::nothing;
  }

  void settle(Replied found) {
    if (found.request != 0) replied.push_back(std::move(found));
    asked_.pop_front();
  }

  MessageStep on_telemetry(Value message) {
    if (!negotiation::lists(welcome, Capability::telemetry)) return MessageStep::nothing;
    Wrong wrong;
    telemetry = replies::read_telemetry(message, wrong);
    problem = wrong;
    return wrong.empty() ? MessageStep::telemetry : MessageStep::nothing;
  }

  /// It may have been the reply that is awaited [REQ-13].
  MessageStep unreadable() {
    problem = json_.wrong();
    return asked_.empty() ? MessageStep::nothing : MessageStep::close;
  }

  MessageStep close(std::string why) {
    problem = std::move(why);
    return MessageStep::close;
  }

  Json& json_;
  Wishes& wishes_;
  std::deque<Request> asked_;
};

}  // namespace splatbus
