// SPDX-License-Identifier: MIT
// What a frame costs: `measure frames N`, `measure arrivals N` (on Linux), `measure poses N` or `measure
// copies N`, beside a server that the environment names; prints a JSON object. See benchmarks/engine_clients.py.
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

#ifdef __linux__
#include <poll.h>
#include <sys/syscall.h>
#include <unistd.h>
#endif

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

#ifdef __linux__
double processor_us() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e6 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_nsec);
}

/// Processor time of the client's own thread from each arrival on the IPC channel to its next rest.
std::vector<double> turns;
thread_local double woken = 0;

/// Processor time from the arrival of a frame to its copy, that of the copy left out: of the client's thread
/// from the wait for the network that ends with it to the next, and of the reader's from its call to the image.
void arrivals(splatbus::Client& client, int count) {
  std::vector<double> taken;
  turns.reserve(static_cast<std::size_t>(4 * count));
  for (int i = 0; i < count; ++i) {
    const double before = processor_us();
    const splatbus::FrameLease lease = next(client);
    const volatile float first = lease.color()[0] + lease.depth()[0];
    (void)first;
    taken.push_back(processor_us() - before);
  }
  std::printf("{\"arrival_us\": %.2f}\n", quantile(turns, 0.5) + quantile(taken, 0.5));
}
#endif

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

#ifdef __linux__
/// In place of the C library's: between two of these the client's thread does its work.
extern "C" int poll(pollfd* entries, nfds_t count, int milliseconds) {
  if (woken > 0 && turns.size() < turns.capacity()) turns.push_back(processor_us() - woken);
  const auto found = static_cast<int>(syscall(SYS_poll, entries, count, milliseconds));
  const bool has_arrived = count > 0 && (entries[0].revents & POLLIN) != 0;
  woken = has_arrived ? processor_us() : 0;
  return found;
}
#endif

int main(int count, char** arguments) {
  if (count < 3) return std::fputs("measure frames|arrivals|poses|copies N\n", stderr), 2;
  const std::string_view what = arguments[1];
  const int many = std::atoi(arguments[2]);
  splatbus::Client client(splatbus::ClientOptions::from_environment());
  for (int i = 0; i < 20; ++i) next(client);
  if (what == "frames") frames(client, many);
  else if (what == "poses") poses(client, many);
#ifdef __linux__
  else if (what == "arrivals") arrivals(client, many);
#endif
  else copies(client, many);
}
