// SPDX-License-Identifier: MIT
// A client of SplatBus 1.1 and 1.0: both channels on a thread of its own, which comes back when the
// server does. Its methods may be called from any thread; none waits but `take_frame` with a limit.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "splatbus/io/channel.hpp"
#include "splatbus/events.hpp"
#include "splatbus/frame_lease.hpp"
#include "splatbus/io/image_shelf.hpp"

namespace splatbus {

class Client {
 public:
  explicit Client(ClientOptions options)
      : options_(std::move(options)), ipc_(options_.host, options_.ipc_port), message_(options_.host, options_.message_port), thread_([this] { run(); }) {}

  /// No lease may be held any more.
  ~Client() {
    {
      const std::lock_guard lock(gate_);
      is_stopping_ = true;
    }
    arrived_.notify_all();
    waiter_.wake();
    thread_.join();
  }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  ClientStatus status() const {
    const std::lock_guard lock(gate_);
    ClientStatus status;
    if (ipc_session_) status.ipc = ipc_session_->state;
    if (message_session_) status.message = message_session_->state;
    if (message_session_ && message_session_->welcome) {
      status.capabilities = message_session_->welcome->capabilities;
      status.server = message_session_->welcome->server.name + " " + message_session_->welcome->server.version;
    }
    status.problem = problems_[0].empty() ? problems_[1] : problems_[0];
    return status;
  }

  /// The memory that is open.
  std::optional<InitPacket> images() const {
    const std::lock_guard lock(gate_);
    return shelf_.current() ? std::optional(shelf_.current()->packet) : std::nullopt;
  }

  /// The image that waits to be read, or comes within the limit; an empty lease where there is none.
  FrameLease take_frame(std::chrono::duration<double> limit = {}) {
    std::unique_lock lock(gate_);
    if (limit.count() > 0) arrived_.wait_for(lock, limit, [this] { return shelf_.has_waiting() || is_stopping_; });
    FrameLease lease;
    const auto ticket = shelf_.take();
    if (!ticket) return lease;
    lease.client_ = this;
    lease.memory_ = shelf_.current();
    lease.frame_ = std::shared_ptr<const Frame>(ipc_session_, &ipc_session_->frame);
    lease.ticket_ = *ticket;
    lease.has_color_ = ipc_session_->has_color;
    lease.has_depth_ = ipc_session_->has_depth;
    return lease;
  }

  /// Look from there, camera-to-world in the axes of the wire; the newest counts. Once per refresh of
  /// the display is enough [POS-12]. Without a lens it stays as it is; a tag has 1 to 64 characters.
  /// Why nobody may send it, or null.
  const char* send_camera(const Pose& pose, const Intrinsics* lens = nullptr, std::string_view tag = {}) {
    if (const char* wrong = why_not(pose)) return wrong;
    if (const char* wrong = lens != nullptr ? why_not(*lens) : nullptr) return wrong;
    if (!is_text(tag, 0, limits::max_tag_chars)) return "no tag of at most 64 characters of UTF-8 [CAM-1]";
    return wish([&] { wishes_.camera(pose, lens, tag); });
  }

  /// Move an object of the scene, object-to-world; "default" is the main one. Why nobody may send it, or null.
  const char* send_object(std::string_view id, const Pose& pose, double scale = 1) {
    if (const char* wrong = why_not(pose)) return wrong;
    if (!is_text(id, 1, limits::max_tag_chars)) return "no id of 1 to 64 characters of UTF-8 [OBJ-1]";
    if (!(scale >= limits::min_scale && scale <= static_cast<double>(limits::max_scale))) return "a scale beyond 1e-6 to 1e6 [OBJ-1]";
    return wish([&] { wishes_.object(id, pose, scale); });
  }

  /// Render the scene at this time, in seconds. Why nobody may send it, or null.
  const char* send_time(double seconds) {
    if (!std::isfinite(seconds)) return "a time that is not finite [TIM-1]";
    return wish([&] { wishes_.time(seconds); });
  }

  /// What images have to hold; at least one of both, else nothing changes.
  void subscribe(bool color, bool depth) {
    if (!color && !depth) return;
    change([&] { wants_color_ = color, wants_depth_ = depth; });
  }

  /// Be sent `Telemetry`, of these series; nothing for all. Why nobody may send it, or null.
  const char* subscribe_telemetry(std::optional<std::vector<std::string>> names) {
    if (names && names->size() > static_cast<std::size_t>(limits::max_series)) return "more than 256 series [TEL-1]";
    if (names && std::set<std::string>(names->begin(), names->end()).size() < names->size()) return "a series twice [TEL-1]";
    const auto is_name = [](const std::string& each) { return is_text(each, 1, limits::max_name_chars); };
    if (names && !std::all_of(names->begin(), names->end(), is_name)) return "no name of 1 to 64 characters of UTF-8 [TEL-1]";
    return wish([&] { wishes_.telemetry(std::move(names)); });
  }

  // Requests: each returns the number by which its `Replied` comes.
  std::int64_t ask_viewport_size() { return ask(GetViewportSize{}); }
  std::int64_t ask_scene() { return ask(GetScene{}); }
  std::int64_t ask_camera(std::int64_t index) {
    GetCameraPose message;
    message.cam_idx = std::clamp(index, -limits::max_safe_integer, limits::max_safe_integer);
    return ask(message);
  }
  std::int64_t ask_for_viewport(std::int64_t width, std::int64_t height) {
    SetViewport message;
    message.width = std::clamp<std::int64_t>(width, 1, limits::max_image_size);
    message.height = std::clamp<std::int64_t>(height, 1, limits::max_image_size);
    return ask(message);
  }
  std::int64_t ping() {
    Ping message;
    message.t = now();
    return ask(message);
  }

  /// The oldest event that nobody has taken; of many the oldest are dropped.
  std::optional<Event> next_event() {
    const std::lock_guard lock(gate_);
    if (events_.empty()) return std::nullopt;
    std::optional<Event> event(std::move(events_.front()));
    events_.pop_front();
    return event;
  }

 private:
  friend class FrameLease;
  static constexpr std::size_t most_events = 256;
  static constexpr double never = std::numeric_limits<double>::infinity();

  static double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

  /// Change something that the client's own thread has to look at.
  template <class Change>
  void change(Change make) {
    {
      const std::lock_guard lock(gate_);
      make();
    }
    waiter_.wake();
  }

  /// Want something else; said at once where TCP takes it, so that no other thread has to wake.
  template <class Change>
  const char* wish(Change make) {
    bool is_said = false;
    {
      const std::lock_guard lock(gate_);
      make();
      if (!message_session_) return nullptr;
      message_session_->say_wishes();
      is_said = message_.offer(message_session_->out);
    }
    if (!is_said) waiter_.wake();
    return nullptr;
  }

  template <class Message>
  std::int64_t ask(Message message) {
    std::int64_t number = 0;
    change([&] {
      number = ++requests_;
      Request request;
      request.number = number;
      request.message = message;
      request.until = now() + static_cast<double>(limits::reply_seconds);
      unsent_.push_back(std::move(request));
    });
    return number;
  }

  bool is_lent(std::uint64_t ticket) const {
    const std::lock_guard lock(gate_);
    return shelf_.is_held(ticket);
  }

  void give_back(std::uint64_t ticket) {
    bool is_said = true;
    {
      const std::lock_guard lock(gate_);
      shelf_.give_back(ticket);
      if (!ipc_session_) return;
      shelf_.settle(*ipc_session_);
      is_said = ipc_.offer(ipc_session_->out) && shelf_.due() == never;
    }
    if (!is_said) waiter_.wake();
  }

  void run() {
    std::string why_no_cuda;
    has_cuda_ = cuda::Driver::find(why_no_cuda) != nullptr;
    if (const char* wrong = why_not(options_)) {
      const std::lock_guard lock(gate_);
      return tell(Lost{ChannelName::ipc, wrong}, wrong);
    }
    for (;;) {
      ipc_.look_up(now());
      message_.look_up(now());
      double until = 0;
      {
        const std::lock_guard lock(gate_);
        if (is_stopping_) return;
        until = turn(now());
      }
      if (std::exchange(has_arrived_, false)) arrived_.notify_all();  // who waits for it needs the lock
      waiter_.wait(until - now());
    }
  }

  /// Do all that can be done now. When to do so again at the latest.
  double turn(double at) {
    note_ipc(ipc_.turn(at));
    note_message(message_.turn(at));
    move(at);
    if (ipc_session_) {
      shelf_.settle(*ipc_session_);
      has_arrived_ |= shelf_.look(*ipc_session_, at);
      if (ipc_session_->state == ChannelState::agreed) ipc_session_->subscribe(wants_color_, wants_depth_);
      note_ipc(ipc_.send(at, ipc_session_->out));
    }
    if (message_session_) speak(at);
    while (!unsent_.empty() && unsent_.front().until < at) {
      tell(Replied{unsent_.front().number, Failure{"no server to ask within 10 seconds", std::nullopt}}, nullptr);
      unsent_.pop_front();
    }
    ipc_.want(waiter_, 0, ipc_session_ && !ipc_session_->out.is_empty());
    message_.want(waiter_, 1, message_session_ && !message_session_->out.is_empty());
    const double first = unsent_.empty() ? never : unsent_.front().until;
    const double reply = message_session_ ? message_session_->deadline() : never;
    return std::min({first, reply, ipc_.due(), message_.due(), shelf_.due()});
  }

  /// Between the sockets and the sessions.
  void move(double at) {
    if (waiter_.is_ready(0) && ipc_.is_connecting()) {
      const auto [stands, why] = ipc_.has_connected(at);
      if (stands) begin_ipc();
      note_ipc(why);
    } else if (waiter_.is_ready(0) && ipc_.is_open()) {
      note_ipc(ipc_.receive(at, [this](Bytes payload) { return on_ipc(payload); }));
    }
    if (waiter_.is_ready(1) && message_.is_connecting()) {
      const auto [stands, why] = message_.has_connected(at);
      if (stands) begin_message(at);
      note_message(why);
    } else if (waiter_.is_ready(1) && message_.is_open()) {
      note_message(message_.receive(at, [this](Bytes payload) { return on_message(payload); }));
    }
  }

  void speak(double at) {
    if (at > message_session_->deadline()) return note_message(message_.close(at, "no reply within 10 seconds [CHN-15]"));
    message_session_->say_wishes();
    while (!unsent_.empty() && message_session_->try_ask(unsent_.front(), at)) unsent_.pop_front();
    pass_replies();
    note_message(message_.send(at, message_session_->out));
  }

  void begin_ipc() {
    ipc_session_ = std::make_shared<IpcSession>(options_, ipc_json_, has_cuda_);
    is_ipc_known_ = false;
    ipc_lost_.clear();
  }

  void begin_message(double at) {
    message_session_ = std::make_unique<MessageSession>(options_, message_json_, wishes_, at);
    message_lost_.clear();
  }

  std::optional<std::string> on_ipc(Bytes payload) {
    IpcSession& session = *ipc_session_;
    const IpcStep step = session.receive(payload);
    Wrong wrong = std::exchange(session.problem, {});
    if (step == IpcStep::close) return wrong;
    if (!is_ipc_known_ && session.state != ChannelState::greeted) {
      is_ipc_known_ = true;
      ipc_.settled();
      tell(Connected{ChannelName::ipc, session.welcome}, "");
      const char* doubt = session.welcome && session.welcome->capabilities.empty() ? negotiation::grants_nothing : nullptr;
      if (doubt != nullptr) tell(Problem{ChannelName::ipc, doubt}, doubt);
    }
    if (step == IpcStep::announced) {
      shelf_.open(session, wrong);
      tell(Images{session.packet, wrong}, wrong.c_str());
    } else if (!wrong.empty()) {
      tell(Problem{ChannelName::ipc, wrong}, wrong.c_str());
    }
    if (step == IpcStep::lent) {
      shelf_.put();
      has_arrived_ = true;
    }
    if (step == IpcStep::error) on_error(ipc_, ChannelName::ipc, session.error);
    return std::nullopt;
  }

  std::optional<std::string> on_message(Bytes payload) {
    MessageSession& session = *message_session_;
    const MessageStep step = session.receive(payload);
    const Wrong wrong = std::exchange(session.problem, {});
    pass_replies();
    if (step == MessageStep::close) return wrong;
    if (!wrong.empty()) tell(Problem{ChannelName::message, wrong}, wrong.c_str(), ChannelName::message);
    if (step == MessageStep::agreed) {
      message_.settled();
      tell(Connected{ChannelName::message, session.welcome}, "", ChannelName::message);
    }
    if (step == MessageStep::telemetry) tell(session.telemetry, nullptr);
    if (step == MessageStep::error) on_error(message_, ChannelName::message, session.error);
    return std::nullopt;
  }

  void on_error(Channel& channel, ChannelName name, const Error& error) {
    channel.warned(now(), error.code);
    tell(ServerError{name, error}, (error.code + ": " + error.message).c_str(), name);
  }

  void pass_replies() {
    for (Replied& each : std::exchange(message_session_->replied, {})) tell(std::move(each), nullptr);
  }

  void note_ipc(const std::optional<std::string>& lost) {
    if (!lost) return;
    shelf_.clear();
    ipc_session_.reset();
    if (*lost != ipc_lost_) tell(Lost{ChannelName::ipc, *lost}, lost->c_str());
    ipc_lost_ = *lost;  // an attempt that fails as the one before did is nothing new
  }

  void note_message(const std::optional<std::string>& lost) {
    if (!lost) return;
    if (message_session_) {
      message_session_->lost(*lost);
      pass_replies();
      message_session_.reset();
    }
    if (*lost != message_lost_) tell(Lost{ChannelName::message, *lost}, lost->c_str(), ChannelName::message);
    message_lost_ = *lost;
  }

  /// `problem`: what is wrong with its channel from now on; empty for nothing any more, null for no change.
  void tell(Event event, const char* problem, ChannelName of = ChannelName::ipc) {
    if (problem != nullptr) problems_[static_cast<std::size_t>(of)] = problem;
    if (events_.size() == most_events) events_.pop_front();
    events_.push_back(std::move(event));
  }

  const ClientOptions options_;
  mutable std::mutex gate_;
  std::condition_variable arrived_;
  sockets::Waiter waiter_;
  Channel ipc_, message_;
  Json ipc_json_{limits::max_server_values}, message_json_{limits::max_server_values};
  Wishes wishes_;
  ImageShelf shelf_;
  std::shared_ptr<IpcSession> ipc_session_;  ///< a lease may outlive the connection, and looks at its frame
  std::unique_ptr<MessageSession> message_session_;
  std::deque<Request> unsent_;
  std::deque<Event> events_;
  std::array<std::string, 2> problems_;  ///< by channel
  std::string ipc_lost_, message_lost_;
  std::int64_t requests_ = 0;
  bool wants_color_ = true, wants_depth_ = true, has_cuda_ = false, is_ipc_known_ = false, is_stopping_ = false, has_arrived_ = false;
  std::thread thread_;  ///< the last: it uses all of these
};

inline FrameLease::~FrameLease() {
  if (client_ == nullptr) return;
  memory_->finish();
  memory_.reset();
  client_->give_back(ticket_);
}

inline bool FrameLease::is_still_lent() const { return client_->is_lent(ticket_); }

}  // namespace splatbus
