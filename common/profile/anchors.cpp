#include "common/profile/anchors.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <variant>

#include "common/base/text/strict_json.h"
#include "common/base/text/text.h"
#include "common/haptics/scene_model.h"
#include "common/profile/layer_names.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

/// Shorter moves are rounding errors: the place then stays unchanged, bit for bit.
constexpr double kSamePlace_m = 1e-12;
constexpr Vec3 kIntoTheBody{0, 0, -1};

Vec3 middleOf(const pb::Target& target) {
  return vectorOf(target.center_m());
}
Vec3 middleOf(const pb::Hazard& hazard) {
  return hazard.has_center_m() ? vectorOf(hazard.center_m())
                               : 0.5 * (vectorOf(hazard.a_m()) + vectorOf(hazard.b_m()));
}

template <typename Regions>
Status checkAnchorsOf(const Regions& regions, const AnchoredPlaces& places,
                      const std::vector<std::string>& names, std::string_view list) {
  for (int i = 0; i < regions.size(); ++i) {
    if (!regions[i].has_anchor()) continue;
    const std::string& layer = regions[i].anchor().layer();
    if (std::ranges::find(names, layer) == names.end())
      return fieldError(
          fmt::format("{}[{}].anchor.layer", list, i),
          fmt::format("{} is not the name of a layer: {}", quotedText(layer), fmt::join(names, ", ")));
    if (!places.hasPlace(regions[i]))
      return fieldError(
          fmt::format("{}[{}].anchor.layer", list, i),
          fmt::format("a line straight in from the skin nearest to its place meets no {} within "
                      "{:g} mm: move it, or leave the anchor out",
                      quotedText(layer), 1e3 * AnchoredPlaces::kReach_m));
  }
  return {};
}

}  // namespace

AnchoredPlaces::AnchoredPlaces(const pb::Profile& profile) : names_(layerNames(profile)) {
  const auto isAnchored = [](const auto& region) { return region.has_anchor(); };
  if (!std::ranges::any_of(profile.targets(), isAnchored) &&
      !std::ranges::any_of(profile.hazards(), isAnchored))
    return;  // a volume takes time to compile
  const auto limb = unitLimbOf(profile);
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
  const auto index = static_cast<std::size_t>(layer - names_.begin());
  if (const auto* const body = std::get_if<BodyLimb>(&limb_)) {
    const auto top = topIn(*body, center_m, index);
    if (!top) return {};
    const Vec3 way = top->skin_m - top->normal * (top->depth_m + anchor.offset_m()) - center_m;
    return norm(way) <= kSamePlace_m ? Vec3{} : way;
  }
  const double top_m = tops_m_[index];
  const double up_m = signedDepth(limb_, center_m) - (top_m + anchor.offset_m());
  return std::abs(up_m) <= kSamePlace_m ? Vec3{} : up_m * surfaceNormal(limb_, center_m, kIntoTheBody);
}

std::optional<AnchoredPlaces::Top> AnchoredPlaces::topIn(const BodyLimb& body, Vec3 center_m,
                                                         std::size_t structure) const {
  Top top;
  top.skin_m = closestSkin(limb_, center_m, kIntoTheBody);
  top.normal = surfaceNormal(limb_, top.skin_m, kIntoTheBody);
  const LayerStack stack = body.body->layersAlong(top.skin_m, -top.normal, kReach_m, 0, AtBone::kEnds);
  for (std::size_t i = 0; i < stack.count; ++i) {
    if (stack.layers[i].structure != structure) continue;
    top.depth_m = stack.layers[i].top_m;
    return top;
  }
  return std::nullopt;
}

Vec3 AnchoredPlaces::wayOf(const pb::Target& target) const {
  return target.has_anchor() ? wayOf(middleOf(target), target.anchor()) : Vec3{};
}

Vec3 AnchoredPlaces::wayOf(const pb::Hazard& hazard) const {
  return hazard.has_anchor() ? wayOf(middleOf(hazard), hazard.anchor()) : Vec3{};
}

bool AnchoredPlaces::hasPlace(Vec3 center_m, const pb::Anchor& anchor) const {
  const auto* const body = std::get_if<BodyLimb>(&limb_);
  const auto layer = std::ranges::find(names_, anchor.layer());
  if (body == nullptr || layer == names_.end()) return true;
  return topIn(*body, center_m, static_cast<std::size_t>(layer - names_.begin())).has_value();
}

bool AnchoredPlaces::hasPlace(const pb::Target& target) const {
  return !target.has_anchor() || hasPlace(middleOf(target), target.anchor());
}

bool AnchoredPlaces::hasPlace(const pb::Hazard& hazard) const {
  return !hazard.has_anchor() || hasPlace(middleOf(hazard), hazard.anchor());
}

Status checkAnchors(const pb::Profile& profile) {
  const std::vector<std::string> names = layerNames(profile);
  const AnchoredPlaces places(profile);
  RETURN_IF_ERROR(checkAnchorsOf(profile.targets(), places, names, "targets"));
  return checkAnchorsOf(profile.hazards(), places, names, "hazards");
}

}  // namespace needlelab
