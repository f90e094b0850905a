#include "common/haptics/effects/line_layers.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <variant>

#include "common/haptics/effects/trajectory.h"

namespace needlelab {
namespace {

/// Closer to the tip than this, a new path does not change the layers along u.
constexpr double kKeepAhead_m = 0.5e-3;
constexpr double kNoEnd = std::numeric_limits<double>::infinity();

// ---- where a line is in the limb shrunk by a depth ----

struct Reach {
  double begin_m = kNoEnd, end_m = -kNoEnd;  // nowhere
};

void widen(Reach& reach, double begin_m, double end_m) {
  if (!(begin_m <= end_m)) return;
  reach.begin_m = std::min(reach.begin_m, begin_m);
  reach.end_m = std::max(reach.end_m, end_m);
}

void widenBySphere(Vec3 center_W_m, double radius_m, Vec3 from_W_m, Vec3 u_W, Reach& reach) {
  const Vec3 arm = from_W_m - center_W_m;
  const double middle_m = -dot(arm, u_W);
  const double room_m2 = radius_m * radius_m - normSquared(arm + u_W * middle_m);
  if (!(room_m2 >= 0.0)) return;
  const double half_m = std::sqrt(room_m2);
  widen(reach, middle_m - half_m, middle_m + half_m);
}

// the part of the cylinder between the capsule's ends
void widenByCylinder(const CapsuleLimb& capsule, double radius_m, Vec3 from_W_m, Vec3 u_W, Reach& reach) {
  const Vec3 axis = capsule.b_m - capsule.a_m;
  const double length_m = norm(axis);
  const Vec3 along = axis / length_m, arm = from_W_m - capsule.a_m;
  const double arm_along_m = dot(arm, along), u_along = dot(u_W, along);
  const Vec3 arm_across = arm - along * arm_along_m, u_across = u_W - along * u_along;
  const double slope = normSquared(u_across);
  double begin_m = -kNoEnd, end_m = kNoEnd;
  if (slope > 0.0) {
    const double half = dot(arm_across, u_across);
    const double root2 = half * half - slope * (normSquared(arm_across) - radius_m * radius_m);
    if (!(root2 >= 0.0)) return;
    const double root = std::sqrt(root2);
    begin_m = (-half - root) / slope;
    end_m = (-half + root) / slope;
  } else if (normSquared(arm_across) > radius_m * radius_m) {
    return;
  }
  if (u_along != 0.0) {
    const double to_a_m = -arm_along_m / u_along, to_b_m = (length_m - arm_along_m) / u_along;
    begin_m = std::max(begin_m, std::min(to_a_m, to_b_m));
    end_m = std::min(end_m, std::max(to_a_m, to_b_m));
  } else if (arm_along_m < 0.0 || arm_along_m > length_m) {
    return;
  }
  widen(reach, begin_m, end_m);
}

// where along the line the tip is at least `top_m` deep
Reach reachBelow(const SceneModel& model, double top_m, Vec3 from_W_m, Vec3 u_W, double slant) {
  Reach reach;
  if (model.is_plane) {
    reach = {top_m / slant, kNoEnd};
  } else if (const auto* sphere = std::get_if<SphereLimb>(&model.limb)) {
    if (top_m < sphere->radius_m)
      widenBySphere(sphere->center_m, sphere->radius_m - top_m, from_W_m, u_W, reach);
  } else if (const auto* capsule = std::get_if<CapsuleLimb>(&model.limb)) {
    if (const double radius_m = capsule->radius_m - top_m; radius_m > 0.0) {
      widenBySphere(capsule->a_m, radius_m, from_W_m, u_W, reach);
      widenBySphere(capsule->b_m, radius_m, from_W_m, u_W, reach);
      widenByCylinder(*capsule, radius_m, from_W_m, u_W, reach);
    }
  }
  return reach;
}

// appends spans and accumulates the integral of friction
class Layering {
 public:
  explicit Layering(LayersAlong& along) : along_(along) { along_.count = along_.at = 0; }

  void add(double begin_m, double end_m, const CompiledLayer& layer, std::int64_t index) {
    add({begin_m, end_m, layer.friction_N_per_m, 0.0, index < 0 ? 0.0 : layer.lateral_N_per_m2, index});
  }
  void add(LayerSpan span) {
    if (!(span.begin_m < span.end_m)) return;
    assert(along_.count < along_.spans.size());
    span.friction_offset_N = friction_N_ - span.friction_N_per_m * span.begin_m;
    along_.spans[along_.count++] = span;
    friction_N_ += span.friction_N_per_m * (span.end_m - span.begin_m);
  }
  /// The last span goes on to here.
  void extend(double end_m) {
    assert(along_.count > 0);
    LayerSpan& last = along_.spans[along_.count - 1];
    friction_N_ += last.friction_N_per_m * (end_m - last.end_m);
    last.end_m = end_m;
  }
  void close() {
    assert(along_.count > 0);
    along_.spans[0].begin_m = -kNoEnd;
    along_.spans[along_.count - 1].end_m = kNoEnd;
  }

 private:
  LayersAlong& along_;
  double friction_N_ = 0;
};

// the fixture's k: ∫ lateral stiffness up to its maximum, averaged. A kink of the integral spreads over
// ±kBlend_m
void blendStiffness(const SceneModel& model, LayersAlong& along) {
  struct Kink {
    double at_m, change_N_per_m2;
  };
  std::array<Kink, 2 * kMaxLayers> kinks;
  std::uint32_t count = 0;
  const double first = along.spans[0].lateral_N_per_m2;
  double k = 0.0, slope = first, from_m = 0.0;
  for (std::uint32_t i = 0; i < along.count; ++i) {
    const double here = along.spans[i].lateral_N_per_m2;
    if (i > 0) {
      k += slope * (along.spans[i].begin_m - from_m);
      from_m = along.spans[i].begin_m;
      if (here != slope) kinks[count++] = {from_m, here - slope};
      slope = here;
    }
    assert(count < kinks.size());
    const double full_m = slope > 0.0 ? from_m + (model.fixture.max_stiffness_N_per_m - k) / slope : kNoEnd;
    if (!(full_m < along.spans[i].end_m)) continue;
    kinks[count++] = {full_m, -slope};
    break;
  }

  // each kink turns a bend on and off again
  StiffnessSpan span{0.0, kNoEnd, 0.0, first, 0.0};
  along.stiffness_count = 0;
  for (std::uint32_t on = 0, off = 0; off < count;) {
    const bool begins = on < count && kinks[on].at_m - kBlend_m <= kinks[off].at_m + kBlend_m;
    assert((begins || off < on) && "a kink's bend ends after it began");
    assert(along.stiffness_count + 1 < along.stiffness.size());
    const Kink& kink = begins ? kinks[on++] : kinks[off++];
    const double at_m = begins ? kink.at_m - kBlend_m : kink.at_m + kBlend_m;
    const double bend = (begins ? kink.change_N_per_m2 : -kink.change_N_per_m2) / (4.0 * kBlend_m);
    span.end_m = at_m;
    along.stiffness[along.stiffness_count++] = span;
    const double t = at_m - span.begin_m;
    span = {at_m, kNoEnd, span.k_N_per_m + t * (span.slope_N_per_m2 + t * span.half_bend_N_per_m3),
            span.slope_N_per_m2 + 2.0 * t * span.half_bend_N_per_m3, span.half_bend_N_per_m3 + bend};
    // clear what rounding leaves of it
    if (off == count) span.slope_N_per_m2 = span.half_bend_N_per_m3 = 0.0;
  }
  along.stiffness[along.stiffness_count++] = span;
  along.stiffness_here = along.stiffness[0];
}

// the spans of a line that enters at a place
void layLine(const SceneModel& model, Vec3 p_entry_W_m, Vec3 u_W, double slant, LayersAlong& along) {
  assert(slant >= kMinSlant && model.layer_count > 0);
  std::array<Reach, kMaxLayers> reach;
  std::uint32_t met = 0;
  along.deepest_m = kNoEnd;
  for (; slant > kMinSlant && met < model.layer_count; ++met) {
    reach[met] = reachBelow(model, model.layers[met].top_m, p_entry_W_m, u_W, slant);
    const double middle_m = 0.5 * (reach[met].begin_m + reach[met].end_m);
    reach[met].begin_m = met == 0 ? 0.0 : std::max(0.0, reach[met].begin_m);
    if (!(reach[met].begin_m < reach[met].end_m)) break;
    along.deepest_m = middle_m;
  }
  Layering layers(along);
  if (met == 0) {  // the line leaves the limb at once
    layers.add(0.0, kNoEnd, model.layers[0], 0);
    return layers.close();
  }
  for (std::uint32_t i = 0; i + 1 < met; ++i)
    layers.add(reach[i].begin_m, reach[i + 1].begin_m, model.layers[i], i);
  layers.add(reach[met - 1].begin_m, reach[met - 1].end_m, model.layers[met - 1], met - 1);
  for (std::uint32_t i = met - 1; i > 0; --i)
    layers.add(reach[i].end_m, reach[i - 1].end_m, model.layers[i - 1], i - 1);
  layers.add(reach[0].end_m, kNoEnd, model.beyond, -1);
  layers.close();
}
}  // namespace

void copyLayers(const LayersAlong& from, LayersAlong& to) noexcept {
  std::copy_n(from.spans.begin(), from.count, to.spans.begin());
  std::copy_n(from.stiffness.begin(), from.stiffness_count, to.stiffness.begin());
  to.count = from.count;
  to.at = from.at;
  to.stiffness_count = from.stiffness_count;
  to.stiffness_here = from.stiffness_here;
  to.deepest_m = from.deepest_m;
}

void findStiffness(LayersAlong& along, double insertion_m) noexcept {
  std::uint32_t at = 0;
  while (insertion_m >= along.stiffness[at].end_m) ++at;
  assert(at < along.stiffness_count);
  along.stiffness_here = along.stiffness[at];
}

void layStraight(const SceneModel& model, LayersAlong& along) noexcept {
  Layering layers(along);
  for (std::uint32_t i = 0; i < model.layer_count; ++i)
    layers.add(model.layers[i].top_m, model.layers[i].bottom_m, model.layers[i], i);
  layers.close();
  along.deepest_m = kNoEnd;
  blendStiffness(model, along);
}

void layLayers(const SceneModel& model, Vec3 p_entry_W_m, Vec3 u_W, double slant,
               LayersAlong& along) noexcept {
  layLine(model, p_entry_W_m, u_W, slant, along);
  blendStiffness(model, along);
}

// appends the spans between two places, and joins those of one layer; so does the last that has room
void appendSpans(const LayersAlong& from, double begin_m, double end_m, LayersAlong& to, Layering& layers) {
  for (std::uint32_t i = 0; i < from.count; ++i) {
    LayerSpan span = from.spans[i];
    span.begin_m = std::max(span.begin_m, begin_m);
    span.end_m = std::min(span.end_m, end_m);
    if (!(span.begin_m < span.end_m)) continue;
    const LayerSpan* const last = to.count > 0 ? &to.spans[to.count - 1] : nullptr;
    const bool joins = last != nullptr && last->layer == span.layer &&
                       last->friction_N_per_m == span.friction_N_per_m &&
                       last->lateral_N_per_m2 == span.lateral_N_per_m2;
    if (joins || to.count == to.spans.size())
      layers.extend(span.end_m);
    else
      layers.add(span);
  }
}

void relayLayers(const SceneModel& model, SimState& state) noexcept {
  assert(state.inside && model.is_plane);
  Tick tick;
  project(state, state.p_prev_W_m, tick);
  const double d_m = tick.insertion_m;
  LayersAlong ahead;
  layLine(model, state.p_entry_W_m, state.u_W, state.slant, ahead);
  const LateralStiffness before = lateralStiffness(state.along, d_m);
  for (const double keep_m : {kKeepAhead_m, kBlend_m}) {
    LayersAlong relaid;
    Layering layers(relaid);
    appendSpans(state.along, 0.0, d_m + keep_m, relaid, layers);
    appendSpans(ahead, d_m + keep_m, kNoEnd, relaid, layers);
    layers.close();
    relaid.deepest_m = kNoEnd;
    blendStiffness(model, relaid);
    // neither what holds the needle aside nor what pushes it out may grow
    const LateralStiffness now = lateralStiffness(relaid, d_m);
    if (keep_m < kBlend_m && (now.k_N_per_m > before.k_N_per_m || now.slope_N_per_m2 > before.slope_N_per_m2))
      continue;
    return copyLayers(relaid, state.along);
  }
}

double fixtureEnergy(const SceneModel& model, double k_N_per_m, double lateral_m) noexcept {
  assert(!(lateral_m < 0.0));
  const double max_N = model.fixture.max_force_N;
  if (k_N_per_m * lateral_m <= max_N) return 0.5 * k_N_per_m * lateral_m * lateral_m;
  return max_N * (lateral_m - 0.5 * max_N / k_N_per_m);
}

}  // namespace needlelab
