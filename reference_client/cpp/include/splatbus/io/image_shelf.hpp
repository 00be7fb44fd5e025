// SPDX-License-Identifier: MIT
// The memory that is open, and the one image of it that is lent: it waits there, a reader holds it, or
// the reader has given it back. Whoever calls holds the client's lock.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "splatbus/cuda/images.hpp"
#include "splatbus/io/host_memory.hpp"
#include "splatbus/protocol/ipc_session.hpp"

namespace splatbus {

class ImageShelf {
 public:
  const std::shared_ptr<ImageMemory>& current() const { return current_; }
  bool has_waiting() const { return image_ == Image::waiting; }

  /// Open what the session was told of, answer, and give up what was open before [OPN-5]. `why` not, if it must not or cannot be.
  void open(IpcSession& session, std::string& why) {
    settle(session);
    std::shared_ptr<ImageMemory> fresh;
    if (session.packet) {
      fresh = opened(session, why);
      if (fresh) session.memory_opened();
      else session.open_failed(why);
    }
    const auto former = std::exchange(current_, std::move(fresh));
    if (former) give_up(former->packet.generation, session);
  }

  /// An image is lent.
  void put() { image_ = Image::waiting; }

  /// Buffers of 1.0 tell of no image: who has read one is given the next, at most 60 times a second. Whether it was time.
  bool look(IpcSession& session, double at) {
    if (at < due()) return false;
    look_at_ = at + 1.0 / 60;
    session.look();
    put();
    return true;
  }
  /// When to look again; infinite where there is nothing to look at.
  double due() const {
    const bool may_look = current_ && current_->is_legacy() && image_ == Image::none;
    return may_look ? look_at_ : std::numeric_limits<double>::infinity();
  }

  /// The ticket of the image that waits; nothing where none does.
  std::optional<std::uint64_t> take() {
    if (image_ != Image::waiting) return std::nullopt;
    image_ = Image::held;
    return ++ticket_;
  }

  bool is_held(std::uint64_t ticket) const { return image_ == Image::held && ticket == ticket_; }

  /// A reader is done with it, and has let go of the memory.
  void give_back(std::uint64_t ticket) {
    if (is_held(ticket)) image_ = Image::read;
  }

  /// Say what readers have given back.
  void settle(IpcSession& session) {
    if (image_ != Image::read) return;
    image_ = Image::none;
    session.release();
    if (leaving_ != 0) session.memory_closed(std::exchange(leaving_, 0));
  }

  /// The connection is gone, and with it all that it lent [CHN-18].
  void clear() {
    image_ = Image::none;
    leaving_ = 0;
    current_.reset();
  }

 private:
  enum class Image { none, waiting, held, read };

  static std::shared_ptr<ImageMemory> opened(const IpcSession& session, std::string& why) {
    const InitPacket& packet = *session.packet;
    if (session.is_legacy()) return cuda::LegacyImages::open(packet, why);
    if (std::holds_alternative<CudaIpcMemory>(packet.memory)) return cuda::Images::open(packet, why);
    return HostMemory::open(packet, why);
  }

  void give_up(std::int64_t generation, IpcSession& session) {
    if (image_ == Image::waiting) {
      image_ = Image::none;
      session.release();
    }
    const bool is_read = image_ == Image::held && leaving_ == 0;
    if (is_read) leaving_ = generation;
    else session.memory_closed(generation);
  }

  std::shared_ptr<ImageMemory> current_;
  Image image_ = Image::none;
  std::int64_t leaving_ = 0;  ///< a generation that is given up as soon as its reader is done
  std::uint64_t ticket_ = 0;
  double look_at_ = 0;
};

}  // namespace splatbus
