// SPDX-License-Identifier: MIT
// What a frame costs: `measure frames N`, `measure poses N` or `measure copies N`, beside a server that the
// environment names; prints a JSON object. See benchmarks/engine_clients.py.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>
#include <string_view>
#include <vector>

#include "splatbus/client.hpp"

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds patience{20};

splatbus::FrameLease next(splatbus::Client& client) {
  splatbus::FrameLease lease = client.take_frame(patience);
  if (!lease) std::fprintf(stderr, "no image: %s\n", client.status().problem.c_str()), std::exit(1);
  return lease;
}

double microseconds(Clock::duration took) { return std::chrono::duration<double, std::micro>(took).count(); }

double quantile(std::vector<double> values, double part) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

/// Processor time of all threads, from one frame to the next.
void frames(splatbus::Client& client, int count) {
  const std::clock_t before = std::clock();
  for (int i = 0; i < count; ++i) next(client);
  const double seconds = static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
  std::printf("{\"processor_us\": %.2f}\n", 1e6 * seconds / count);
}

/// From a pose that is sent to its image.
void poses(splatbus::Client& client, int count) {
  std::vector<double> took;
  for (int i = 0; i < count; ++i) {
    splatbus::Pose pose;
    pose.position = {0.001 * i, 0, -4};
    const std::string tag = "m" + std::to_string(i);
    const auto began = Clock::now();
    client.send_camera(pose, nullptr, tag);
    while (next(client).frame().camera.tag != tag) {
    }
    took.push_back(microseconds(Clock::now() - began));
  }
  std::printf("{\"p50_us\": %.1f, \"p99_us\": %.1f}\n", quantile(took, 0.5), quantile(took, 0.99));
}

/// Colour and depth of an image into memory of our own, beside the same bytes from our own.
void copies(splatbus::Client& client, int count) {
  std::vector<double> took, floor;
  std::vector<char> own, other;
  for (int i = 0; i < count; ++i) {
    const splatbus::FrameLease lease = next(client);
    const auto pixels = static_cast<std::size_t>(lease.packet().meta.w * lease.packet().meta.h);
    own.resize(20 * pixels);
    other.resize(20 * pixels);
    auto began = Clock::now();
    std::memcpy(own.data(), lease.color(), 16 * pixels);
    std::memcpy(own.data() + 16 * pixels, lease.depth(), 4 * pixels);
    took.push_back(microseconds(Clock::now() - began));
    began = Clock::now();
    std::memcpy(other.data(), own.data(), 20 * pixels);
    floor.push_back(microseconds(Clock::now() - began));
  }
  std::printf("{\"copy_us\": %.1f, \"floor_us\": %.1f}\n", quantile(took, 0.5), quantile(floor, 0.5));
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 3) return std::fputs("measure frames|poses|copies N\n", stderr), 2;
  const std::string_view what = arguments[1];
  const int many = std::atoi(arguments[2]);
  splatbus::Client client(splatbus::ClientOptions::from_environment());
  for (int i = 0; i < 20; ++i) next(client);
  if (what == "frames") frames(client, many);
  else if (what == "poses") poses(client, many);
  else copies(client, many);
}
