#include "tests/support/reference/reference_engine.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace needlelab::test {
namespace {

constexpr double kPi = std::numbers::pi;

double angleBetween(Vec3 a, Vec3 b) {
  return std::atan2(norm(cross(a, b)), dot(a, b));
}  // "Notation": "The angle between a and b is atan2(|a × b|, a·b)."

double signOf(double value) {
  return value > 0 ? 1.0 : value < 0 ? -1.0 : 0.0;
}

Vec3 nearestOnSegment(const CapsuleLimb& limb, Vec3 p) {
  const Vec3 along = limb.b_m - limb.a_m;
  const double t = std::clamp(dot(p - limb.a_m, along) / dot(along, along), 0.0, 1.0);
  return limb.a_m + along * t;
}

double slantOf(Vec3 normal, Vec3 u) {
  return std::max(0.05, -dot(normal, u));  // "Contact": c = max(0.05, −n·u)
}

// u turned by `angle` about P0, toward y, the unit vector of e ("Change of trajectory")
Vec3 turned(Vec3 u, Vec3 e, double angle) {
  return normalized(u * std::cos(angle) + normalized(e) * std::sin(angle));
}

}  // namespace

ReferenceEngine::ReferenceEngine(SceneSpec scene, double rate_hz, Defect planted)
    : scene_(std::move(scene)),
      rate_hz_(rate_hz),
      period_s_(1.0 / rate_hz),
      planted_(planted),
      cuts_(scene_.stage_numbers[stageOf(Effect::kCutMemory)][0],
            scene_.stage_numbers[stageOf(Effect::kCutMemory)][1], planted) {}

std::optional<Vec3> ReferenceEngine::direction() const {
  return insertion_ ? std::optional(insertion_->u) : std::nullopt;
}

std::optional<double> ReferenceEngine::slant() const {
  return insertion_ ? std::optional(slantOf(insertion_->normal, insertion_->u)) : std::nullopt;
}

std::optional<double> ReferenceEngine::tiltLimit() const {
  return insertion_ ? std::optional(insertion_->tilt_limit) : std::nullopt;
}

// "Notation": "A duration of s seconds is max(1, floor(s·rate + 0.5)) ticks."
std::int64_t ReferenceEngine::inTicks(double duration_s) const {
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::floor(duration_s * rate_hz_ + 0.5)));
}

// before "Contact": "An effect is live when the scene lists it and its numbers are not all zero"
bool ReferenceEngine::live(Effect effect) const {
  if ((scene_.effects & bitOf(effect)) == 0) return false;
  const auto anyLayer = [&](auto nonZero) {
    return std::any_of(scene_.layers.begin(), scene_.layers.end(), nonZero);
  };
  switch (effect) {
    case Effect::kCutting:
      return anyLayer([](const LayerSpec& l) { return l.cutting_force_N != 0; });
    case Effect::kAttracted:
      return anyLayer([](const LayerSpec& l) { return l.attracted_force_N != 0; });
    case Effect::kClamping:
      return anyLayer([](const LayerSpec& l) { return l.lateral_stiffness_N_per_m2 != 0; });
    case Effect::kOrientationLimit:
      return scene_.orientation_limit.stiffness_Nm_per_rad != 0 ||
             scene_.orientation_limit.max_torque_Nm != 0;
    case Effect::kShaftFriction:
      return anyLayer([](const LayerSpec& l) { return l.friction_N_per_m != 0; });
    case Effect::kPuncture:
      return anyLayer([](const LayerSpec& l) { return l.membrane.has_value(); });
    case Effect::kCutMemory: {
      // there is something to change: a membrane, or the wall, which this model always has
      return scene_.stage_numbers[stageOf(effect)][1] > 0;
    }
    case Effect::kBone:
    case Effect::kPalpation:
      return false;  // the reference does not model bone, nor the cap
    case Effect::kHub:
      return scene_.stage_numbers[stageOf(effect)][0] > 0;
  }
  return false;
}

// "Contact": plane δ = −n·(p − p_surface); sphere R − |p − c|; capsule "R less the distance to its segment"
double ReferenceEngine::depthAt(Vec3 p) const {
  if (const auto* plane = std::get_if<PlaneLimb>(&scene_.limb))
    return -dot(normalized(plane->normal), p - plane->point_m);
  if (const auto* sphere = std::get_if<SphereLimb>(&scene_.limb))
    return sphere->radius_m - norm(p - sphere->center_m);
  const auto& capsule = std::get<CapsuleLimb>(scene_.limb);
  return capsule.radius_m - norm(p - nearestOnSegment(capsule, p));
}

// the surface normal, out of the tissue
Vec3 ReferenceEngine::normalAt(Vec3 p) const {
  if (const auto* plane = std::get_if<PlaneLimb>(&scene_.limb)) return normalized(plane->normal);
  if (const auto* sphere = std::get_if<SphereLimb>(&scene_.limb)) return normalized(p - sphere->center_m);
  return normalized(p - nearestOnSegment(std::get<CapsuleLimb>(scene_.limb), p));
}

double ReferenceEngine::topOf(std::size_t layer) const {
  double top = 0;
  for (std::size_t i = 0; i < layer; ++i) top += scene_.layers[i].thickness_m;
  return top;
}

// "Contact": "Layer by δ: half-open intervals [top, bottom); the last has no bottom."
int ReferenceEngine::layerAt(double depth) const {
  int layer = 0;
  for (std::size_t i = 1; i < scene_.layers.size(); ++i)
    if (depth >= topOf(i)) layer = static_cast<int>(i);
  return layer;
}

ReferenceLayers ReferenceEngine::layersAlong(Vec3 p_entry, Vec3 normal, Vec3 u) const {
  return {scene_, [this](Vec3 p) { return depthAt(p); }, p_entry, u, slantOf(normal, u)};
}

// "Clamping": ∫₀^{d_t} lateral_stiffness ds, at most max_stiffness, averaged over ±4 mm
double ReferenceEngine::lateralStiffness(const ReferenceLayers& layers, double d_t) const {
  const auto upTo = [&](double d) {
    return layers.integralOfIntegral(
        d, [](const LayerSpec& l) { return l.lateral_stiffness_N_per_m2; },
        scene_.virtual_fixture.max_stiffness_N_per_m);
  };
  return (upTo(d_t + 4e-3) - upTo(d_t - 4e-3)) / 8e-3;
}

// "Clamping": U = ½ k e², linear in e beyond f_max
double ReferenceEngine::energy(double k, double e) const {
  const double f_max = scene_.virtual_fixture.max_force_N;
  return k * e > f_max ? f_max * (e - f_max / (2 * k)) : 0.5 * k * e * e;
}

// "Orientation limit": "α(d) = atan((L − d)/(L + d)) (eq. 7), with d = d_t held to [0, L]"
double ReferenceEngine::cone(double d_t) const {
  const double length = scene_.needle_length_m, d = std::clamp(d_t, 0.0, length);
  return std::atan((length - d) / (length + d));
}

ReferenceEngine::Geometry ReferenceEngine::geometry(const Insertion& in, Vec3 u, Vec3 p) const {
  Geometry g;
  g.x = dot(u, p - in.p_entry);           // "Contact": x = u·(p − P0)
  g.d_t = norm(p - in.p_entry);           // d_t = |p − P0|
  if (planted_ == Defect::kLengthAlongU)  // planted
    g.d_t = std::min(std::max(0.0, g.x), depthAt(p) / slantOf(in.normal, u));
  g.e = (p - in.p_entry) - u * g.x;
  g.k = lateralStiffness(in.layers, g.d_t);
  return g;
}

StepReport ReferenceEngine::step(const TipSample& sample) {
  StepReport out;
  undecided_ = 0;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  out.p_wall_W_m = {nan, nan, nan};
  if (!isFinite(sample.p_WT_m) || !isFinite(sample.q_WT)) {
    out.flags = kFlagNotStepped;
    return out;
  }
  const Vec3 p = sample.p_WT_m;
  const Vec3 axis =
      normalized(rotate(sample.q_WT, {0, 0, 1}));  // "Notation": "The needle's axis is normalised on input."
  const double depth = depthAt(p);
  out.depth_m = depth;

  // "Contact": Through
  bool through = false;
  if (insertion_ && depth <= 0 && !std::holds_alternative<PlaneLimb>(scene_.limb)) {
    const Vec3 arm = p - insertion_->p_entry;
    const double h = -dot(insertion_->normal, arm);
    const bool far = insertion_->past_middle || dot(insertion_->u, arm) >= insertion_->layers.deepest();
    through = h > 0 && (insertion_->through || (far && h - depth > 0.05e-3));
  }
  if (planted_ == Defect::kExitAnywhere) through = false;  // planted
  if (depth <= 0 && !through) {
    if (insertion_) out.flags |= kFlagExit;
    // an old cut of such an insertion is off by as much as its trajectory was
    if (insertion_ && live(Effect::kCutMemory)) cone_bound_ticks_before_ += insertion_->cone_bound_ticks;
    insertion_.reset();
    outside_once_ = true;
  } else if (!insertion_ && has_past_ && depth_past_ <= 0) {  // Entry: "δ_k > 0 after one with δ_{k−1} ≤ 0"
    enter(p, depth, axis);
    out.flags |= kFlagEntry;
    if (angleBetween(axis, insertion_->normal) > 80 * kPi / 180 &&
        angleBetween(axis, insertion_->normal) < 100 * kPi / 180)
      out.flags |= kFlagFlatEntry;
  } else if (!insertion_ && planted_ == Defect::kEntersFromInside) {  // planted
    p_past_ = p, depth_past_ = 0;
    enter(p, depth, axis);
    out.flags |= kFlagEntry;
  } else if (!insertion_) {
    out.flags |= kFlagStartedInside;  // "a tick with δ > 0 stays FREE: layer −1, no force"
  }

  if (insertion_) {
    Insertion& in = *insertion_;
    const bool entry = (out.flags & kFlagEntry) != 0;
    Geometry g = geometry(in, in.u, p);

    // layer by δ
    const int layer = layerAt(depth);
    if (through ? !in.through : !entry && layer != in.layer) out.flags |= kFlagLayerChange;
    in.layer = layer;
    in.through = through;

    // past the middle ("Contact")
    if (g.x >= in.layers.deepest()) in.past_middle = true;
    if (std::holds_alternative<PlaneLimb>(scene_.limb) || -dot(in.normal, p - in.p_entry) - depth <= 0.05e-3)
      in.past_middle = false;

    // "Near the skin", "Change of trajectory", "Clamping"
    in.turned_by = 0;
    if (followNearSkin(in, g, p, depth, axis)) out.flags |= kFlagTurn;
    if (turn(in, g, p, axis)) out.flags |= kFlagTurn;
    // "stretched by the tip's own way, u·(p − the place of entry)"
    if (entry) in.wall = in.friction_wall = g.x - std::max(0.0, std::min(g.x, dot(in.u, p - in.hole)));
    const Vec3 clamping = clamp(in, g, out);

    const double v = speed(in, g.x);
    const double x_c = meetMembranes(in, g, depth, entry, out);
    in.stop.step(g.x, x_c - in.wall, v, p, in.u);
    const double wall_unstepped = in.wall;
    axial(in, depth, x_c, out);
    // "Memory of the cut": "Where neither CUTTING nor ATTRACTED is live no wall is dragged"
    if (!live(Effect::kCutting) && !live(Effect::kAttracted)) in.wall = wall_unstepped;
    friction(in, g, x_c, out);
    puncture(in, g, out);
    tilt(in, g, axis, out);

    // "Sum and cap": "Along u: axial, then friction, then puncture; to that vector clamping is added, then
    // the hub; then the forces of effects that run as stages"
    Vec3 force = in.u * (out.cutting_N + out.attracted_N);
    force += in.u * out.friction_N;
    force += in.u * out.puncture_N;
    force += clamping;
    // "Hub": "K_h(d_t − L) along P0 − p"
    if (live(Effect::kHub) && g.d_t > scene_.needle_length_m) {
      out.hub_N = scene_.stage_numbers[stageOf(Effect::kHub)][0] * (g.d_t - scene_.needle_length_m);
      force += normalized(in.p_entry - p) * out.hub_N;
    }
    if (live(Effect::kCutMemory)) force += in.u * remember(in, g, x_c, entry, out);
    // "A sum longer than the profile's max_force_n … is shortened to it and keeps its direction."
    if (std::abs(norm(force) - scene_.max_force_N) < 1e-9) undecided_ |= kFlagForceCapped;
    if (norm(force) > scene_.max_force_N) {
      force = force * (scene_.max_force_N / norm(force));
      out.flags |= kFlagForceCapped;
    }
    out.wrench_W.force_N = force;

    out.phase = in.stop.phase();
    out.layer = in.layer;
    out.insertion_m = g.d_t;
    out.speed_mps = v;
    out.lateral_error_m = norm(g.e);
    if (g.d_t > scene_.needle_length_m) out.flags |= kFlagBeyondNeedle;
    if (live(Effect::kCutting) || live(Effect::kAttracted)) out.p_wall_W_m = in.p_entry + in.u * in.wall;
    in.depth_past = depth;
  }

  has_past_ = true;
  p_past_ = p;
  depth_past_ = depth;
  return out;
}

// "Contact": the entry, and the state with which the other sections begin
void ReferenceEngine::enter(Vec3 p, double depth, Vec3 axis) {
  Insertion in({scene_.tracking_wall, rate_hz_, wallRelaxes(), planted_});
  in.p_entry = p_past_ + (p - p_past_) * (depth_past_ / (depth_past_ - depth));
  if (planted_ == Defect::kEntryAtTip) in.p_entry = p;  // planted
  in.normal = normalAt(in.p_entry);
  in.u = entryDirection(axis, in.normal);
  in.layers = layersAlong(in.p_entry, in.normal, in.u);
  in.u0 = in.u;
  in.aim = axis;
  in.hole = in.p_entry;
  in.x_past = {0.0};  // "and x = 0 at tick k_entry − 1"
  in.tilt_limit =
      std::max(kPi / 4, angleBetween(axis, in.u));  // "max(45°, θ) at entry, before a turn in that tick"
  in.membranes.resize(scene_.layers.size());
  in.wall = in.friction_wall = std::min(0.0, dot(in.u, p - in.p_entry));
  in.spring = scene_.layers[0].wall_stiffness_N_per_m.value_or(scene_.tracking_wall.stiffness_N_per_m);
  insertion_ = std::move(in);
}

// the excess of force that rounding may reverse; more once the cone limited a turn (1e-12 rad per tick:
// "Change of trajectory")
double ReferenceEngine::undecidedBelow(const Insertion& in) {
  return in.cone_bound_ticks > 0 ? 1e-6 : 1e-9;
}

// "Contact": "the direction of entry of the needle's axis"
Vec3 ReferenceEngine::entryDirection(Vec3 axis, Vec3 normal) const {
  const double inward = -dot(normal, axis), cos80 = std::cos(80 * kPi / 180);
  if (planted_ == Defect::kEntryJumpsAt80 && inward < cos80) return -normal;  // planted
  const Vec3 skin = axis + normal * inward;                                   // the axis' part along the skin
  if (inward >= cos80) return axis;
  if (inward <= -cos80) return normalized(skin - normal * -inward);
  return normalized(skin) * std::sin(80 * kPi / 180) - normal * cos80;
}

// "all lengths along u move as in a turn, so that no force along u jumps"
void ReferenceEngine::moveLine(Insertion& in, Geometry& g, Vec3 p_entry, Vec3 normal, Vec3 u, Vec3 p) const {
  const double x_old = g.x;
  in.p_entry = p_entry;
  in.normal = normal;
  in.u = u;
  g = geometry(in, in.u, p);
  if (planted_ == Defect::kTurnLeavesWalls) return;  // planted
  const double moved = g.x - x_old;
  in.turned_by += moved;
  in.wall += moved;
  in.friction_wall += moved;
  for (auto& membrane : in.membranes) membrane.place_m += moved;
  for (double& x : in.x_past) x += moved;
  in.stop.move(moved);
}

// "Near the skin"; true where P0 moved deeper than 0.6 mm
bool ReferenceEngine::followNearSkin(Insertion& in, Geometry& g, Vec3 p, double depth, Vec3 axis) {
  const bool plane = std::holds_alternative<PlaneLimb>(scene_.limb);
  const double h = plane ? depth : -dot(in.normal, p - in.p_entry);
  const double H = in.through || in.past_middle ? h : depth;
  Vec3 u = in.u;
  if (H <= 0.6e-3) {
    const auto toward = [&](Vec3 from, Vec3 to) {
      const Vec3 side = to - from * dot(from, to);
      const double angle = std::min(angleBetween(from, to), 2.0 * period_s_);
      return norm(side) > 1e-9 ? turned(from, side, angle) : from;
    };
    u = toward(u, entryDirection(axis, in.normal));
    // "and then u0 as fast toward u"; "A turn of u0 … that increases θ increases θ_l by the same amount."
    const double theta_before = angleBetween(axis, in.u0);
    in.u0 = toward(in.u0, u);
    in.tilt_limit += std::max(0.0, angleBetween(axis, in.u0) - theta_before);
  }
  const Vec3 o = (p - in.p_entry) - u * (h / slantOf(in.normal, u));
  const double S = 0.05e-3 + 3 * std::max(0.0, H - 0.6e-3);
  if (std::abs(norm(o) - S) < 1e-9 || std::abs(H - 0.6e-3) < 1e-9) undecided_ |= kFlagTurn;
  Vec3 p_entry = in.p_entry, normal = in.normal;
  bool moves = norm(o) > S;
  if (moves) {
    p_entry += o * (1 - S / norm(o));
    const Vec3 arm = p - p_entry;
    if (H > 0.6e-3 && energy(lateralStiffness(in.layers, norm(arm)), norm(arm - u * dot(u, arm))) >
                          energy(g.k, norm(g.e))) {
      p_entry = in.p_entry;
      moves = false;
    } else if (!plane && !in.through) {
      normal = normalAt(p_entry);
      p_entry += normal * depthAt(p_entry);
    }
  }
  if (!moves && u == in.u) return false;
  if (H <= 0.6e-3 && !(plane && u == in.u)) in.layers = layersAlong(p_entry, normal, u);
  moveLine(in, g, p_entry, normal, u, p);
  if (moves && live(Effect::kPuncture)) followMembranes(in, g, depth, H <= 0.6e-3);
  return H > 0.6e-3;
}

// "Puncture": what a move of P0 does to membranes
void ReferenceEngine::followMembranes(Insertion& in, const Geometry& g, double depth, bool near_skin) {
  const auto cutPosition = [&] {
    double x_c = g.x;
    for (const auto& membrane : in.membranes)
      if (membrane.met && !membrane.ruptured) x_c = std::min(x_c, membrane.place_m);
    return x_c;
  };
  const auto beyond = [&](std::size_t i) { return (depth - topOf(i)) / slantOf(in.normal, in.u); };
  const bool entry = in.x_past.size() == 1;
  const bool new_hole = near_skin && !entry && norm(in.p_entry - in.hole) > 1e-3;
  if (new_hole) {
    for (std::size_t i = 0; i < in.membranes.size(); ++i) {
      if (!in.membranes[i].ruptured) continue;
      in.membranes[i].ruptured = false;
      in.membranes[i].place_m = g.x - std::min(0.0, beyond(i));
    }
    cuts_.leaveTrack(in.hole);
    in.hole = in.p_entry;
  }
  const double x_c_before = cutPosition();
  for (std::size_t i = 0; i < in.membranes.size(); ++i) {
    Membrane& membrane = in.membranes[i];
    if (!membrane.met || membrane.ruptured || planted_ == Defect::kMembranesSlide) continue;  // planted
    const double z = g.x - membrane.place_m;
    // "z is brought between 0 and (δ − top)/c"
    membrane.place_m = g.x - std::min(std::max(z, std::min(0.0, beyond(i))), std::max(0.0, beyond(i)));
  }
  for (double* wall : {&in.wall, &in.friction_wall})
    *wall = *wall > x_c_before ? std::max(*wall, cutPosition()) : *wall + (cutPosition() - x_c_before);
}

// "Change of trajectory"; true when u turned
bool ReferenceEngine::turn(Insertion& in, Geometry& g, Vec3 p, Vec3 axis) {
  if (!live(Effect::kClamping)) return false;  // "Only where CLAMPING is live"
  const double L = scene_.needle_length_m, e = norm(g.e);
  double beta = std::atan(std::min(1.0, 1e-4 + std::pow(g.d_t / L, 2)));
  if (planted_ == Defect::kTurnsOnlyDeep) beta = kPi / 4;  // planted
  if (planted_ == Defect::kTurnsFreely) beta = 0;          // planted
  const double beyond = std::atan2(e, g.x) - beta;
  if (std::abs(beyond) * g.d_t * g.k < undecidedBelow(in)) undecided_ |= kFlagTurn;
  // "in each tick, before all else here, m ← m + (1 − e^(−T/50 ms))·(axis − m)"
  in.aim = in.aim + (axis - in.aim) * (1 - std::exp(-period_s_ / 0.05));
  if (!(beyond > 0 && g.x > 0)) return false;
  const Vec3 m = planted_ == Defect::kTurnsPastAxis ? in.u + g.e / e : in.aim;  // planted
  if (!(dot(m, g.e) > 0)) return false;                                         // "m·y > 0"
  // the least of: the angle after which the tip is at β; the one to m; 2 rad/s·T; the cone's
  double angle = std::min({beyond, std::atan2(dot(m, g.e / e), dot(m, in.u)), 2.0 * period_s_});
  const double limit = std::max(cone(g.d_t), angleBetween(in.u, in.u0));
  const auto allowed = [&](double a) { return angleBetween(turned(in.u, g.e, a), in.u0) <= limit; };
  if (!allowed(angle)) {
    double low = 0, high = angle;
    while (high - low > 1e-12) {
      const double middle = 0.5 * (low + high);
      (allowed(middle) ? low : high) = middle;
    }
    angle = low;
    ++in.cone_bound_ticks;
    if (angle < 1e-6)
      undecided_ |= kFlagTurn;  // almost no room left; along the cone rounding counts by its root
  }
  if (std::abs(angle) < 2e-9) undecided_ |= kFlagTurn;
  if (!(angle > 1e-9)) return false;
  const Vec3 u = turned(in.u, g.e, angle);
  if (g.d_t <= std::min(0.005, L / 4)) {
    const ReferenceLayers layers = layersAlong(in.p_entry, in.normal, u);
    const Vec3 arm = p - in.p_entry;
    if (energy(lateralStiffness(layers, g.d_t), norm(arm - u * dot(u, arm))) > energy(g.k, e)) return false;
    in.layers = layers;
  }
  moveLine(in, g, in.p_entry, in.normal, u, p);
  return true;
}

// "Clamping", the force
Vec3 ReferenceEngine::clamp(Insertion& in, const Geometry& g, StepReport& out) {
  if (!live(Effect::kClamping)) return {};
  const double f_max = scene_.virtual_fixture.max_force_N;
  double e = norm(g.e);
  if (planted_ == Defect::kFixtureForgets) {  // planted
    if (g.k > in.k_past) in.dead += std::max(0.0, in.e_past - in.dead) * (1 - in.k_past / g.k);
    in.dead = std::min(in.dead, e);
    in.k_past = g.k, in.e_past = e;
    e -= in.dead;
  }
  out.clamping_stiffness_N_per_m = g.k;
  if (std::abs(g.k * e - f_max) < undecidedBelow(in)) undecided_ |= kFlagClampCapped;
  if (g.k * e > f_max) out.flags |= kFlagClampCapped;
  const double force = std::min(g.k * e, f_max);
  if (!(force > 0)) return {};
  Vec3 total = g.e * (-force / norm(g.e));
  if (scene_.virtual_fixture.mode == ClampingMode::kConservative) {
    // k′: "averaged over ±4 mm"
    const auto sharp = [&](double d) {
      const double k = in.layers.integral(d, [](const LayerSpec& l) { return l.lateral_stiffness_N_per_m2; });
      return std::min(k, scene_.virtual_fixture.max_stiffness_N_per_m);
    };
    const double slope = (sharp(g.d_t + 4e-3) - sharp(g.d_t - 4e-3)) / 8e-3;
    const double stretch = std::min(e, f_max / g.k);
    const Vec3 away = g.e + in.u * g.x;  // p − P0
    total += away * (-0.5 * slope * stretch * stretch / norm(away));
  }
  out.clamping_N = norm(total);
  return total;
}

// "Contact": "v = (x_k − x_{k−j})/(j·T) with j = min(100 ms in ticks, k − k_entry + 1)"
double ReferenceEngine::speed(Insertion& in, double x) const {
  in.x_past.push_back(x);
  const auto since = static_cast<std::int64_t>(in.x_past.size()) - 1;          // k − k_entry + 1
  const double window_s = planted_ == Defect::kShortSpeedWindow ? 0.02 : 0.1;  // planted
  const std::int64_t j = std::min(inTicks(window_s), since);
  return (x - in.x_past[static_cast<std::size_t>(since - j)]) / (static_cast<double>(j) * period_s_);
}

// "Puncture": places, then ruptures; gives x_c
double ReferenceEngine::meetMembranes(Insertion& in, const Geometry& g, double depth, bool entry,
                                      StepReport& out) const {
  if (!live(Effect::kPuncture)) return g.x;
  // "in the first tick of the insertion with δ ≥ top: x interpolated by δ between the tick before and this
  // one; in the entry tick between P0 (x = 0, δ = 0) and the tip"
  const double x_before = entry ? std::max(0.0, in.wall) : in.x_past[in.x_past.size() - 2];
  const double depth_before = entry ? 0.0 : in.depth_past;
  for (std::size_t i = 0; i < scene_.layers.size(); ++i) {
    if (!scene_.layers[i].membrane || in.membranes[i].met || depth < topOf(i)) continue;
    in.membranes[i].met = true;
    in.membranes[i].place_m =
        x_before + (g.x - x_before) * ((topOf(i) - depth_before) / (depth - depth_before));
  }

  // "x_c = min(x, s of all intact membranes already met)"
  const auto cutPosition = [&] {
    double x_c = g.x;
    for (const auto& membrane : in.membranes)
      if (membrane.met && !membrane.ruptured) x_c = std::min(x_c, membrane.place_m);
    return x_c;
  };
  const double x_c_held = cutPosition();
  for (std::size_t i = 0; i < scene_.layers.size(); ++i) {
    const double z = g.x - in.membranes[i].place_m;
    if (!in.membranes[i].met || in.membranes[i].ruptured || !(z > 0)) continue;
    const MembraneSpec& spec = *scene_.layers[i].membrane;
    if (spec.linear_N_per_m * z + spec.quadratic_N_per_m2 * z * z >= spec.force_N) {
      in.membranes[i].ruptured = true;
      out.flags |= kFlagRupture;
    }
  }
  // "When ruptures change x_c, w and w_f move with it, so that their forces do not jump."
  const double x_c = cutPosition();
  in.wall += x_c - x_c_held;
  in.friction_wall += x_c - x_c_held;
  // "Where then x > x_c, a wall ahead of x_c (it pulls) falls back by the way in beyond x_c since the last
  // tick, as far as x_c"
  if (g.x > x_c && planted_ != Defect::kMembranePulls)  // planted
    for (double* wall : {&in.wall, &in.friction_wall})
      if (*wall > x_c) *wall = std::max(x_c, *wall - std::max(0.0, g.x - std::max(x_before, x_c)));
  return x_c;
}

// "Models without a wall that relaxes …, and scenes in which neither CUTTING nor ATTRACTED is live"
bool ReferenceEngine::wallRelaxes() const {
  switch (scene_.axial_model) {
    case AxialModel::kEnhancedTrackingWall:
    case AxialModel::kTrackingWall:
    case AxialModel::kStatistical:
    case AxialModel::kPrecomputed:
      return live(Effect::kCutting) || live(Effect::kAttracted);
    default:
      return false;
  }
}

double ReferenceEngine::springOf(const Insertion& in) const {
  return scene_.layers[static_cast<std::size_t>(in.layer)].wall_stiffness_N_per_m.value_or(
      scene_.tracking_wall.stiffness_N_per_m);
}

// "Tracking wall", 1 to 4; x_c stands for x
void ReferenceEngine::axial(Insertion& in, double depth, double x_c, StepReport& out) const {
  const LayerSpec& layer = scene_.layers[static_cast<std::size_t>(in.layer)];
  const double stiffness = springOf(in);
  // "Through": the tip cuts nothing and nothing attracts it
  const double cut = live(Effect::kCutting) && !in.through ? layer.cutting_force_N / stiffness : 0.0;
  double attracted =
      live(Effect::kAttracted) && !in.through
          ? std::min(layer.attracted_force_N / stiffness, std::max(0.0, depth) / slantOf(in.normal, in.u))
          : 0.0;
  if (planted_ == Defect::kAttractedNotFaded && live(Effect::kAttracted))
    attracted = layer.attracted_force_N / stiffness;  // planted

  // 1. Spring
  if (stiffness > in.spring) in.wall = x_c - in.spring / stiffness * (x_c - in.wall);
  in.spring = stiffness;

  // 2. Stop
  in.wall += in.stop.wallMove(x_c - in.wall, in.through ? 0.0 : layer.rejection_force_N / stiffness);

  // 3. Movement: w ← min(max(w, x − Δ_cut), x + Δ_att)
  in.wall = std::min(std::max(in.wall, x_c - cut), x_c + attracted);

  // 4. Force: f = −K_t·(x − w); "A stretched spring is cutting, a compressed one attracted"
  const double stretch = x_c - in.wall;
  if (stretch > 0 && live(Effect::kCutting)) out.cutting_N = -stiffness * stretch;
  if (stretch < 0 && live(Effect::kAttracted)) out.attracted_N = -stiffness * stretch;
}

// "Shaft friction": "with the spring K_f and the same reach in both directions: Δ_f = (∫₀^{d_t} friction
// ds)/K_f"; "In a stop it relaxes as the tracking wall does, … before the reach is applied"
void ReferenceEngine::friction(Insertion& in, const Geometry& g, double x_c, StepReport& out) const {
  if (!live(Effect::kShaftFriction)) return;
  const double stiffness = scene_.friction_stiffness_N_per_m;
  const double reach =
      in.layers.integral(g.d_t, [](const LayerSpec& l) { return l.friction_N_per_m; }) / stiffness;
  if (planted_ == Defect::kFrictionBySign) {  // planted
    out.friction_N = -stiffness * reach * signOf(x_c - in.x_c_past);
    in.x_c_past = x_c;
    return;
  }
  if (planted_ != Defect::kFrictionPushes)  // planted
    in.friction_wall += in.stop.frictionMove(x_c - in.friction_wall);
  in.friction_wall = std::min(std::max(in.friction_wall, x_c - reach), x_c + reach);
  out.friction_N = -stiffness * (x_c - in.friction_wall);
}

// "Puncture": "Until it ruptures, with z = x − s > 0, its force along u is −(k1·z + k2·z²). The forces of
// several membranes add."
void ReferenceEngine::puncture(const Insertion& in, const Geometry& g, StepReport& out) const {
  if (!live(Effect::kPuncture)) return;
  for (std::size_t i = 0; i < scene_.layers.size(); ++i) {
    const double z = g.x - in.membranes[i].place_m;
    if (!in.membranes[i].met || in.membranes[i].ruptured || !(z > 0)) continue;
    const MembraneSpec& spec = *scene_.layers[i].membrane;
    out.puncture_N -= spec.linear_N_per_m * z + spec.quadratic_N_per_m2 * z * z;
  }
}

// "Memory of the cut": "after the tick it changes cutting and puncture"; the change of the force along u
double ReferenceEngine::remember(Insertion& in, const Geometry& g, double x_c, bool entry, StepReport& out) {
  const double stiffness = springOf(in);
  CutTick tick;
  tick.entry = entry;
  tick.p_entry_W_m = in.p_entry;
  tick.u_W = in.u;
  tick.turned_by = in.turned_by;
  tick.x_before = entry ? 0.0 : in.x_past[in.x_past.size() - 2];
  tick.x = g.x;
  tick.x_c = x_c;
  tick.wall = in.wall;
  tick.friction_wall = in.friction_wall;
  tick.cuts = live(Effect::kCutting);
  tick.cut_reach = scene_.layers[static_cast<std::size_t>(in.layer)].cutting_force_N / stiffness;
  tick.ruptured = (out.flags & kFlagRupture) != 0;
  for (const Membrane& membrane : in.membranes)
    tick.membranes.push_back({membrane.met, membrane.ruptured, membrane.place_m});

  const ReferenceCutMemory::Released released = cuts_.step(tick);
  in.wall = tick.wall;
  in.friction_wall = tick.friction_wall;
  for (std::size_t i = 0; i < in.membranes.size(); ++i) in.membranes[i].ruptured = tick.membranes[i].open;
  if (released.membrane) out.flags |= kFlagRupture;
  if (released.wall) out.flags |= kFlagLayerChange;
  if (released.undecided) undecided_ |= kFlagLayerChange;

  const double before = out.cutting_N + out.puncture_N;
  if (const double stretch = tick.x_c - in.wall; live(Effect::kCutting) && stretch > 0)
    out.cutting_N = -stiffness * stretch;
  out.puncture_N = 0;
  puncture(in, g, out);
  return out.cutting_N + out.puncture_N - before;
}

// "Orientation limit": "θ_l ← max(α(d_t), min(θ_l, θ)). For θ > θ_l the torque is min(k_θ(θ − θ_l), τ_max)
// about the unit vector along axis × u0"
void ReferenceEngine::tilt(Insertion& in, const Geometry& g, Vec3 axis, StepReport& out) {
  const double theta = angleBetween(axis, in.u0);
  in.tilt_limit = std::max(cone(g.d_t), std::min(in.tilt_limit, theta));
  if (planted_ == Defect::kAlphaWithoutState) in.tilt_limit = cone(g.d_t);  // planted
  if (std::abs(theta - in.tilt_limit) < undecidedBelow(in)) undecided_ |= kFlagTorque;
  if (!live(Effect::kOrientationLimit) || !(theta > in.tilt_limit)) return;
  const Vec3 about = cross(axis, in.u0);
  if (norm(about) < 1e-9) return;
  const OrientationLimitSpec& spec = scene_.orientation_limit;
  const double torque = std::min(spec.stiffness_Nm_per_rad * (theta - in.tilt_limit), spec.max_torque_Nm);
  if (!(torque > 0)) return;
  out.wrench_W.torque_Nm = normalized(about) * torque;
  out.flags |= kFlagTorque;
}

}  // namespace needlelab::test
