// SPDX-License-Identifier: MIT
// The little that is asked of sockets, the same on POSIX and Winsock.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#ifdef _WIN32
#include "splatbus/text/windows.hpp"

#include <winsock2.h>
#include <ws2tcpip.h>
#ifdef _MSC_VER
#pragma comment(lib, "ws2_32")
#endif
#else
#include <arpa/inet.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#endif

namespace splatbus {
namespace sockets {

#ifdef _WIN32
using Handle = SOCKET;
inline constexpr Handle none = INVALID_SOCKET;
inline int last_error() { return WSAGetLastError(); }
inline bool is_for_later(int error) { return error == WSAEWOULDBLOCK || error == WSAEINPROGRESS; }
inline void close(Handle socket) { closesocket(socket); }
inline void do_not_block(Handle socket) {
  u_long yes = 1;
  ioctlsocket(socket, FIONBIO, &yes);
}
inline int wait(WSAPOLLFD* entries, std::size_t count, int milliseconds) { return WSAPoll(entries, static_cast<ULONG>(count), milliseconds); }
using Entry = WSAPOLLFD;
using Length = int;
inline constexpr int no_signal = 0;
inline void start() {
  static const int started = [] {
    WSADATA data;
    return WSAStartup(MAKEWORD(2, 2), &data);
  }();
  (void)started;
}
#else
using Handle = int;
inline constexpr Handle none = -1;
inline int last_error() { return errno; }
inline bool is_for_later(int error) { return error == EAGAIN || error == EWOULDBLOCK || error == EINPROGRESS || error == EINTR; }
inline void close(Handle socket) { ::close(socket); }
inline void do_not_block(Handle socket) {
  fcntl(socket, F_SETFL, fcntl(socket, F_GETFL) | O_NONBLOCK);
  fcntl(socket, F_SETFD, FD_CLOEXEC);
}
inline int wait(pollfd* entries, std::size_t count, int milliseconds) { return poll(entries, static_cast<nfds_t>(count), milliseconds); }
using Entry = pollfd;
using Length = std::size_t;
#ifdef MSG_NOSIGNAL
inline constexpr int no_signal = MSG_NOSIGNAL;
#else
inline constexpr int no_signal = 0;
#endif
inline void start() {}
#endif

struct Address {
  sockaddr_storage place{};
  socklen_t size = 0;
};

/// The addresses of a name; it may wait for a name service. None where there are none.
inline std::vector<Address> look_up(const std::string& host, int port) {
  start();
  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  std::vector<Address> addresses;
  if (getaddrinfo(host.c_str(), std::to_string(port).c_str(), &wanted, &found) != 0) return addresses;
  for (const addrinfo* each = found; each != nullptr; each = each->ai_next) {
    Address address;
    std::memcpy(&address.place, each->ai_addr, each->ai_addrlen);
    address.size = static_cast<socklen_t>(each->ai_addrlen);
    addresses.push_back(address);
  }
  freeaddrinfo(found);
  return addresses;
}

/// Begin to connect; none if that cannot even begin.
inline Handle connect(const Address& address, int& error) {
  const Handle socket = ::socket(address.place.ss_family, SOCK_STREAM, 0);
  error = socket == none ? last_error() : 0;
  if (socket == none) return none;
  do_not_block(socket);
  const int yes = 1;
  setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, reinterpret_cast<const char*>(&yes), sizeof yes);
#ifdef SO_NOSIGPIPE
  setsockopt(socket, SOL_SOCKET, SO_NOSIGPIPE, &yes, sizeof yes);
#endif
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&address.place), address.size) == 0) return socket;
  error = last_error();
  if (is_for_later(error)) return socket;
  close(socket);
  return none;
}

/// What became of it, once the socket can be written to.
inline int error_of(Handle socket) {
  int error = 0;
  socklen_t size = sizeof error;
  getsockopt(socket, SOL_SOCKET, SO_ERROR, reinterpret_cast<char*>(&error), &size);
  return error;
}

/// Waits for two sockets, a time, or another thread.
class Waiter {
 public:
  Waiter() {
    start();
    waker_ = ::socket(AF_INET, SOCK_DGRAM, 0);
    sockaddr_in place{};
    place.sin_family = AF_INET;
    place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof place;
    auto* address = reinterpret_cast<sockaddr*>(&place);
    (void)bind(waker_, address, size);
    (void)getsockname(waker_, address, &size);
    (void)::connect(waker_, address, size);
    do_not_block(waker_);
    entries_[2].fd = waker_;
    entries_[2].events = POLLIN;
  }
  ~Waiter() { close(waker_); }
  Waiter(const Waiter&) = delete;
  Waiter& operator=(const Waiter&) = delete;

  /// `at` is 0 or 1. No socket: wait for nothing there.
  void want(std::size_t at, Handle socket, bool writable) {
    entries_[at].fd = socket;
    entries_[at].events = static_cast<short>(POLLIN | (writable ? POLLOUT : 0));
    entries_[at].revents = 0;
  }

  /// Whether the socket can do something, after `wait`.
  bool is_ready(std::size_t at) const { return (entries_[at].revents & ~POLLNVAL) != 0; }

  /// Return once something can be done, `wake` was called, or the time is over.
  void wait(double seconds) {
    const double milliseconds = std::ceil(1000 * std::clamp(seconds, 0.0, 60.0));
    sockets::wait(entries_.data(), entries_.size(), static_cast<int>(milliseconds));
    if (entries_[2].revents == 0) return;
    char one = 0;
    while (recv(waker_, &one, 1, 0) > 0) {
    }
    is_awake_ = false;  // not before, or a wake between the two would be taken, and every later one be lost
  }

  /// From any thread.
  void wake() {
    if (!is_awake_.exchange(true)) (void)send(waker_, "", 1, no_signal);
  }

 private:
  Handle waker_ = none;
  std::array<Entry, 3> entries_{};
  std::atomic<bool> is_awake_{false};
};

}  // namespace sockets
}  // namespace splatbus
