#include "common/scoring/syringe_events.h"

#include <algorithm>
#include <cmath>

#include "common/haptics/limits.h"
#include "common/haptics/scene_model.h"
#include "common/profile/needle.h"
#include "common/scoring/anatomy.h"
#include "common/scoring/strokes.h"
#include "common/scoring/track.h"

namespace needlelab {
namespace {

/// What places are told by.
struct Surroundings {
  Anatomy anatomy;
  std::vector<double> layer_end_m;  // under the surface; the last layer has no end
  std::vector<std::string> tissues;
  double opening_behind_tip_m = 0;
};

Surroundings surroundingsOf(const pb::Profile& profile, const Pose& X_WL) {
  Surroundings all{anatomyOf(profile, X_WL), {}, {}, openingBehindTip_m(needleOf(profile.needle()))};
  double depth_m = 0;
  for (const pb::Layer& layer : profile.layers()) {
    depth_m += layer.thickness_m();
    all.layer_end_m.push_back(depth_m);
    all.tissues.push_back(pb::Layer::Tissue_Name(layer.tissue()));
  }
  return all;
}

Vec3 openingOf(const Surroundings& around, const GestureSample& s) {
  const Vec3 tip{s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]};
  if (around.opening_behind_tip_m == 0) return tip;
  const Vec3 axis = zAxis(normalized(Quat{s.q_WT[0], s.q_WT[1], s.q_WT[2], s.q_WT[3]}));
  return tip - around.opening_behind_tip_m * axis;
}

double depthOf(const Surroundings& around, Vec3 p_W_m) {
  return around.anatomy.has_limb ? signedDepth(around.anatomy.limb, p_W_m) : 0;
}

bool isInTissue(const Surroundings& around, const GestureSample& sample, Vec3 opening_W_m) {
  return isInside(sample) && depthOf(around, opening_W_m) > 0;
}

bool isInTarget(const Surroundings& around, Vec3 p_W_m) {
  return std::any_of(around.anatomy.targets.begin(), around.anatomy.targets.end(),
                     [&](const Region& target) { return distanceTo(target, p_W_m) <= 0; });
}

pb::SyringePlace placeOf(const Surroundings& around, const GestureSample& sample) {
  const Vec3 p = openingOf(around, sample);
  pb::SyringePlace place;
  place.set_x_m(p.x);
  place.set_y_m(p.y);
  place.set_z_m(p.z);
  place.set_depth_m(depthOf(around, p));
  place.set_layer(-1);
  if (isInTissue(around, sample, p)) {
    place.set_in_tissue(true);
    place.set_insertion_m(std::max(0.0, sample.insertion_m - around.opening_behind_tip_m));
    const auto end = std::upper_bound(around.layer_end_m.begin(), around.layer_end_m.end(), place.depth_m());
    if (!around.tissues.empty()) {
      const auto layer = std::min<std::size_t>(static_cast<std::size_t>(end - around.layer_end_m.begin()),
                                               around.tissues.size() - 1);
      place.set_layer(static_cast<std::int32_t>(layer));
      place.set_tissue(around.tissues[layer]);
    }
  }
  const Region* nearest = nullptr;
  for (const Region& target : around.anatomy.targets) {
    const double distance = distanceTo(target, p);
    if (nearest != nullptr && distance >= place.target_distance_m()) continue;
    nearest = &target;
    place.set_target_distance_m(distance);
  }
  if (nearest != nullptr) place.set_target(nearest->name);
  for (const Region& hazard : around.anatomy.hazards) {
    if (distanceTo(hazard, p) > 0) continue;
    place.set_hazard(hazard.name);
    break;
  }
  return place;
}

/// Shares of the stroke, by how far the plunger went in each tick, and the hazards on the way.
void addShares(const Surroundings& around, std::span<const GestureSample> samples, const Stroke& stroke,
               pb::SyringeEvent& event) {
  const double sign = stroke.to < stroke.from ? -1 : 1;
  double all = 0, in_tissue = 0, in_target = 0;
  std::vector<bool> met(around.anatomy.hazards.size(), false);
  for (std::size_t i = stroke.first; i <= stroke.last; ++i) {
    // half of the way from the sample before and half of the way to the next belong to this one
    const auto step = [&](std::size_t a, std::size_t b) {
      const bool known = hasPlunger(samples[a]) && hasPlunger(samples[b]);
      return known ? 0.5 * sign * (samples[b].plunger - samples[a].plunger) : 0.0;
    };
    const double way = (i > stroke.first ? step(i - 1, i) : 0) + (i < stroke.last ? step(i, i + 1) : 0);
    const Vec3 p = openingOf(around, samples[i]);
    all += way;
    if (isInTissue(around, samples[i], p)) in_tissue += way;
    if (isInTarget(around, p)) in_target += way;
    for (std::size_t h = 0; h < met.size(); ++h)
      if (!met[h] && distanceTo(around.anatomy.hazards[h], p) <= 0) met[h] = true;
  }
  if (all > 0) {
    event.set_in_tissue_share(std::clamp(in_tissue / all, 0.0, 1.0));
    event.set_in_target_share(std::clamp(in_target / all, 0.0, 1.0));
  }
  for (std::size_t h = 0; h < met.size(); ++h)
    if (met[h]) event.add_hazards(around.anatomy.hazards[h].name);
}

}  // namespace

std::vector<pb::SyringeEvent> syringeEvents(std::span<const GestureSample> given, double rate_hz,
                                            const pb::Profile& profile, const Pose& X_WL) {
  if (!(rate_hz >= kMinRateHz && rate_hz <= kMaxRateHz)) return {};
  std::vector<GestureSample> storage;
  const std::span<const GestureSample> samples = cleaned(given, storage);
  const Surroundings around = surroundingsOf(profile, X_WL);
  std::vector<pb::SyringeEvent> events;
  for (const Stroke& stroke : strokesOf(samples, rate_hz)) {
    const GestureSample &first = samples[stroke.first], &last = samples[stroke.last];
    pb::SyringeEvent& event = events.emplace_back();
    event.set_kind(stroke.to < stroke.from ? pb::SyringeEvent::ASPIRATION : pb::SyringeEvent::INJECTION);
    event.set_begin_tick(first.tick);
    event.set_end_tick(last.tick);
    event.set_begin_s(secondsBetween(samples.front(), first, rate_hz));
    event.set_end_s(secondsBetween(samples.front(), last, rate_hz));
    event.set_plunger_from(stroke.from);
    event.set_plunger_to(stroke.to);
    *event.mutable_begin() = placeOf(around, first);
    *event.mutable_end() = placeOf(around, last);
    addShares(around, samples, stroke, event);
  }
  return events;
}

}  // namespace needlelab
