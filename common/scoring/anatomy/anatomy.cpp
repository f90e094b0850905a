
#include "common/scoring/anatomy/anatomy.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "common/haptics/scene_model.h"
#include "common/haptics/surface.h"
#include "common/profile/anchors.h"
#include "common/profile/layer_names.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

DepthSpan spanOfLayer(std::span<const double> layer_end_m, std::size_t layer) {
  return {layer == 0 ? 0 : layer_end_m[layer - 1],
          layer + 1 == layer_end_m.size() ? std::numeric_limits<double>::infinity() : layer_end_m[layer]};
}

}  // namespace

Anatomy anatomyOf(const pb::Profile& profile, const Pose& X_WL) {
  const Pose X{X_WL.p, normalized(X_WL.q)};
  Anatomy anatomy;
  const auto limb = unitLimbOf(profile.limb());
  anatomy.has_limb = limb.ok();
  if (limb.ok()) anatomy.limb = *limb;
  anatomy.limb = placed(anatomy.limb, X);
  double depth_m = 0;
  for (const pb::Layer& layer : profile.layers())
    anatomy.layer_end_m.push_back(depth_m += layer.thickness_m());
  const std::vector<std::string> names = layerNames(profile);
  const AnchoredPlaces places(profile);
  for (const auto& target : profile.targets()) {
    const Vec3 center = X * (vectorOf(target.center_m()) + places.wayOf(target));
    Target made{{target.name(), center, center, target.radius_m()}, {}};
    for (std::size_t i = 0; i < names.size(); ++i)
      if (std::ranges::find(target.tissues(), names[i]) != target.tissues().end())
        made.tissues.push_back(spanOfLayer(anatomy.layer_end_m, i));
    anatomy.targets.push_back(std::move(made));
  }
  for (const auto& hazard : profile.hazards()) {
    const bool is_ball = hazard.has_center_m();
    const Vec3 way = places.wayOf(hazard);
    const Vec3 a = X * (vectorOf(is_ball ? hazard.center_m() : hazard.a_m()) + way);
    const Vec3 b = is_ball ? a : X * (vectorOf(hazard.b_m()) + way);
    anatomy.hazards.push_back({hazard.name(), a, b, hazard.radius_m()});
  }
  return anatomy;
}

double depthAt(const Anatomy& anatomy, Vec3 p_W_m) {
  return anatomy.has_limb ? signedDepth(anatomy.limb, p_W_m) : 0;
}

int layerAtDepth(std::span<const double> layer_end_m, double depth_m) {
  if (!(depth_m > 0) || layer_end_m.empty()) return -1;
  const auto end = std::upper_bound(layer_end_m.begin(), layer_end_m.end() - 1, depth_m);
  return static_cast<int>(end - layer_end_m.begin());
}

int layerAt(const Anatomy& anatomy, Vec3 p_W_m) {
  return layerAtDepth(anatomy.layer_end_m, depthAt(anatomy, p_W_m));
}

double distanceTo(const Anatomy& anatomy, const Target& target, Vec3 p_W_m) {
  const double from_ball_m = distanceTo(target.ball, p_W_m);
  if (target.tissues.empty()) return from_ball_m;
  const double depth_m = depthAt(anatomy, p_W_m);
  double from_tissue_m = std::numeric_limits<double>::infinity();
  for (const DepthSpan& tissue : target.tissues)
    from_tissue_m = std::min(from_tissue_m, std::max(tissue.top_m - depth_m, depth_m - tissue.bottom_m));
  return std::max(from_ball_m, from_tissue_m);
}

DepthSpan depthSpanOf(const Anatomy& anatomy, const Target& target) {
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
  const DepthSpan span = depthSpanOf(anatomy, target);
  const Vec3 n = surfaceNormal(anatomy.limb, center, {0, 0, -1});
  const Vec3 middle = center + n * (depthAt(anatomy, center) - 0.5 * (span.top_m + span.bottom_m));
  const Vec3 back = entry_W_m ? normalized(*entry_W_m - middle) : n;
  const bool both_fit = opening_behind_tip_m < span.bottom_m - span.top_m;
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
  return segmentDistance(p_W_m, p_W_m, region.a_W_m, region.b_W_m) - region.radius_m;
}

double distanceTo(const Region& region, Vec3 tip_W_m, Vec3 skin_W_m) {
  return segmentDistance(tip_W_m, skin_W_m, region.a_W_m, region.b_W_m) - region.radius_m;
}

}  // namespace needlelab
