// SPDX-License-Identifier: MIT
// Takes a `frame` out of a payload into one that is used again: nothing is allocated but for names that are longer than before.
#pragma once

#include <optional>
#include <string_view>

#include "splatbus/text/json.hpp"
#include "splatbus/pose.hpp"

namespace splatbus {
namespace frames {

/// What names the image and its place [IMG-15].
inline bool read_place(Value message, std::int64_t& generation, std::int64_t& seq, std::int64_t& slot) {
  const auto read = [&](std::string_view name, std::int64_t& to) {
    const auto member = message.member(name);
    const auto found = member ? member->integer() : std::nullopt;
    to = found.value_or(0);
    return found.has_value();
  };
  return read("generation", generation) && read("seq", seq) && read("slot", slot);
}

inline bool read_number(Value of, std::string_view name, double& to) {
  const auto member = of.member(name);
  to = member ? member->number() : 0;
  return member && member->is_number();
}

/// A pose in arrays, as POS-2 and POS-3 say.
inline bool read_pose(Value of, std::array<double, 3>& position, std::array<double, 4>& rotation) {
  const auto p = of.member("position"), q = of.member("rotation");
  return p && p->numbers(position) && q && q->numbers(rotation) && why_not(Pose{position, rotation}) == nullptr;
}

/// What breaks a rule, or null.
inline const char* read_camera(Value camera, const Meta& meta, FrameCamera& to) {
  if (!read_pose(camera, to.position, to.rotation)) return "a frame whose camera has no pose [IMG-1, POS-2, POS-3]";
  const bool has_lens = read_number(camera, "fx", to.fx) && read_number(camera, "fy", to.fy) && read_number(camera, "cx", to.cx) &&
                        read_number(camera, "cy", to.cy) && to.fx > 0 && to.fy > 0;
  if (!has_lens) return "a frame whose camera has no lens [IMG-1]";
  const bool has_planes = read_number(camera, "near", to.near_) && read_number(camera, "far", to.far_) && to.near_ > 0 && to.near_ < to.far_;
  if (!has_planes) return "a frame whose camera has no clipping planes [IMG-1]";
  const auto width = camera.member("width"), height = camera.member("height");
  if (!width || !height || width->integer() != meta.w || height->integer() != meta.h) {
    return "a frame whose camera has another size than the init packet [IMG-1]";
  }
  to.width = meta.w;
  to.height = meta.h;
  const auto tag = camera.member("tag");
  if (!tag) {
    to.tag.reset();
    return nullptr;
  }
  if (!tag->is_string()) return "a frame whose tag is no string [CAM-3]";
  if (!to.tag) to.tag.emplace();
  to.tag->assign(tag->text());
  return nullptr;
}

/// What breaks a rule, or null.
inline const char* read_objects(Value objects, std::vector<Placement>& to) {
  if (objects.kind() != Json::Kind::array || objects.count() > static_cast<std::size_t>(limits::max_objects)) {
    return "a frame whose objects are no array of at most 256 [OBJ-7]";
  }
  to.resize(objects.count());
  std::size_t at = 0;
  for (const Value each : objects) {
    Placement& placement = to[at];
    const auto name = each.member("object");
    if (!name || !name->is_string()) return "a frame with an object without a name [OBJ-7]";
    if (!read_pose(each, placement.position, placement.rotation)) return "a frame with an object without a pose [OBJ-7]";
    if (!read_number(each, "scale", placement.scale) || placement.scale <= 0) return "a frame with an object without a scale [OBJ-7]";
    placement.object.assign(name->text());
    for (std::size_t other = 0; other < at; ++other) {
      if (to[other].object == placement.object) return "a frame that names an object twice [OBJ-7]";
    }
    ++at;
  }
  return nullptr;
}

/// Fill in all but the place. What breaks a rule, or null.
inline const char* read(Value message, const Meta& meta, Frame& to) {
  if (!read_number(message, "time", to.time) || !read_number(message, "renderedAt", to.renderedAt)) {
    return "a frame without time or renderedAt [IMG-1]";
  }
  const auto camera = message.member("camera");
  if (!camera) return "a frame without camera [IMG-1]";
  if (const char* wrong = read_camera(*camera, meta, to.camera)) return wrong;
  const auto objects = message.member("objects");
  if (!to.objects) to.objects.emplace();
  if (objects) return read_objects(*objects, *to.objects);
  to.objects->clear();
  return nullptr;
}

}  // namespace frames
}  // namespace splatbus
