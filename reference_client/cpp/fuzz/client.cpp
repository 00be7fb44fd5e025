// SPDX-License-Identifier: MIT
// A fuzz target for libFuzzer: the bytes of a server, on both channels, in pieces. The first byte of the
// input says which channel, and whether a good `welcome` came first; what the sessions say is thrown away.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "splatbus/protocol/ipc_session.hpp"
#include "splatbus/protocol/message_session.hpp"

namespace {

using namespace splatbus;

constexpr std::string_view welcome_ipc =
    R"({"type":"welcome","version":"1.1","server":{"name":"","version":""},"capabilities":["host_shm","frames","reinit","subscribe"]})";
constexpr std::string_view welcome_message =
    R"({"type":"welcome","version":"1.1","server":{"name":"","version":""},"capabilities":["intrinsics","objects","scene","viewport","time","ping","telemetry"]})";

/// Give a session all packets of the stream, in pieces of this size at most.
template <class Receive>
void feed(const std::uint8_t* data, std::size_t size, std::size_t piece, Receive receive) {
  PacketReader reader;
  while (size > 0 && !reader.is_broken()) {
    const Bytes room = reader.room();
    const std::size_t some = std::min({room.size, size, piece});
    std::memcpy(room.data, data, some);
    reader.received(some);
    data += some;
    size -= some;
    while (const auto payload = reader.next()) {
      if (!receive(*payload)) return;
    }
  }
}

void fuzz_ipc(const std::uint8_t* data, std::size_t size, bool is_welcome, std::size_t piece) {
  Json json(limits::max_server_values);
  IpcSession session({}, json, true);
  std::string welcome(welcome_ipc);
  if (is_welcome) session.receive({welcome.data(), welcome.size()});
  feed(data, size, piece, [&](Bytes payload) {
    const IpcStep step = session.receive(payload);
    if (step == IpcStep::announced && session.packet) session.memory_opened();
    if (step == IpcStep::lent) session.release();
    return step != IpcStep::close;
  });
}

void fuzz_message(const std::uint8_t* data, std::size_t size, bool is_welcome, std::size_t piece) {
  Json json(limits::max_server_values);
  Wishes wishes;
  MessageSession session({}, json, wishes, 0);
  std::string welcome(welcome_message);
  if (is_welcome) session.receive({welcome.data(), welcome.size()});
  std::int64_t number = 0;
  for (const auto& each : {Request{0, GetCameraPose{}}, Request{0, GetScene{}}, Request{0, Ping{}}, Request{0, SetViewport{}}}) {
    Request request = each;
    request.number = ++number;
    session.try_ask(request, 0);
  }
  feed(data, size, piece, [&](Bytes payload) { return session.receive(payload) != MessageStep::close; });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::uint8_t how = data[0];
  const std::size_t piece = how & 4 ? 7 : 65536;
  if (how & 1) fuzz_ipc(data + 1, size - 1, how & 2, piece);
  else fuzz_message(data + 1, size - 1, how & 2, piece);
  return 0;
}
