// SPDX-License-Identifier: MIT
// A viewer without a window: sways the camera, looks at the pixel in the middle of each image, says what
// happens, and writes the first image to the file that is named, if one is. Where to connect stands in
// the environment, SPLATBUS_HOST and so on.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <variant>

#include "png.hpp"
#include "splatbus/client.hpp"

namespace {

constexpr std::chrono::milliseconds refresh{50};

const char* name(splatbus::ChannelName channel) { return channel == splatbus::ChannelName::ipc ? "IPC" : "message"; }

struct Told {
  void operator()(const splatbus::Connected& it) const {
    std::printf("%s: %s\n", name(it.channel), it.welcome ? (it.welcome->server.name + ", 1.1").c_str() : "a server of 1.0");
  }
  void operator()(const splatbus::Lost& it) const { std::printf("%s: %s; trying again\n", name(it.channel), it.why.c_str()); }
  void operator()(const splatbus::Images& it) const {
    if (it.packet) std::printf("images of %lld x %lld\n", static_cast<long long>(it.packet->meta.w), static_cast<long long>(it.packet->meta.h));
    else std::printf("no images: %s\n", it.why.c_str());
  }
  void operator()(const splatbus::ServerError& it) const {
    std::printf("%s: the server says %s: %s\n", name(it.channel), it.error.code.c_str(), it.error.message.c_str());
  }
  void operator()(const splatbus::Problem& it) const { std::printf("%s: the server sent %s\n", name(it.channel), it.what.c_str()); }
  void operator()(const splatbus::Telemetry& it) const { std::printf("%zu series of telemetry\n", it.series.size()); }
  void operator()(const splatbus::Replied&) const {}
};

void look(const splatbus::FrameLease& lease) {
  const auto& meta = lease.packet().meta;
  const auto middle = static_cast<std::size_t>(meta.h / 2 * meta.w + meta.w / 2);
  const float* color = lease.color() + 4 * middle;
  std::printf("image %lld: %.3g %.3g %.3g in the middle, at depth %.3g\n", static_cast<long long>(lease.frame().seq),
              static_cast<double>(color[0]), static_cast<double>(color[1]), static_cast<double>(color[2]),
              static_cast<double>(lease.depth()[middle]));
}

}  // namespace

int main(int count, char** arguments) {
  const char* file = count > 1 ? arguments[1] : nullptr;
  splatbus::Client client(splatbus::ClientOptions::from_environment());
  for (int step = 0;; ++step) {
    splatbus::Pose pose;
    pose.position = {0.1 * std::sin(0.1 * step), 0, -4};
    client.send_camera(pose);
    if (const splatbus::FrameLease lease = client.take_frame(refresh)) {
      look(lease);
      if (file != nullptr) return png::write(file, lease) ? 0 : (std::perror(file), 1);
    }
    while (const auto event = client.next_event()) std::visit(Told(), *event);
    std::fflush(stdout);  // Windows buffers no lines, and has no signal that says that nobody reads
    if (std::ferror(stdout) != 0) return 1;
  }
}
