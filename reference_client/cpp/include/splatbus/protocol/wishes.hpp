// SPDX-License-Identifier: MIT
// What the user wants to be in force on the message channel, the newest of each kind, and which of it
// this connection has said: it is said again on the next one [CTL-6, POS-7].
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "splatbus/lens.hpp"
#include "splatbus/protocol/negotiation.hpp"
#include "splatbus/pose.hpp"

namespace splatbus {

class Wishes {
 public:
  void camera(const Pose& pose, const Intrinsics* lens, std::string_view tag) {
    has_camera_ = true;
    camera_said_ = false;
    camera_ = pose;
    has_lens_ = lens != nullptr;
    if (has_lens_) lens_ = *lens;
    tag_.assign(tag);
  }

  void object(std::string_view id, const Pose& pose, double scale) {
    auto at = objects_.find(id);
    if (at == objects_.end()) at = objects_.emplace(std::string(id), Thing{}).first;
    at->second = {pose, scale, false};
  }

  void time(double seconds) {
    time_ = seconds;
    time_said_ = false;
  }

  /// Of the series; nothing for all.
  void telemetry(std::optional<std::vector<std::string>> names) {
    has_series_ = true;
    series_said_ = false;
    series_ = std::move(names);
  }

  /// Nothing has been said: the connection is new.
  void unsay() {
    camera_said_ = time_said_ = series_said_ = false;
    for (auto& each : objects_) each.second.said = false;
  }

  /// Members of 1.1 may be said from now on: say the camera with them.
  void say_more() {
    if (has_lens_ || !tag_.empty()) camera_said_ = false;
  }

  /// Say what has not been said, as far as this server takes it.
  void say(Outbox& to, const std::optional<Welcome>& welcome) {
    if (has_camera_ && !camera_said_) say_camera(to, welcome);
    for (auto& [id, thing] : objects_) {
      if (!thing.said) thing.said = say_object(to, welcome, id, thing);
    }
    if (time_ && !time_said_ && negotiation::lists(welcome, Capability::time)) {
      to.begin(SetTime::type);
      to.member("time", *time_);
      to.end();
      time_said_ = true;
    }
    if (has_series_ && !series_said_ && negotiation::lists(welcome, Capability::telemetry)) say_series(to);
  }

 private:
  struct Thing {
    Pose pose;
    double scale = 1;
    bool said = false;
  };

  void say_camera(Outbox& to, const std::optional<Welcome>& welcome) {
    to.begin(CameraPose::type);
    write_pose(to, camera_);
    if (welcome && !tag_.empty()) to.member("tag", tag_);
    if (has_lens_ && negotiation::lists(welcome, Capability::intrinsics)) {
      to.name("intrinsics");
      write_lens(to, lens_);
    }
    to.end();
    camera_said_ = true;
  }

  /// A server without `objects` knows one, at scale 1 [OBJ-2].
  static bool say_object(Outbox& to, const std::optional<Welcome>& welcome, const std::string& id, const Thing& thing) {
    const bool has_many = negotiation::lists(welcome, Capability::objects);
    if (!has_many && (id != "default" || thing.scale != 1)) return false;
    to.begin(has_many ? ObjectPose::type : PointCloudPose::type);
    if (has_many) to.member("object", id);
    write_pose(to, thing.pose);
    if (thing.scale != 1) to.member("scale", thing.scale);
    to.end();
    return true;
  }

  void say_series(Outbox& to) {
    to.begin(SubscribeTelemetry::type);
    to.name("names");
    if (series_) to.texts(*series_);
    else to.null();
    to.end();
    series_said_ = true;
  }

  static void write_pose(Outbox& to, const Pose& pose) {
    to.name("position");
    to.begin_object();
    to.member("x", pose.position[0]);
    to.member("y", pose.position[1]);
    to.member("z", pose.position[2]);
    to.end_object();
    to.name("rotation");
    to.begin_object();
    to.member("x", pose.rotation[0]);
    to.member("y", pose.rotation[1]);
    to.member("z", pose.rotation[2]);
    to.member("w", pose.rotation[3]);
    to.end_object();
  }

  Pose camera_;
  Intrinsics lens_;
  std::string tag_;
  std::map<std::string, Thing, std::less<>> objects_;
  std::optional<double> time_;
  std::optional<std::vector<std::string>> series_;
  bool has_camera_ = false, has_lens_ = false, has_series_ = false;
  bool camera_said_ = false, time_said_ = false, series_said_ = false;
};

}  // namespace splatbus
