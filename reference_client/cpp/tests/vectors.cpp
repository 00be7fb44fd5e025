// SPDX-License-Identifier: MIT
// Tries all cases of a file of test vectors, and prints how many and what is wrong. Without a file it
// answers each line of hexadecimal digits: a payload by what is wrong with it, an init packet looked at
// whole, or by the bits of each number inside and the packet that our writer makes of it. With --frames
// it reads so many images from the server that the environment names, and prints how often it allocated.
// With --texts it says of each line whether its bytes are a text of 1 to 5 characters; with --open why
// the memory of an init packet cannot be opened, or "open"; with --wakes whether a thread that waits
// hears all that so many pairs of wakes tell it.
#include "vectors.hpp"

#include <atomic>
#include <chrono>
#include <cinttypes>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <iterator>
#include <new>
#include <thread>

#include "splatbus/client.hpp"

namespace {
std::atomic<long> allocations{0};
}

[[gnu::noinline]] void* operator new(std::size_t size) {
  ++allocations;
  if (void* found = std::malloc(size)) return found;
  std::abort();
}
[[gnu::noinline]] void operator delete(void* it) noexcept { std::free(it); }
[[gnu::noinline]] void operator delete(void* it, std::size_t) noexcept { std::free(it); }

namespace {

using namespace splatbus;

void again(Value value, Outbox& writer, std::string& bits) {
  switch (value.kind()) {
    case Json::Kind::null: return writer.null();
    case Json::Kind::string: return writer.text(value.text());
    case Json::Kind::number: {
      std::uint64_t raw = 0;
      const double number = value.number();
      std::memcpy(&raw, &number, sizeof raw);
      char digits[20];
      std::snprintf(digits, sizeof digits, "%" PRIx64 " ", raw);
      bits += digits;
      return writer.number(number);
    }
    case Json::Kind::array:
      writer.begin_array();
      for (const Value each : value) again(each, writer, bits);
      return writer.end_array();
    case Json::Kind::object:
      writer.begin_object();
      for (const Value each : value) writer.name(each.name()), again(each, writer, bits);
      return writer.end_object();
    default: return writer.boolean(value.kind() == Json::Kind::yes);
  }
}

void answer(Json& json, std::string payload) {
  Outbox writer;
  std::string told = "taken ";
  const auto found = json.read({payload.data(), payload.size()});
  Wrong wrong = found ? "" : json.wrong();
  if (found && init_packets::is_one(*found)) init_packets::read(*found, wrong);
  if (!wrong.empty()) {
    std::cout << "refused: " << wrong << '\n';
    return;
  }
  writer.begin("");
  for (const Value each : *found) writer.name(each.name()), again(each, writer, told);
  writer.end();
  // The writer puts a type first, which the payload may have as well: take ours out again.
  std::string packet(writer.waiting());
  constexpr std::string_view ours = R"("type":"")";
  packet.erase(5, ours.size() + (packet[5 + ours.size()] == ',' ? 1 : 0));
  const std::size_t length = packet.size() - 4;
  for (std::size_t i = 0; i < 4; ++i) packet[i] = static_cast<char>(length >> (8 * i));
  for (const char each : packet) {
    char digits[3];
    std::snprintf(digits, sizeof digits, "%02x", static_cast<unsigned>(static_cast<unsigned char>(each)));
    told += digits;
  }
  std::cout << told << '\n';
}

void open(Json& json, std::string payload) {
  std::string why;
  const auto packet = init_packets::read(*json.read({payload.data(), payload.size()}), why);
  if (packet && packet->ring) cuda::Images::open(*packet, why);
  else if (packet) cuda::LegacyImages::open(*packet, why);
  std::puts(why.empty() ? "open" : why.c_str());
}

int try_file(const char* path) {
  std::ifstream file(path, std::ios::binary);
  std::string content((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  Json json(10'000'000);
  const auto root = json.read({content.data(), content.size()});
  if (!root) return std::puts(json.wrong().c_str()), 2;
  vectors::spelt(*root, "");
  const int numbers = std::exchange(vectors::tried, 0);
  const std::string name = vectors::text(*root, "name");
  for (const Value each : vectors::member(*root, "cases")) {
    const std::string what = vectors::text(each, "name");
    ++vectors::tried;
    if (name == "numbers") vectors::number(each, what);
    else if (name == "framing") vectors::stream(each, what);
    else if (name == "packets") vectors::packet(each, what);
    else if (name == "poses") vectors::pose(each, what);
    else if (name == "conventions" && vectors::axes(each, what)) continue;
    else if (name == "images" && vectors::composite(each, what)) continue;
    else --vectors::tried;
  }
  std::printf("%d numbers, %d cases, %d wrong\n", numbers, vectors::tried, vectors::wrong);
  return vectors::wrong == 0 ? 0 : 1;
}

float read_images(Client& client, long count) {
  float sum = 0;
  Pose pose;
  for (long i = 0; i < count; ++i) {
    const FrameLease lease = client.take_frame(std::chrono::seconds(20));
    if (!lease) std::fprintf(stderr, "no further image, but %ld: %s\n", i, client.status().problem.c_str()), std::exit(1);
    sum += lease.color()[0] + lease.depth()[0];
    pose.position[0] = lease.frame().camera.position[0] + 0.1 * static_cast<double>(i);
    client.send_camera(pose);
  }
  return sum;
}

int frame_loop(long frames) {
  Client client(ClientOptions::from_environment());
  float sum = read_images(client, 500);
  const long before = allocations;
  sum += read_images(client, frames);
  const long made = allocations - before;
  std::printf("%ld frames, %ld allocations, %g in sum\n", frames, made, static_cast<double>(sum));
  return 0;
}

/// What is said in the middle of a wake has to be heard as well.
int wake_twice(long pairs) {
  using Clock = std::chrono::steady_clock;
  sockets::Waiter waiter;
  std::atomic<long> told{0}, heard{0};
  std::thread sleeper([&] {
    while (heard < 2 * pairs) waiter.wait(60), heard = told.load();
  });
  for (long pair = 0; pair < pairs; ++pair) {
    ++told, waiter.wake();
    const auto again = Clock::now() + std::chrono::nanoseconds(pair * 997 % 100'000);
    while (Clock::now() < again) {
    }
    ++told, waiter.wake();
    const auto limit = Clock::now() + std::chrono::seconds(20);
    while (heard < told) {
      if (Clock::now() > limit) return std::printf("lost after %ld\n", told.load()), std::fflush(stdout), std::_Exit(1), 1;
      std::this_thread::yield();
    }
  }
  sleeper.join();
  return std::puts("heard") < 0;
}

}  // namespace

int main(int count, char** arguments) {
  if (count == 2 && std::string_view(arguments[1]) == "--texts") {
    for (std::string line; std::getline(std::cin, line);) std::puts(is_text(vectors::of_digits(line), 1, 5) ? "text" : "none");
    return 0;
  }
  if (count == 2 && std::string_view(arguments[1]) == "--open") {
    Json json(limits::max_server_values);
    for (std::string line; std::getline(std::cin, line);) open(json, vectors::of_digits(line));
    return 0;
  }
  if (count > 2 && std::string_view(arguments[1]) == "--frames") return frame_loop(std::atol(arguments[2]));
  if (count > 2 && std::string_view(arguments[1]) == "--wakes") return wake_twice(std::atol(arguments[2]));
  if (count > 1) return try_file(arguments[1]);
  Json json(limits::max_server_values);
  for (std::string line; std::getline(std::cin, line);) answer(json, vectors::of_digits(line));
  return 0;
}
