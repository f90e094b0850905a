#include "common/scoring/anatomy/anatomy.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/anatomy/inner_point.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/surface.h"
#include "common/profile/anchors.h"
#include "common/profile/layer_names.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/volume.h"
#include "common/scoring/anatomy/structure_region.h"

namespace needlelab {
namespace {

DepthSpan spanOfLayer(std::span<const double> layer_end_m, std::size_t layer) {
  return {layer == 0 ? 0 : layer_end_m[layer - 1],
          layer + 1 == layer_end_m.size() ? std::numeric_limits<double>::infinity() : layer_end_m[layer]};
}

// ---- in a volume ----

/// A compiled volume with its spec, in W.
struct PlacedVolume {
  FieldSpec spec;
  std::shared_ptr<const FieldBody> body;
  Pose X_WL;

  [[nodiscard]] std::optional<StructureIndex> indexOf(const std::string& id) const {
    const auto found = std::ranges::find(spec.structures, id, &FieldStructure::id);
    if (found == spec.structures.end()) return std::nullopt;
    return static_cast<StructureIndex>(found - spec.structures.begin());
  }
  /// Null if there is no structure with that id.
  [[nodiscard]] std::shared_ptr<const StructureRegion> structure(const std::string& id) const {
    const auto index = indexOf(id);
    return index ? std::make_shared<StructureRegion>(body, StructureMask{1} << *index, X_WL) : nullptr;
  }
  /// The structure with that id, and its point `aim_m` in L; without one, its deepest point.
  [[nodiscard]] Region region(const std::string& name, const std::string& id,
                              std::optional<Vec3> aim_m = std::nullopt) const {
    Region made{name, X_WL.p, X_WL.p, 0, structure(id)};
    if (made.structure == nullptr) return made;  // never from parseProfile
    if (aim_m) {
      made.a_W_m = made.b_W_m = X_WL * *aim_m;
      made.radius_m = std::max(0.0, -made.structure->distance(made.a_W_m));
    } else if (const auto inner = innerPoint(spec, body->field(), *indexOf(id))) {
      made.a_W_m = made.b_W_m = X_WL * inner->at_m;
      made.radius_m = inner->clearance_m;
    }
    return made;
  }
};

std::optional<PlacedVolume> placedVolume(const pb::Profile& profile, const Pose& X_WL) {
  if (!profile.has_volume()) return std::nullopt;
  auto field = fieldOf(profile.volume());
  if (!field.ok()) return std::nullopt;
  return PlacedVolume{fieldSpecOf(profile.volume()), std::make_shared<FieldBody>(*std::move(field)), X_WL};
}

/// Where a line through a target is in it.
struct Way {
  Vec3 outer_W_m, inner_W_m;  ///< the ends; the same if the line is nowhere in it
};

/// The finest steps along a line, and how exactly its ends are found.
constexpr double kLineStep_m = 1e-4, kEnd_m = 1e-7;
constexpr int kMostLineSteps = 400;

/// The place between `in_m`, where `distance` is at most 0, and `out_m`, where it may be above 0.
template <class Distance>
double endBetween(double in_m, double out_m, const Distance& distance) {
  if (distance(out_m) <= 0) return out_m;
  while (std::fabs(out_m - in_m) > kEnd_m) {
    const double middle_m = 0.5 * (in_m + out_m);
    (distance(middle_m) <= 0 ? in_m : out_m) = middle_m;
  }
  return in_m;
}

/// The part in the target of the line through its centre along the unit vector `in`.
Way wayThrough(const Target& target, Vec3 in) {
  const Vec3 center = target.ball.a_W_m;
  const auto at = [&](double t_m) { return center + in * t_m; };
  const double radius_m = target.ball.radius_m;
  if (target.ball.structure != nullptr) {
    const auto distance = [&](double t_m) { return target.ball.structure->distance(at(t_m)); };
    if (distance(0) > 0) return {center, center};
    const auto endTo = [&](double side) {
      double t_m = 0, next_m = 0;
      for (double here_m = distance(0); here_m <= 0 && next_m < 1; here_m = distance(side * next_m)) {
        t_m = next_m;
        next_m += std::max(-here_m / 2, kLineStep_m);
      }
      return endBetween(side * t_m, side * next_m, distance);
    };
    return {at(endTo(-1)), at(endTo(1))};
  }
  if (target.tissue_region == nullptr) return {at(-radius_m), at(radius_m)};
  const auto distance = [&](double t_m) { return target.tissue_region->distance(at(t_m)); };
  const double step_m = std::max(kLineStep_m, 2 * radius_m / kMostLineSteps);
  const auto endFrom = [&](double side) -> std::optional<double> {
    for (int i = 0; i * step_m <= 2 * radius_m; ++i) {
      const double t_m = side * (radius_m - i * step_m);
      if (distance(t_m) <= 0) return i == 0 ? t_m : endBetween(t_m, t_m + side * step_m, distance);
    }
    return std::nullopt;
  };
  const auto outer_m = endFrom(-1), inner_m = endFrom(1);
  if (!outer_m || !inner_m) return {center, center};
  return {at(*outer_m), at(*inner_m)};
}

bool isVolume(const Anatomy& anatomy) {
  return std::holds_alternative<BodyLimb>(anatomy.limb);
}

}  // namespace

Anatomy anatomyOf(const pb::Profile& profile, const Pose& X_WL) {
  const Pose X{X_WL.p, normalized(X_WL.q)};
  Anatomy anatomy;
  const std::optional<PlacedVolume> volume = placedVolume(profile, X);
  if (volume) {
    anatomy.has_limb = true;
    anatomy.limb = BodyLimb{volume->body, X};
  } else {
    const auto limb = unitLimbOf(profile);
    anatomy.has_limb = limb.ok();
    if (limb.ok()) anatomy.limb = *limb;
    anatomy.limb = placed(anatomy.limb, X);
  }
  double depth_m = 0;
  for (const pb::Layer& layer : profile.layers())
    anatomy.layer_end_m.push_back(depth_m += layer.thickness_m());
  const std::vector<std::string> names = layerNames(profile);
  const AnchoredPlaces places(profile);
  for (const auto& target : profile.targets()) {
    if (volume && target.has_structure()) {
      const auto aim = target.has_center_m() ? std::optional(vectorOf(target.center_m())) : std::nullopt;
      anatomy.targets.push_back({volume->region(target.name(), target.structure(), aim), {}});
      continue;
    }
    const Vec3 center = X * (vectorOf(target.center_m()) + places.wayOf(target));
    Target made{{target.name(), center, center, target.radius_m()}, {}};
    StructureMask structures = 0;
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (std::ranges::find(target.tissues(), names[i]) == target.tissues().end()) continue;
      if (volume)
        structures |= StructureMask{1} << i;
      else
        made.tissues.push_back(spanOfLayer(anatomy.layer_end_m, i));
    }
    if (structures != 0) made.tissue_region = std::make_shared<StructureRegion>(volume->body, structures, X);
    anatomy.targets.push_back(std::move(made));
  }
  for (const auto& hazard : profile.hazards()) {
    if (volume && hazard.has_structure()) {
      anatomy.hazards.push_back(volume->region(hazard.name(), hazard.structure()));
      continue;
    }
    const bool is_ball = hazard.has_center_m();
    const Vec3 way = places.wayOf(hazard);
    const Vec3 a = X * (vectorOf(is_ball ? hazard.center_m() : hazard.a_m()) + way);
    const Vec3 b = is_ball ? a : X * (vectorOf(hazard.b_m()) + way);
    anatomy.hazards.push_back({hazard.name(), a, b, hazard.radius_m()});
  }
  if (volume && profile.palpation().has_landmark())
    anatomy.landmark = volume->structure(profile.palpation().landmark());
  return anatomy;
}

double depthAt(const Anatomy& anatomy, Vec3 p_W_m) {
  return anatomy.has_limb ? depthBelowSkin(anatomy.limb, p_W_m) : 0;
}

bool isUnderSkin(const Anatomy& anatomy, Vec3 p_W_m) {
  return anatomy.has_limb && signedDepth(anatomy.limb, p_W_m) > 0;
}

int layerAtDepth(std::span<const double> layer_end_m, double depth_m) {
  if (!(depth_m > 0) || layer_end_m.empty()) return -1;
  const auto end = std::upper_bound(layer_end_m.begin(), layer_end_m.end() - 1, depth_m);
  return static_cast<int>(end - layer_end_m.begin());
}

int layerAt(const Limb& limb_W, std::span<const double> layer_end_m, Vec3 p_W_m) {
  const auto* const volume = std::get_if<BodyLimb>(&limb_W);
  if (volume == nullptr) return layerAtDepth(layer_end_m, signedDepth(limb_W, p_W_m));
  const StructureIndex structure = volume->body->structureAt(inverse(volume->X_WL) * p_W_m);
  return structure == kOutside ? -1 : structure;
}

int layerAt(const Anatomy& anatomy, Vec3 p_W_m) {
  return anatomy.has_limb ? layerAt(anatomy.limb, anatomy.layer_end_m, p_W_m) : -1;
}

double distanceTo(const Anatomy& anatomy, const Target& target, Vec3 p_W_m) {
  const double from_ball_m = distanceTo(target.ball, p_W_m);
  if (target.tissue_region != nullptr) return std::max(from_ball_m, target.tissue_region->distance(p_W_m));
  if (target.tissues.empty()) return from_ball_m;
  const double depth_m = depthAt(anatomy, p_W_m);
  double from_tissue_m = std::numeric_limits<double>::infinity();
  for (const DepthSpan& tissue : target.tissues)
    from_tissue_m = std::min(from_tissue_m, std::max(tissue.top_m - depth_m, depth_m - tissue.bottom_m));
  return std::max(from_ball_m, from_tissue_m);
}

DepthSpan depthSpanOf(const Anatomy& anatomy, const Target& target) {
  if (isVolume(anatomy)) {
    const Way way = wayThrough(target, -surfaceNormal(anatomy.limb, target.ball.a_W_m, {0, 0, -1}));
    return {depthAt(anatomy, way.outer_W_m), depthAt(anatomy, way.inner_W_m)};
  }
  const double at_m = depthAt(anatomy, target.ball.a_W_m);
  DepthSpan span{at_m - target.ball.radius_m, at_m + target.ball.radius_m};
  if (target.tissues.empty()) return span;
  return {std::max(span.top_m, target.tissues.front().top_m),
          std::min(span.bottom_m, target.tissues.back().bottom_m)};
}

Vec3 tipForTarget(const Anatomy& anatomy, const Target& target, double opening_behind_tip_m,
                  std::optional<Vec3> entry_W_m) {
  const Vec3 center = target.ball.a_W_m;
  if (!anatomy.has_limb) return center;
  const Vec3 n = surfaceNormal(anatomy.limb, center, {0, 0, -1});
  Vec3 middle;
  double length_m = 0;
  if (isVolume(anatomy)) {
    const Way way = wayThrough(target, entry_W_m ? normalized(center - *entry_W_m) : -n);
    middle = 0.5 * (way.outer_W_m + way.inner_W_m);
    length_m = norm(way.inner_W_m - way.outer_W_m);
  } else {
    const DepthSpan span = depthSpanOf(anatomy, target);
    middle = center + n * (depthAt(anatomy, center) - 0.5 * (span.top_m + span.bottom_m));
    length_m = span.bottom_m - span.top_m;
  }
  const Vec3 back = entry_W_m ? normalized(*entry_W_m - middle) : n;
  const bool both_fit = opening_behind_tip_m < length_m;
  return middle - back * (both_fit ? 0.5 * opening_behind_tip_m : opening_behind_tip_m);
}

double segmentDistance(Vec3 p, Vec3 q, Vec3 a, Vec3 b) {
  const auto share = [](double numerator, double denominator) {
    return denominator > 0 ? std::clamp(numerator / denominator, 0.0, 1.0) : 0.0;
  };
  const Vec3 d = q - p, e = b - a, r = p - a;
  const double dd = dot(d, d), ee = dot(e, e), de = dot(d, e), dr = dot(d, r), er = dot(e, r);
  // the first line's nearest point to the second line, clamped to its segment; then to the second line and
  // back once, clamped each time
  double s = share(de * er - ee * dr, dd * ee - de * de);
  const double t = share(er + s * de, ee);
  s = share(t * de - dr, dd);
  return norm(r + s * d - t * e);
}

double distanceTo(const Region& region, Vec3 p_W_m) {
  if (region.structure != nullptr) return region.structure->distance(p_W_m);
  return segmentDistance(p_W_m, p_W_m, region.a_W_m, region.b_W_m) - region.radius_m;
}

double distanceTo(const Region& region, Vec3 tip_W_m, Vec3 skin_W_m) {
  if (region.structure != nullptr) return region.structure->distanceFromShaft(tip_W_m, skin_W_m);
  return segmentDistance(tip_W_m, skin_W_m, region.a_W_m, region.b_W_m) - region.radius_m;
}

}  // namespace needlelab
