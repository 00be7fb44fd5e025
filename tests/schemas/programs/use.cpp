#include "types.hpp"

#include <iostream>

using namespace splatbus;

struct Told {
  std::string operator()(const Frame& frame) const {
    return std::string(frame.type) + " " + std::to_string(frame.seq) + " " + frame.camera.tag.value_or("");
  }
  std::string operator()(const InitPacket& packet) const {
    const auto* memory = std::get_if<HostShmMemory>(&packet.memory);
    if (memory == nullptr || !packet.ring) return "elsewhere";
    return std::string(memory->kind) + " " + memory->name + " " + std::to_string(packet.ring->slots);
  }
  std::string operator()(const Error& error) const { return error.code; }
  std::string operator()(const Welcome& welcome) const { return welcome.version; }
};

int main() {
  Frame frame;
  frame.seq = 7;
  frame.camera.tag = "a";
  frame.camera.near_ = 0.1;
  InitPacket packet;
  packet.meta.w = 64;
  packet.memory = HostShmMemory{61440, "splat"};
  packet.ring = Ring{};
  packet.ring->slots = 3;
  packet.semantics.alpha = SemanticsAlpha::straight;
  Error error;
  error.code = ErrorCode::busy;
  for (const IpcFromServer& message : {IpcFromServer{frame}, IpcFromServer{packet}, IpcFromServer{error}})
    std::cout << std::visit(Told{}, message) << std::endl;
  static_assert(limits::max_payload_bytes == 1 << 20 && framing::ipc_port == 6001);
}
