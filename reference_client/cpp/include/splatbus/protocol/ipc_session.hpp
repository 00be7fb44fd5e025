// SPDX-License-Identifier: MIT
// One connection to the IPC channel, without I/O: payloads in, steps and packets out.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "splatbus/protocol/frames.hpp"
#include "splatbus/protocol/init_packet.hpp"
#include "splatbus/protocol/negotiation.hpp"

namespace splatbus {

/// What a message on the IPC channel asks of who owns the connection.
enum class IpcStep {
  nothing,
  agreed,     ///< the server is known, see `state`
  announced,  ///< other memory: open `packet` if there is one, then give up what was open before [OPN-5]
  lent,       ///< `frame` is lent, until `release`
  error,      ///< `error` came
  close,      ///< close the connection, for `problem`
};

class IpcSession {
 public:
  /// `json` reads the payloads; no other session may use it at the time. `has_cuda`: memory of a GPU can be opened.
  IpcSession(const ClientOptions& options, Json& json, bool has_cuda) : json_(json) {
    std::vector capabilities{Capability::host_shm, Capability::frames, Capability::reinit, Capability::subscribe};
    if (has_cuda) capabilities.push_back(Capability::cuda_ipc);
    negotiation::write_hello(out, options, capabilities);
  }

  Outbox out;
  ChannelState state = ChannelState::greeted;
  std::optional<Welcome> welcome;
  /// What was announced last; nothing if it must not be opened.
  std::optional<InitPacket> packet;
  /// The one that was lent last; it is used again.
  Frame frame;
  bool is_lent = false;
  /// Which channels of the frame may be read [IMG-22].
  bool has_color = false, has_depth = false;
  Error error;
  /// What the server last did wrong; who reads it clears it.
  Wrong problem;

  IpcStep receive(Bytes payload) {
    const std::optional<Value> message = json_.read(payload);
    if (!message) {
      problem = json_.wrong();
      return IpcStep::nothing;
    }
    if (init_packets::is_one(*message)) return on_init_packet(*message);
    const auto type = message->member("type");
    if (!type) return IpcStep::nothing;
    if (type->is(Frame::type)) return on_frame(*message);
    if (type->is(Welcome::type)) return on_welcome(*message);
    if (!type->is(Error::type)) return IpcStep::nothing;
    error = negotiation::read_error(*message);
    return IpcStep::error;
  }

  /// Whether `packet` is of buffers as 1.0 has them, to be looked at without a lease.
  bool is_legacy() const {
    return packet && packet->mem_color && !(packet->ring && negotiation::lists(welcome, Capability::frames));
  }

  /// The memory of `packet` is mapped and checked [OPN-2].
  void memory_opened() {
    if (state == ChannelState::old) return;
    open_.push_back({packet->generation, packet->ring ? packet->ring->slots : 0, packet->meta});
    let_color_ = wants_color_;
    let_depth_ = wants_depth_;
    answer(Opened::type, packet->generation);
  }

  /// `frame` is what lies in the buffers of 1.0 now.
  void look() {
    constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
    const std::int64_t seq = frame.seq + 1;
    frame = Frame();
    frame.seq = seq;
    frame.time = frame.renderedAt = unknown;
    has_color = wants_color_;
    has_depth = wants_depth_;
  }

  /// The memory of `packet` cannot be used.
  void open_failed(std::string_view reason) {
    fail(packet->generation, reason);
    packet.reset();
  }

  /// The frame that was lent has been read [IMG-12, IMG-13].
  void release() {
    if (!std::exchange(is_lent, false)) return;
    release(frame.generation, frame.seq);
  }

  /// The memory of this generation is unmapped, and what was lent of it released.
  void memory_closed(std::int64_t generation) {
    if (state == ChannelState::old) return;
    open_.erase(std::remove_if(open_.begin(), open_.end(), [=](const Open& it) { return it.generation == generation; }), open_.end());
    answer(Closed::type, generation);
  }

  /// What images shall hold from now on; said where it can be.
  void subscribe(bool color, bool depth) {
    if ((color == wants_color_ && depth == wants_depth_) || !negotiation::lists(welcome, Capability::subscribe)) return;
    wants_color_ = color;
    wants_depth_ = depth;
    out.begin(Subscribe::type);
    out.name("channels");
    out.begin_array();
    if (color) out.text(SubscribeChannels::color);
    if (depth) out.text(SubscribeChannels::depth);
    out.end_array();
    out.end();
  }

 private:
  struct Open {
    std::int64_t generation, slots;
    Meta meta;
  };
  static constexpr std::size_t most_before_welcome = 16;
  static constexpr std::size_t longest_reason = 1000;  // of limits::max_reason_chars

  IpcStep on_welcome(Value message) {
    if (state != ChannelState::greeted) return IpcStep::nothing;
    Wrong wrong;
    auto found = negotiation::read_welcome(message, wrong);
    if (!found) {
      problem = "a welcome whose " + wrong;
      return IpcStep::nothing;
    }
    if (found->version == negotiation::former) {
      state = ChannelState::old;
      return IpcStep::agreed;
    }
    if (found->version != negotiation::own) return close("a welcome to a version that hello did not list [NEG-16]");
    state = ChannelState::agreed;
    welcome = std::move(found);
    for (const std::int64_t each : passed_over_) fail(each, "another init packet came before it could be opened");
    if (newest_ == 0) return IpcStep::agreed;
    if (!packet) fail(newest_, why_not_);
    return IpcStep::announced;
  }

  IpcStep on_init_packet(Value message) {
    const bool is_early = state == ChannelState::greeted, is_further = newest_ > 0;
    if (!message.member("version")) return on_init_packet_of_1_0(message);
    if (state == ChannelState::old) return IpcStep::nothing;
    const auto member = message.member("generation");
    const auto generation = member ? member->integer() : std::nullopt;
    if (!generation || *generation <= newest_) {
      problem = "an init packet without a generation that is greater than all before [MEM-1]";
      return IpcStep::nothing;
    }
    if (is_further && !is_early && !negotiation::lists(welcome, Capability::reinit)) return IpcStep::nothing;
    if (is_further && is_early) passed_over_.push_back(newest_);
    if (passed_over_.size() > most_before_welcome) return close("too many init packets before welcome");
    newest_ = *generation;
    why_not_.clear();
    packet = init_packets::read(message, why_not_);
    problem = why_not_;
    if (is_early) return IpcStep::nothing;
    if (!packet) fail(newest_, why_not_);
    return IpcStep::announced;
  }

  /// From a server that may know nothing of `hello`.
  IpcStep on_init_packet_of_1_0(Value message) {
    if (state == ChannelState::agreed) {
      problem = "an init packet without version after welcome [MEM-1]";
      return IpcStep::nothing;
    }
    state = ChannelState::old;
    why_not_.clear();
    packet = init_packets::read(message, why_not_);
    problem = why_not_;
    return IpcStep::announced;
  }

  IpcStep on_frame(Value message) {
    std::int64_t generation = 0, seq = 0, slot = 0;
    if (!negotiation::lists(welcome, Capability::frames) || !frames::read_place(message, generation, seq, slot)) return IpcStep::nothing;
    const auto at = std::find_if(open_.begin(), open_.end(), [=](const Open& it) { return it.generation == generation; });
    if (at == open_.end() || slot >= at->slots) return IpcStep::nothing;
    const char* wrong = seq <= last_seq_ ? "a frame whose seq is not greater than that of the one before [IMG-1]" : nullptr;
    last_seq_ = seq;
    if (is_lent) wrong = "a frame while another is lent [IMG-2]";
    // Memory that is given up is not read any more; a frame that crossed is released as it is.
    const bool is_late = generation != newest_;
    if (!is_late && wrong == nullptr) wrong = frames::read(message, at->meta, frame);
    if (wrong != nullptr) problem = wrong;
    if (is_late || wrong != nullptr) {
      release(generation, seq);
      return IpcStep::nothing;
    }
    frame.generation = generation;
    frame.seq = seq;
    frame.slot = slot;
    has_color = let_color_;
    has_depth = let_depth_;
    is_lent = true;
    return IpcStep::lent;
  }

  IpcStep close(std::string_view why) {
    problem = why;
    return IpcStep::close;
  }

  void release(std::int64_t generation, std::int64_t seq) {
    let_color_ = wants_color_;
    let_depth_ = wants_depth_;
    out.begin(Release::type);
    out.member("generation", generation);
    out.member("seq", seq);
    out.end();
  }

  void fail(std::int64_t generation, std::string_view reason) {
    if (state == ChannelState::old) return;
    out.begin(OpenFailed::type);
    out.member("generation", generation);
    out.member("reason", reason.substr(0, longest_reason));
    out.end();
  }

  void answer(std::string_view type, std::int64_t generation) {
    out.begin(type);
    out.member("generation", generation);
    out.end();
  }

  Json& json_;
  std::vector<Open> open_;
  std::vector<std::int64_t> passed_over_;  ///< generations that others replaced before anything could be answered
  std::int64_t newest_ = 0, last_seq_ = -1;
  Wrong why_not_;
  bool wants_color_ = true, wants_depth_ = true, let_color_ = true, let_depth_ = true;
};

}  // namespace splatbus
