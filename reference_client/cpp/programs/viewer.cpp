// SPDX-License-Identifier: MIT
// A viewer without a window: sways the camera, looks at the pixel in the middle of each image, says what
// happens. Where a file is named, it writes the first image of a pose of its own there, and ends. Where
// to connect stands in the environment, SPLATBUS_HOST and so on.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "png.hpp"
#include "splatbus/client.hpp"

namespace {

constexpr std::chrono::milliseconds refresh{50};

/// Comes back with each image that shows a pose of ours.
constexpr std::string_view tag = "viewer";

/// Images from before the first pose are nobody's; a server of 1.0 does not say which they are.
bool shows_own_pose(const splatbus::FrameLease& lease) { return !lease.has_camera() || lease.frame().camera.tag == tag; }

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
  if (count > 2 || (file != nullptr && file[0] == '-')) return std::fputs("viewer [FILE.png]\n", stderr), 2;
  splatbus::Client client(splatbus::ClientOptions::from_environment());
  for (int step = 0;; ++step) {
    splatbus::Pose pose;
    pose.position = {0.1 * std::sin(0.1 * step), 0, -4};
    client.send_camera(pose, nullptr, tag);
    if (const splatbus::FrameLease lease = client.take_frame(refresh)) {
      look(lease);
      if (file != nullptr && shows_own_pose(lease)) return png::write(file, lease) ? 0 : (std::perror(file), 1);
    }
    while (const auto event = client.next_event()) std::puts(to_string(*event).c_str());
    std::fflush(stdout);  // Windows buffers no lines, and has no signal that says that nobody reads
    if (std::ferror(stdout) != 0) return 1;
  }
}
