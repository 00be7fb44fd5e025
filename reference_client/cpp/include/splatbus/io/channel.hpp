// SPDX-License-Identifier: MIT
// The socket of one channel: connects, and again when it is lost; bytes between it and a session,
// within the limits of time (1.0 chapter 3).
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "splatbus/text/bytes.hpp"
#include "splatbus/io/sockets.hpp"

namespace splatbus {

class Channel {
 public:
  Channel(std::string host, int port) : host_(std::move(host)), port_(port) {}
  ~Channel() {
    if (socket_ != sockets::none) sockets::close(socket_);
  }
  Channel(const Channel&) = delete;
  Channel& operator=(const Channel&) = delete;

  bool is_open() const { return socket_ != sockets::none && !is_connecting_; }

  /// When something has to be done at the latest, in seconds.
  double due() const { return socket_ == sockets::none ? again_ : is_connecting_ ? connected_ : whole_; }

  /// Look the name up if that is due: it may take its time, so no lock should be held.
  void look_up(double now) {
    if (socket_ != sockets::none || now < again_ || next_ < addresses_.size()) return;
    addresses_ = sockets::look_up(host_, port_);
    next_ = 0;
  }

  /// The server is one: the next attempt may come soon after this connection.
  void settled() { pause_ = first_pause; }

  /// An error came: do not come back at once [NEG-24]; later, if the server will not have us.
  void warned(double now, std::string_view code) {
    const bool is_refused = code == ErrorCode::unauthorized || code == ErrorCode::unsupported_version || code == ErrorCode::too_many_clients;
    pause_ = std::max(pause_, is_refused ? refused_pause : limits::error_pause_seconds);
    began_ = std::max(began_, now);
  }

  void want(sockets::Waiter& waiter, std::size_t at, bool has_more) const { waiter.want(at, socket_, is_connecting_ || has_more); }

  /// Do what time asks for. Why the connection is lost, if it is.
  std::optional<std::string> turn(double now) {
    if (now < due()) return std::nullopt;
    if (socket_ == sockets::none) return connect(now);
    return close(now, is_connecting_ ? "no answer within 5 seconds" : "a packet was not whole after 10 seconds [FRM-5]");
  }

  /// Whether the connection has come to stand by now; or why not.
  std::pair<bool, std::optional<std::string>> has_connected(double now) {
    const int error = sockets::error_of(socket_);
    if (error != 0) return {false, close(now, words(error))};
    is_connecting_ = false;
    reader_ = PacketReader();
    return {true, std::nullopt};
  }
  bool is_connecting() const { return is_connecting_; }

  /// Give TCP what it takes now, from any thread that holds the lock; whether that was all. What went
  /// wrong the client's own thread finds, which alone closes.
  bool offer(Outbox& outbox) {
    if (!is_open() || outbox.is_empty()) return outbox.is_empty();
    const std::string_view waiting = outbox.waiting();
    const auto sent = ::send(socket_, waiting.data(), static_cast<sockets::Length>(waiting.size()), sockets::no_signal);
    if (sent > 0) outbox.taken(static_cast<std::size_t>(sent));
    return outbox.is_empty();
  }

  /// Give TCP what it takes. Why the connection is lost, if it is.
  std::optional<std::string> send(double now, Outbox& outbox) {
    while (is_open() && !outbox.is_empty()) {
      const std::string_view waiting = outbox.waiting();
      const auto sent = ::send(socket_, waiting.data(), static_cast<sockets::Length>(waiting.size()), sockets::no_signal);
      if (sent >= 0) outbox.taken(static_cast<std::size_t>(sent));
      else if (sockets::is_for_later(sockets::last_error())) return std::nullopt;
      else return close(now, words(sockets::last_error()));
    }
    return std::nullopt;
  }

  /// Take what TCP has, once; each payload goes to `received`, which returns whether the connection may
  /// go on. Why it is lost, if it is.
  template <class Received>
  std::optional<std::string> receive(double now, Received received) {
    const Bytes room = reader_.room();
    const auto count = recv(socket_, room.data, static_cast<sockets::Length>(room.size), 0);
    if (count < 0 && sockets::is_for_later(sockets::last_error())) return std::nullopt;
    if (count <= 0) return close(now, count == 0 ? "the server has closed the connection" : words(sockets::last_error()));
    reader_.received(static_cast<std::size_t>(count));
    bool is_any = false;
    while (const auto payload = reader_.next()) {
      is_any = true;
      if (const std::optional<std::string> why = received(*payload)) return close(now, *why);
    }
    if (reader_.is_broken()) return close(now, "a packet of no length that may be [FRM-3]");
    if (reader_.is_between_packets()) whole_ = never;
    else if (is_any || whole_ == never) whole_ = now + static_cast<double>(limits::packet_completion_seconds);
    return std::nullopt;
  }

  std::string close(double now, std::string why) {
    if (socket_ != sockets::none) sockets::close(socket_);
    socket_ = sockets::none;
    is_connecting_ = false;
    whole_ = never;
    again_ = std::max(now + pause_, began_ + first_pause);
    pause_ = std::min(2 * pause_, longest_pause);
    return why;
  }

 private:
  static constexpr double never = std::numeric_limits<double>::infinity();
  static constexpr double connect_seconds = 5, first_pause = limits::reconnect_min_seconds, longest_pause = 3, refused_pause = 4;

  static std::string words(int error) { return std::system_category().message(error); }

  std::optional<std::string> connect(double now) {
    began_ = now;
    connected_ = now + connect_seconds;
    if (port_ < 1 || port_ > 65535) return close(now, "the port is no number from 1 to 65535");
    if (next_ >= addresses_.size()) return close(now, "no address is known of '" + host_ + "'");
    int error = 0;
    socket_ = sockets::connect(addresses_[next_++], error);
    is_connecting_ = socket_ != sockets::none;
    return is_connecting_ ? std::nullopt : std::optional(close(now, words(error)));
  }

  std::string host_;
  int port_;
  std::vector<sockets::Address> addresses_;
  std::size_t next_ = 0;
  sockets::Handle socket_ = sockets::none;
  PacketReader reader_;
  bool is_connecting_ = false;
  double again_ = 0;         ///< when to try again
  double connected_ = 0;     ///< when to give up connecting
  double whole_ = never;     ///< when the packet that has begun has to be whole
  double began_ = -never;
  double pause_ = first_pause;
};

}  // namespace splatbus
