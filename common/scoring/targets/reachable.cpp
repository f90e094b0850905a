#include "common/scoring/targets/reachable.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>

#include "common/profile/layer_names.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/measures/measure_table.h"

namespace needlelab {
namespace {

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
  const double bone_m = boneTop_m(profile);
  std::vector<std::string> sentences;
  for (std::size_t i = 0; i < anatomy.targets.size(); ++i) {
    const Target& target = anatomy.targets[i];
    const double at_m = depthAt(anatomy, target.ball.a_W_m), radius_m = target.ball.radius_m;
    const DepthSpan ball{at_m - radius_m, at_m + radius_m}, span = depthSpanOf(anatomy, target);
    const auto say = [&](const std::string& why) {
      sentences.push_back(fmt::format("targets[{}]: '{}' {}", i, target.ball.name, why));
    };
    if (ball.bottom_m <= 0)
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
