// SPDX-License-Identifier: MIT
// Takes replies and telemetry out of payloads; what breaks a rule is told in `wrong`.
#pragma once

#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "splatbus/protocol/frames.hpp"
#include "splatbus/lens.hpp"

namespace splatbus {
namespace replies {

inline ViewportSize read_size(Value message, Wrong& wrong) {
  ViewportSize size;
  const auto sides = Part(message, "", wrong).member("viewport_size", "REQ-3").items(2, 2, "REQ-3");
  for (std::size_t i = 0; i < sides.size(); ++i) size.viewport_size[i] = sides[i].integer(0, limits::max_image_size, "REQ-3");
  return size;
}

inline Camera read_camera(Value message, Wrong& wrong) {
  Camera camera;
  if (!frames::read_pose(message, camera.position, camera.rotation)) Part(message, "", wrong).broken("has no pose", "REQ-5");
  Wrong of_the_lens;  // one that is none does not make the pose worse
  const Part lens = Part(message, "", of_the_lens).optional("intrinsics");
  if (!lens.is_there()) return camera;
  const Intrinsics found = read_lens(lens);
  if (of_the_lens.empty()) camera.intrinsics = found;
  return camera;
}

inline Pong read_pong(Value message, Wrong& wrong) {
  const Part root(message, "", wrong);
  Pong pong;
  pong.t = root.member("t", "PNG-2").number("PNG-2");
  pong.serverTime = root.member("serverTime", "PNG-2").number("PNG-2");
  return pong;
}

inline SceneObject read_scene_object(const Part& part) {
  constexpr std::string_view rule = "SCN-2";
  SceneObject object;
  object.id = part.member("id", rule).text(1, limits::max_tag_chars, rule);
  object.name = part.member("name", rule).text(0, limits::max_name_chars, rule);
  object.gaussians = part.member("gaussians", rule).integer(0, limits::max_safe_integer, rule);
  const Part box = part.member("bounds", rule);
  if (box.is_there() && box.value()->is_null()) return object;
  Bounds bounds;
  bounds.min = box.member("min", rule).vector<3>(rule);
  bounds.max = box.member("max", rule).vector<3>(rule);
  for (std::size_t i = 0; i < 3; ++i) {
    if (bounds.min[i] > bounds.max[i]) box.broken("ends before it begins", rule);
  }
  object.bounds = bounds;
  return object;
}

inline Scene read_scene(Value message, Wrong& wrong) {
  constexpr std::string_view rule = "SCN-2";
  const Part root(message, "", wrong);
  Scene scene;
  std::set<std::string> ids;
  for (const Part& each : root.member("objects", rule).items(1, limits::max_objects, rule)) {
    scene.objects.push_back(read_scene_object(each));
    if (!ids.insert(scene.objects.back().id).second) each.broken("has the id of another", rule);
  }
  if (ids.count("default") == 0) root.broken("has no object \"default\"", rule);
  const Part range = root.member("timeRange", rule);
  if (range.is_there() && !range.value()->is_null()) {
    scene.timeRange = range.vector<2>(rule);
    if ((*scene.timeRange)[0] > (*scene.timeRange)[1]) range.broken("ends before it begins", rule);
  }
  scene.cameras = root.member("cameras", rule).integer(0, limits::max_safe_integer, rule);
  scene.origin = root.member("origin", rule).vector<3>(rule);
  return scene;
}

inline HistogramSeries read_histogram(const Part& part) {
  constexpr std::string_view rule = "TEL-2";
  HistogramSeries histogram;
  for (const Part& each : part.member("edges", rule).items(2, limits::max_edges, rule)) {
    histogram.edges.push_back(each.number(rule));
    const std::size_t count = histogram.edges.size();
    if (count > 1 && histogram.edges[count - 1] <= histogram.edges[count - 2]) each.broken("is not greater than the one before", rule);
  }
  const auto bins = static_cast<std::int64_t>(histogram.edges.size()) - 1;
  for (const Part& each : part.member("counts", rule).items(bins, bins, rule)) {
    histogram.counts.push_back(each.integer(0, limits::max_safe_integer, rule));
  }
  return histogram;
}

/// A series of a kind that is not known is left out [TEL-6].
inline Telemetry read_telemetry(Value message, Wrong& wrong) {
  constexpr std::string_view rule = "TEL-2";
  const Part root(message, "", wrong);
  Telemetry telemetry;
  telemetry.seq = root.member("seq", rule).integer(0, limits::max_safe_integer, rule);
  telemetry.time = root.member("time", rule).number(rule);
  for (const Part& each : root.member("series", rule).items(1, limits::max_series, rule)) {
    const std::string name = each.member("name", rule).text(1, limits::max_name_chars, rule);
    const Part kind = each.member("kind", rule);
    if (kind.is(SeriesKind::scalar)) {
      ScalarSeries scalar;
      scalar.name = name;
      scalar.value = each.member("value", rule).number(rule);
      if (const Part unit = each.optional("unit"); unit.is_there()) scalar.unit = unit.text(0, limits::max_name_chars, rule);
      telemetry.series.push_back(std::move(scalar));
    } else if (kind.is(SeriesKind::text)) {
      TextSeries text;
      text.name = name;
      text.value = each.member("value", rule).text(0, limits::max_text_chars, rule);
      telemetry.series.push_back(std::move(text));
    } else if (kind.is(SeriesKind::histogram)) {
      HistogramSeries histogram = read_histogram(each);
      histogram.name = name;
      telemetry.series.push_back(std::move(histogram));
    }
  }
  return telemetry;
}

}  // namespace replies
}  // namespace splatbus
