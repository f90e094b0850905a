#include "common/scoring/targets/reachable.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>
#include <variant>

#include "common/haptics/scene_model.h"
#include "common/haptics/surface.h"
#include "common/profile/layer_names.h"
#include "common/profile/structure_kinds.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/measures/measure_table.h"

namespace needlelab {
namespace {

constexpr double kBehind_m = 0.05;  // how far behind a target's centre bone is looked for

/// Depth of the bone straight in towards a point of a volume, from the nearest skin; infinite without bone on
/// that way.
double boneTowards_m(const pb::Profile& profile, const BodyLimb& body, Vec3 p_m) {
  const Limb limb = body;
  if (!(signedDepth(limb, p_m) > 0)) return std::numeric_limits<double>::infinity();
  const Vec3 skin = closestSkin(limb, p_m, {0, 0, -1}), normal = surfaceNormal(limb, skin, {0, 0, -1});
  const double depth_m = norm(skin - p_m);
  const LayerStack stack =
      body.body->layersAlong(skin, -normal, std::min(1.0, depth_m + kBehind_m), 0, AtBone::kEnds);
  for (std::size_t i = 0; i < stack.count; ++i)
    if (tissueOf(profile.volume().structures(stack.layers[i].structure)) == pb::Layer::BONE)
      return stack.layers[i].top_m;
  return std::numeric_limits<double>::infinity();
}

/// Depth of the outermost bone; infinite without bone.
double boneTop_m(const pb::Profile& profile) {
  double top_m = 0;
  for (const pb::Layer& layer : profile.layers()) {
    if (layer.tissue() == pb::Layer::BONE) return top_m;
    top_m += layer.thickness_m();
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace

std::vector<std::string> unreachableTargets(const pb::Profile& profile, double needle_length_m) {
  const Anatomy anatomy = anatomyOf(profile, {});
  const std::vector<std::string> names = layerNames(profile);
  const auto* const body = std::get_if<BodyLimb>(&anatomy.limb);
  std::vector<std::string> sentences;
  for (std::size_t i = 0; i < anatomy.targets.size(); ++i) {
    const Target& target = anatomy.targets[i];
    const double at_m = depthAt(anatomy, target.ball.a_W_m), radius_m = target.ball.radius_m;
    const DepthSpan ball{at_m - radius_m, at_m + radius_m}, span = depthSpanOf(anatomy, target);
    const auto say = [&](const std::string& why) {
      sentences.push_back(fmt::format("targets[{}]: '{}' {}", i, target.ball.name, why));
    };
    const double bone_m =
        body != nullptr ? boneTowards_m(profile, *body, target.ball.a_W_m) : boneTop_m(profile);
    if (target.ball.structure != nullptr && target.ball.radius_m == 0)
      say("is a structure of which nothing is left: look at the rules before its own");
    else if (ball.bottom_m <= 0)
      say("lies outside the body");
    else if (!(span.top_m < span.bottom_m))
      say(fmt::format("lies in {}, {} deep, and no part of it in {}",
                      names[static_cast<std::size_t>(std::max(0, layerAt(anatomy, target.ball.a_W_m)))],
                      valueText(at_m, "m"),
                      fmt::join(profile.targets(static_cast<int>(i)).tissues(), " or ")));
    else if (span.top_m >= bone_m)
      say(fmt::format("lies in bone, which begins {} deep", valueText(bone_m, "m")));
    else if (span.top_m >= needle_length_m)
      say(fmt::format("begins {} deep, the needle is {} long", valueText(span.top_m, "m"),
                      valueText(needle_length_m, "m")));
  }
  return sentences;
}

}  // namespace needlelab
