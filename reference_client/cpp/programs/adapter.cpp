// SPDX-License-Identifier: MIT
// Between the conformance harness and the client: commands as JSON lines on standard input, answers on
// standard output (conformance/ADAPTER.md). Poses are in the axes that the first argument names: opencv,
// unreal or opengl. With a second, "device", it reads images on a GPU by a stream of its own.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <variant>
#include <vector>

#include "sha256.hpp"
#include "splatbus/client.hpp"
#include "splatbus/compositing.hpp"

namespace {

using namespace splatbus;

/// A copy of an image, rows from the bottom up.
struct Image {
  std::int64_t width = 0, height = 0;
  std::vector<float> color, depth;  ///< empty where they were not subscribed to
  Semantics semantics;
  Frame frame;

  /// Of the pixel in this column from the left and row from the top.
  std::size_t index(std::int64_t column, std::int64_t row) const { return static_cast<std::size_t>((height - 1 - row) * width + column); }
};

class Adapter {
 public:
  Adapter(std::string axes, bool is_on_device) : axes_(std::move(axes)), is_on_device_(is_on_device) {}
  ~Adapter() { stop(); }
  Adapter(const Adapter&) = delete;
  Adapter& operator=(const Adapter&) = delete;

  void greet() {
    begin_line();
    out_.member("adapter", "1");
    out_.name("client");
    out_.begin_object();
    out_.member("name", "splatbus-cpp");
    out_.member("version", "0.2.0");
    out_.end_object();
    out_.member("axes", axes_);
    out_.member("unitsPerMetre", std::int64_t{axes_ == "unreal" ? 100 : 1});
    out_.member("precision", "double");
    out_.name("can");
    out_.texts(std::array<std::string_view, 11>{"start", "stop", "send_camera", "send_object", "ask", "subscribe", "init_packet", "pixels", "digest", "frame", "composite"});
    end_line();
  }

  /// Answer a command; false after the last.
  bool obey(std::string line) {
    const auto command = json_.read({line.data(), line.size()});
    if (!command) return true;
    const std::string name(command->member("command")->text());
    const double id = command->member("id")->number();
    begin_line();
    out_.member("id", id);
    if (const char* wrong = answer(name, *command)) {
      end_line(false);
      begin_line();
      out_.member("id", id);
      out_.member("error", wrong);
    }
    end_line();
    return name != "stop";
  }

 private:
  const char* answer(const std::string& name, Value command) {
    if (name == "start") return start();
    if (name == "stop") return stop();
    if (name == "send_camera") return client_->send_camera(pose_of(command));
    if (name == "send_object") return client_->send_object("default", pose_of(command));
    if (name == "ask") return ask(*command.member("requests"));
    if (name == "subscribe") return subscribe(*command.member("channels"));
    if (name == "init_packet") return init_packet();
    const std::optional<Image> image = newest();
    if (name == "pixels") return pixels(image, *command.member("at"));
    if (name == "digest") return digest(image);
    if (name == "frame") return frame(image);
    if (name == "composite") return composite(image, command);
    return "no such command";
  }

  const char* start() {
    client_.emplace(ClientOptions::from_environment());
    reader_ = std::thread([this] {
      while (!is_stopping_) read();
    });
    return nullptr;
  }

  const char* stop() {
    is_stopping_ = true;
    if (reader_.joinable()) reader_.join();
    client_.reset();
    return nullptr;
  }

  /// Read each image as it comes, and keep a copy of the newest.
  void read() {
    FrameLease lease = client_->take_frame(std::chrono::milliseconds(100));
    if (!lease) return;
    Image copy;
    copy.frame = lease.frame();
    copy.width = lease.packet().meta.w;
    copy.height = lease.packet().meta.h;
    const auto pixels = static_cast<std::size_t>(copy.width * copy.height);
    if (is_on_device_ && lease.device() != nullptr) {
      fetch(lease, lease.color_on_device(stream_on(*lease.device())), 4 * pixels, copy.color);
      fetch(lease, lease.depth_on_device(stream_on(*lease.device())), pixels, copy.depth);
    } else {
      if (lease.color() != nullptr) copy.color.assign(lease.color(), lease.color() + 4 * pixels);
      if (lease.depth() != nullptr) copy.depth.assign(lease.depth(), lease.depth() + pixels);
    }
    copy.semantics = lease.packet().semantics;
    const std::lock_guard lock(gate_);  // before it is given back: who sees that asks for this copy
    const bool is_good = lease.is_still_lent();
    lease = FrameLease();  // which waits for the stream
    if (is_good) newest_ = std::move(copy);
  }

  cuda::Stream stream_on(const cuda::Device& device) {
    const cuda::Device::Current current(device);
    if (stream_ == nullptr) device.driver.stream_create(&stream_, 1);
    return stream_;
  }

  void fetch(const FrameLease& lease, std::uint64_t from, std::size_t count, std::vector<float>& to) {
    if (from == 0) return;
    const cuda::Device::Current current(*lease.device());
    to.resize(count);
    lease.device()->driver.memcpy_to_host(to.data(), from, count * sizeof(float), stream_);
  }

  std::optional<Image> newest() {
    const std::lock_guard lock(gate_);
    return newest_;
  }

  Pose pose_of(Value command) const {
    Pose pose;
    command.member("position")->numbers(pose.position);
    command.member("rotation")->numbers(pose.rotation);
    return axes_ == "unreal" ? unreal::to_wire(pose) : axes_ == "opengl" ? opengl::to_wire(pose) : pose;
  }

  const char* ask(Value requests) {
    std::vector<std::int64_t> numbers;
    for (const Value each : requests) {
      const auto camera = each.member("camera");
      numbers.push_back(camera ? client_->ask_camera(static_cast<std::int64_t>(camera->number())) : client_->ask_viewport_size());
    }
    std::map<std::int64_t, Replied> replies;
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(8);
    while (replies.size() < numbers.size()) {
      if (std::chrono::steady_clock::now() > until) return "no reply";
      while (auto event = client_->next_event()) {
        const auto* replied = std::get_if<Replied>(&*event);
        const bool is_awaited = replied && std::find(numbers.begin(), numbers.end(), replied->request) != numbers.end();
        if (is_awaited) replies.insert({replied->request, *replied});  // or it comes late, of a command that gave up
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    for (const std::int64_t each : numbers) {
      if (std::holds_alternative<Failure>(replies.at(each).reply)) return "the request failed";
    }
    out_.name("replies");
    out_.begin_array();
    for (const std::int64_t each : numbers) tell(replies.at(each));
    out_.end_array();
    return nullptr;
  }

  void tell(const Replied& replied) {
    out_.begin_object();
    if (const auto* size = std::get_if<ViewportSize>(&replied.reply)) {
      out_.member("width", size->viewport_size[0]);
      out_.member("height", size->viewport_size[1]);
    } else if (const auto* camera = std::get_if<Camera>(&replied.reply)) {
      tell({camera->position, camera->rotation});
    }
    out_.end_object();
  }

  void tell(const Pose& wire) {
    const Pose pose = axes_ == "unreal" ? unreal::from_wire(wire) : axes_ == "opengl" ? opengl::from_wire(wire) : wire;
    list("position", pose.position);
    list("rotation", pose.rotation);
  }

  const char* subscribe(Value channels) {
    bool color = false, depth = false;
    for (const Value each : channels) {
      color |= each.is("color");
      depth |= each.is("depth");
    }
    client_->subscribe(color, depth);
    return nullptr;
  }

  const char* init_packet() {
    const auto packet = client_->images();
    out_.name("images");
    if (!packet) {
      out_.null();
      return nullptr;
    }
    const Semantics& semantics = packet->semantics;
    out_.begin_object();
    out_.member("generation", packet->generation);
    out_.member("width", packet->meta.w);
    out_.member("height", packet->meta.h);
    out_.name("semantics");
    out_.begin_object();
    out_.member("rows", Semantics::rows);
    out_.member("alpha", semantics.alpha);
    out_.member("colorSpace", semantics.colorSpace);
    out_.name("depth");
    out_.begin_object();
    out_.member("kind", semantics.depth.kind);
    out_.member("estimator", semantics.depth.estimator);
    out_.name("empty");
    number(semantics.depth.empty);
    out_.end_object();
    out_.name("unitMetres");
    if (semantics.unitMetres) out_.number(*semantics.unitMetres);
    else out_.null();
    list("origin", semantics.origin);
    out_.end_object();
    out_.end_object();
    return nullptr;
  }

  const char* pixels(const std::optional<Image>& image, Value places) {
    if (!seq(image)) return nullptr;
    out_.name("color");
    if (image->color.empty()) out_.null();
    else at_each(*image, places, [&](std::size_t at, std::int64_t, std::int64_t) { list({image->color[4 * at], image->color[4 * at + 1], image->color[4 * at + 2], image->color[4 * at + 3]}); });
    out_.name("depth");
    if (image->depth.empty()) out_.null();
    else at_each(*image, places, [&](std::size_t at, std::int64_t, std::int64_t) { number(image->depth[at]); });
    return nullptr;
  }

  const char* digest(const std::optional<Image>& image) {
    if (!seq(image)) return nullptr;
    hashed("color", image->color, *image, 4);
    hashed("depth", image->depth, *image, 1);
    return nullptr;
  }

  const char* frame(const std::optional<Image>& image) {
    if (!seq(image)) return nullptr;
    const FrameCamera& camera = image->frame.camera;
    out_.name("camera");
    out_.begin_object();
    tell(Pose{camera.position, camera.rotation});
    out_.member("fx", camera.fx);
    out_.member("fy", camera.fy);
    out_.member("cx", camera.cx);
    out_.member("cy", camera.cy);
    out_.member("width", camera.width);
    out_.member("height", camera.height);
    out_.member("near", camera.near_);
    out_.member("far", camera.far_);
    out_.end_object();
    out_.member("time", image->frame.time);
    out_.name("objects");
    out_.begin_array();
    for (const Placement& each : image->frame.objects.value_or(std::vector<Placement>{})) {
      out_.begin_object();
      out_.member("object", each.object);
      tell(Pose{each.position, each.rotation});
      out_.member("scale", each.scale);
      out_.end_object();
    }
    out_.end_array();
    return nullptr;
  }

  const char* composite(const std::optional<Image>& image, Value command) {
    if (!image || image->color.empty() || image->depth.empty()) {
      seq(std::nullopt);
      return nullptr;
    }
    seq(image);
    std::array<double, 3> own{};
    command.member("color")->numbers(own);
    const Value behind = *command.member("depth");
    const float own_depth = behind.is_number() ? static_cast<float>(behind.number()) : std::numeric_limits<float>::infinity();
    const bool is_straight = image->semantics.alpha == SemanticsAlpha::straight;
    out_.name("color");
    at_each(*image, *command.member("at"), [&](std::size_t at, std::int64_t column, std::int64_t row) {
      const float* color = &image->color[4 * at];
      const float depth = planar_depth(image->depth[at], color[3], image->semantics, image->frame.camera, column, row);
      const auto mixed = [&](std::size_t i) { return over(color[i], color[3], depth, is_straight, static_cast<float>(own[i]), own_depth); };
      list({mixed(0), mixed(1), mixed(2)});
    });
    return nullptr;
  }

  bool seq(const std::optional<Image>& image) {
    out_.name("seq");
    if (image) out_.number(image->frame.seq);
    else out_.null();
    return image.has_value();
  }

  template <class Tell>
  void at_each(const Image& image, Value places, Tell tell_one) {
    out_.begin_array();
    for (const Value each : places) {
      std::array<double, 2> at{};
      each.numbers(at);
      const auto column = static_cast<std::int64_t>(at[0]), row = static_cast<std::int64_t>(at[1]);
      tell_one(image.index(column, row), column, row);
    }
    out_.end_array();
  }

  /// Rows from the top; in memory the bottom one is first.
  void hashed(std::string_view name, const std::vector<float>& numbers, const Image& image, std::size_t channels) {
    out_.name(name);
    if (numbers.empty()) return out_.null();
    const std::size_t row = channels * static_cast<std::size_t>(image.width);
    Sha256 sum;
    for (std::size_t i = static_cast<std::size_t>(image.height); i-- > 0;) sum.add(&numbers[i * row], row * sizeof(float));
    out_.text(sum.hexadecimal());
  }

  template <std::size_t Count>
  void list(std::string_view name, const std::array<double, Count>& values) {
    out_.name(name);
    out_.begin_array();
    for (const double each : values) number(each);
    out_.end_array();
  }

  void list(std::initializer_list<float> values) {
    out_.begin_array();
    for (const float each : values) number(each);
    out_.end_array();
  }

  void number(double value) {
    if (std::isfinite(value)) out_.number(value);
    else out_.text(std::isnan(value) ? "nan" : value > 0 ? "inf" : "-inf");
  }

  /// Lines are objects as packets hold them, after a type that nobody reads.
  void begin_line() { out_ = Outbox(), out_.begin(""); }
  void end_line(bool is_to_be_sent = true) {
    out_.end();
    if (!is_to_be_sent) return;
    const std::string_view packet = out_.waiting().substr(static_cast<std::size_t>(framing::header_bytes));
    constexpr std::string_view type = R"({"type":"",)";
    std::cout << '{' << packet.substr(type.size()) << std::endl;
  }

  const std::string axes_;
  const bool is_on_device_;
  cuda::Stream stream_ = nullptr;
  std::optional<Client> client_;
  std::thread reader_;
  std::atomic<bool> is_stopping_{false};
  std::mutex gate_;
  std::optional<Image> newest_;
  Json json_{limits::max_server_values};
  Outbox out_;
};

}  // namespace

int main(int count, char** arguments) {
  Adapter adapter(count > 1 ? arguments[1] : "opencv", count > 2 && arguments[2] == std::string_view("device"));
  adapter.greet();
  for (std::string line; std::getline(std::cin, line) && adapter.obey(std::move(line));) {
  }
  return 0;
}
