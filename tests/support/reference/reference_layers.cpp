#include "tests/support/reference/reference_layers.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace needlelab::test {
namespace {

constexpr double kNoEnd = std::numeric_limits<double>::infinity();

// where `depth` reaches `top` between a shallower and a deeper place
double crossing(const std::function<double(double)>& depth, double top_m, double shallow_m, double deep_m) {
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (shallow_m + deep_m);
    (depth(middle) < top_m ? shallow_m : deep_m) = middle;
  }
  return 0.5 * (shallow_m + deep_m);
}

// δ along a line through a round limb has a single maximum
double greatest(const std::function<double(double)>& depth, double from_m, double to_m) {
  for (int i = 0; i < 200; ++i) {
    const double a = from_m + (to_m - from_m) / 3, b = to_m - (to_m - from_m) / 3;
    (depth(a) < depth(b) ? from_m : to_m) = depth(a) < depth(b) ? a : b;
  }
  return 0.5 * (from_m + to_m);
}

}  // namespace

ReferenceLayers::ReferenceLayers(const SceneSpec& scene, const std::function<double(Vec3)>& depth_at,
                                 Vec3 p_entry_W_m, Vec3 u_W, double slant)
    : layers_(scene.layers) {
  std::vector<double> tops = {0};
  for (const LayerSpec& layer : layers_) tops.push_back(tops.back() + layer.thickness_m);
  tops.pop_back();
  const int count = static_cast<int>(tops.size());
  deepest_m_ = kNoEnd;
  if (slant <= 0.05) {  // "a line that leaves the limb at once"
    parts_.emplace_back(kNoEnd, 0);
    return;
  }
  if (std::holds_alternative<PlaneLimb>(scene.limb)) {
    for (int i = 0; i < count; ++i)
      parts_.emplace_back(i + 1 < count ? tops[static_cast<std::size_t>(i) + 1] / slant : kNoEnd, i);
    return;
  }
  const auto depth = [&](double s) { return depth_at(p_entry_W_m + u_W * s); };
  constexpr double kAcross_m = 2;  // longer than any path through a limb
  deepest_m_ = greatest(depth, 0, kAcross_m);
  if (depth(deepest_m_) <= 0) {  // a line that misses the limb
    deepest_m_ = kNoEnd;
    parts_.emplace_back(kNoEnd, 0);
    return;
  }
  int met = 0;
  while (met < count && (met == 0 || depth(deepest_m_) > tops[static_cast<std::size_t>(met)])) ++met;
  const auto top = [&](int i) { return tops[static_cast<std::size_t>(i)]; };
  for (int i = 0; i + 1 < met; ++i) parts_.emplace_back(crossing(depth, top(i + 1), 0, deepest_m_), i);
  for (int i = met - 1; i >= 0; --i) parts_.emplace_back(crossing(depth, top(i), kAcross_m, deepest_m_), i);
  parts_.emplace_back(kNoEnd, -1);
}

double ReferenceLayers::integral(double d_m, const std::function<double(const LayerSpec&)>& number) const {
  if (d_m < 0) {
    for (const auto& [end_m, layer] : parts_)
      if (end_m > 1e-12) return layer < 0 ? 0.0 : d_m * number(layers_[static_cast<std::size_t>(layer)]);
  }
  double sum = 0, from = 0;
  for (const auto& [end_m, layer] : parts_) {
    const double to = std::min(end_m, d_m);
    if (layer >= 0 && to > from) sum += number(layers_[static_cast<std::size_t>(layer)]) * (to - from);
    from = std::max(from, to);
  }
  return sum;
}

double ReferenceLayers::integralOfIntegral(double d_m, const std::function<double(const LayerSpec&)>& number,
                                           double most) const {
  if (d_m < 0) return 0.5 * d_m * integral(d_m, number);
  double sum = 0, from = 0, value = 0;
  // a straight piece, cut where it reaches `most`
  const auto add = [&](double to, double slope) {
    if (!(to > from)) return;
    const double full = slope > 0 ? from + (most - value) / slope : to;
    const double rises_to = value >= most ? from : std::min(to, full);
    const double end = std::min(value + slope * (rises_to - from), most);
    sum += 0.5 * (value + end) * (rises_to - from) + end * (to - rises_to);
    value = slope > 0 || value >= most ? std::min(most, value + slope * (to - from)) : value;
    from = to;
  };
  for (const auto& [end_m, layer] : parts_)
    add(std::min(end_m, d_m), layer >= 0 ? number(layers_[static_cast<std::size_t>(layer)]) : 0.0);
  return sum;
}

}  // namespace needlelab::test
