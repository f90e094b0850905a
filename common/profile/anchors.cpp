#include "common/profile/anchors.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "common/base/text/text.h"
#include "common/haptics/scene_model.h"
#include "common/profile/layer_names.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/strict_json.h"

namespace needlelab {
namespace {

/// Shorter moves are rounding errors: the place then stays unchanged, bit for bit.
constexpr double kSamePlace_m = 1e-12;
constexpr Vec3 kIntoTheBody{0, 0, -1};

Vec3 placeOf(const pb::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

template <typename Regions>
Status checkLayers(const Regions& regions, const std::vector<std::string>& names, std::string_view list) {
  for (int i = 0; i < regions.size(); ++i) {
    if (!regions[i].has_anchor()) continue;
    const std::string& layer = regions[i].anchor().layer();
    if (std::ranges::find(names, layer) == names.end())
      return fieldError(
          fmt::format("{}[{}].anchor.layer", list, i),
          fmt::format("{} is not the name of a layer: {}", quotedText(layer), fmt::join(names, ", ")));
  }
  return {};
}

}  // namespace

AnchoredPlaces::AnchoredPlaces(const pb::Profile& profile) : names_(layerNames(profile)) {
  const auto limb = unitLimbOf(profile.limb());
  has_limb_ = limb.ok();
  if (has_limb_) limb_ = *limb;
  double depth_m = 0;
  for (const pb::Layer& layer : profile.layers()) {
    tops_m_.push_back(depth_m);
    depth_m += layer.thickness_m();
  }
}

Vec3 AnchoredPlaces::wayOf(Vec3 center_m, const pb::Anchor& anchor) const {
  const auto layer = std::ranges::find(names_, anchor.layer());
  if (layer == names_.end() || !has_limb_) return {};
  const double top_m = tops_m_[static_cast<std::size_t>(layer - names_.begin())];
  const double up_m = signedDepth(limb_, center_m) - (top_m + anchor.offset_m());
  return std::abs(up_m) <= kSamePlace_m ? Vec3{} : up_m * surfaceNormal(limb_, center_m, kIntoTheBody);
}

Vec3 AnchoredPlaces::wayOf(const pb::Target& target) const {
  return target.has_anchor() ? wayOf(placeOf(target.center_m()), target.anchor()) : Vec3{};
}

Vec3 AnchoredPlaces::wayOf(const pb::Hazard& hazard) const {
  if (!hazard.has_anchor()) return {};
  return wayOf(hazard.has_center_m() ? placeOf(hazard.center_m())
                                     : 0.5 * (placeOf(hazard.a_m()) + placeOf(hazard.b_m())),
               hazard.anchor());
}

Status checkAnchors(const pb::Profile& profile) {
  const std::vector<std::string> names = layerNames(profile);
  RETURN_IF_ERROR(checkLayers(profile.targets(), names, "targets"));
  return checkLayers(profile.hazards(), names, "hazards");
}

}  // namespace needlelab
