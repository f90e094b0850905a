#include "client/sim/stability/passivity_gesture.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string>

#include "client/device/hand.h"

namespace needlelab {
namespace {

double onGrid(double value, double step) {
  return step > 0 ? std::floor(value / step + 0.5) * step : value;
}

// the tip's pose where a stroke ends
Pose poseOf(const PassivityStroke& stroke) {
  return {{stroke.x_m, stroke.y_m, -stroke.depth_m}, orientationAlong({stroke.tilt_x, stroke.tilt_y, -1})};
}

}  // namespace

HandPlan planOf(const PassivityGesture& gesture) {
  HandPlan plan(poseOf(gesture.start));
  for (const PassivityStroke& stroke : gesture.strokes) {
    const Pose to = poseOf(stroke);
    if (to == plan.end().X_WT)
      plan.hold(stroke.seconds);
    else
      plan.moveIn(to, stroke.seconds, Motion::kMinJerk);
  }
  return plan;
}

std::vector<TipSample> samplesOf(const HandPlan& plan, double rate_hz) {
  const auto ticks = static_cast<std::size_t>(std::floor(plan.duration_s() * rate_hz + 0.5)) + 1;
  std::vector<TipSample> samples;
  samples.reserve(ticks);
  for (std::size_t k = 0; k < ticks; ++k) {
    const Pose pose = plan.at(static_cast<double>(k) / rate_hz).X_WT;
    samples.push_back({pose.p, pose.q});
  }
  return samples;
}

std::vector<TipSample> samplesOf(const PassivityGesture& gesture) {
  auto samples = samplesOf(planOf(gesture), gesture.rate_hz);
  HandTremor tremor(gesture.tremor_m, gesture.tremor_seed, 1 / gesture.rate_hz);
  for (TipSample& sample : samples) {
    const Vec3 p = sample.p_WT_m + tremor.next();
    const double step = gesture.encoder_step_m;
    sample.p_WT_m = {onGrid(p.x, step), onGrid(p.y, step), onGrid(p.z, step)};
  }
  return samples;
}

double roundedTo(double value, int digits) {
  // through text, so that the result is the double that reading "0.0123" gives
  std::array<char, 40> text{};
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::scientific, digits - 1)
          .ptr;
  double rounded = 0;
  std::from_chars(text.data(), end, rounded);
  return rounded;
}

LimbShape shapeOf(std::uint64_t seed) {
  return static_cast<LimbShape>(seed % 3);
}

namespace {

constexpr std::uint64_t kStagesSeed = 1'000'000'007;  // far from the seeds of scenes
constexpr double kMinJerkPeak = 1.875;                // greatest over mean speed of a minimum-jerk move

// a draw a statement: the order in which arguments are evaluated is the compiler's choice
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : random_(seed) {}
  double in(double low, double high) { return roundedTo(low + (high - low) * random_.uniform(), 3); }
  bool chance(double share) { return random_.uniform() < share; }
  int whole(int low, int high) {
    return low + static_cast<int>(random_.next() % static_cast<std::uint64_t>(high - low + 1));
  }
  std::uint64_t bits() { return random_.next(); }

 private:
  HandRandom random_;
};

void put(pb::Vector3& to, double x, double y, double z) {
  to.set_x(x);
  to.set_y(y);
  to.set_z(z);
}

void drawLimb(Draw& draw, LimbShape shape, pb::Limb& limb) {
  if (shape == LimbShape::kPlane) {
    put(*limb.mutable_plane()->mutable_point_m(), 0, 0, 0);
    put(*limb.mutable_plane()->mutable_normal(), 0, 0, 1);
  } else if (shape == LimbShape::kSphere) {
    const double radius = draw.in(0.03, 0.1);
    put(*limb.mutable_sphere()->mutable_center_m(), 0, 0, -radius);
    limb.mutable_sphere()->set_radius_m(radius);
  } else {
    const double radius = draw.in(0.03, 0.06);
    put(*limb.mutable_capsule()->mutable_a_m(), -0.1, 0, -radius);
    put(*limb.mutable_capsule()->mutable_b_m(), 0.1, 0, -radius);
    limb.mutable_capsule()->set_radius_m(radius);
  }
}

void drawLayer(Draw& draw, pb::Layer& layer) {
  layer.set_tissue(pb::Layer::OTHER);
  layer.set_thickness_m(draw.in(0.003, 0.015));
  layer.set_cutting_force_n(draw.in(0.2, 4));
  layer.set_attracted_force_n(draw.in(0, 0.8));
  layer.set_rejection_force_n(
      roundedTo(std::min({0.15, 0.5 * layer.cutting_force_n(), 0.5 * layer.attracted_force_n()}), 3));
  layer.set_lateral_stiffness_n_per_m2(draw.in(1000, 15000));
  layer.set_friction_n_per_m(draw.in(2, 30));
  if (!draw.chance(0.5)) return;
  // ruptures within its layer, at most 300 N/m on the way there
  auto& membrane = *layer.mutable_puncture();
  membrane.set_linear_n_per_m(draw.in(100, 250));
  membrane.set_quadratic_n_per_m2(draw.chance(0.5) ? draw.in(1000, 20'000) : 0.0);
  membrane.set_force_n(roundedTo(draw.in(0.2, 0.95) * membrane.linear_n_per_m() * layer.thickness_m(), 3));
}

// all of them; or any set; or one alone, so that no other effect hides its energy
void drawEffects(Draw& draw, double all_share, pb::Profile& profile) {
  const bool all = draw.chance(all_share), alone = draw.chance(0.5);
  constexpr int kFirst = 1, kLast = static_cast<int>(kPlacedEffectCount);  // stages: see below
  const int only = draw.whole(kFirst, kLast);
  for (int effect = kFirst; effect <= kLast; ++effect)
    if (const bool drawn = draw.chance(0.5); all || effect == only || (drawn && !alone))
      profile.add_effects(static_cast<pb::Profile::Effect>(effect));
}

void drawScene(Draw& draw, LimbShape shape, const GestureRange& range, pb::Profile& profile) {
  profile.mutable_needle()->set_length_m(draw.in(0.03, 0.09));
  drawLimb(draw, shape, *profile.mutable_limb());
  const int layers = draw.whole(1, 6);
  for (int i = 0; i < layers; ++i) drawLayer(draw, *profile.add_layers());

  auto& wall = *profile.mutable_tracking_wall();
  wall.set_stiffness_n_per_m(draw.in(200, 600));
  wall.set_stop_speed_m_s(draw.in(0.002, 0.006));
  wall.set_stop_dwell_s(draw.in(0.02, 0.1));
  wall.set_stop_duration_s(draw.in(0.2, 1));
  wall.set_stop_mode(draw.chance(0.7) ? pb::TrackingWall::RAMP : pb::TrackingWall::EXPONENTIAL);
  wall.set_relax_time_s(draw.in(0.2, 2));
  wall.set_relax_residual(draw.in(0, 1));

  auto& fixture = *profile.mutable_virtual_fixture();
  fixture.set_max_stiffness_n_per_m(draw.in(50, 400));
  fixture.set_max_force_n(draw.in(0.5, 4));
  fixture.set_mode(range.clamping == ClampingMode::kConservative ? pb::VirtualFixture::CONSERVATIVE
                                                                 : pb::VirtualFixture::PROPORTIONAL);
  profile.mutable_orientation_limit()->set_stiffness_nm_per_rad(draw.in(0.1, 2));
  profile.mutable_orientation_limit()->set_max_torque_nm(draw.in(0.05, 0.2));
  profile.mutable_shaft_friction()->set_stiffness_n_per_m(draw.in(60, 200));
  profile.set_max_force_n(10);
  drawEffects(draw, range.all_effects_share, profile);
}

// a bone under the first layer or deeper; under a plane it slants, at times to the skin
void drawBone(Draw& draw, pb::Profile& profile) {
  if (profile.layers_size() < 2) drawLayer(draw, *profile.add_layers());
  auto& layer = *profile.mutable_layers(draw.whole(1, profile.layers_size() - 1));
  layer.set_tissue(pb::Layer::BONE);
  auto& bone = *profile.mutable_bone();
  bone.set_stiffness_n_per_m(draw.in(200, 1000));
  bone.set_friction_coefficient(draw.chance(0.3) ? 0.0 : draw.in(0, 1));
  if (!profile.limb().has_plane() || draw.chance(0.3)) return;
  const double slope_x = draw.in(-1, 1), slope_y = draw.in(-1, 1);
  put(*bone.mutable_normal(), slope_x, slope_y, 1);
}

// The stages, from draws of their own: a seed's scene and strokes stay what they are without them. A
// prescribed motion presses a bone by up to 40 mm: the cap, which may turn a sum of forces, is out of the
// way.
void drawStages(std::uint64_t seed, pb::Profile& profile) {
  Draw draw(seed + kStagesSeed);
  if (draw.chance(0.6)) {
    profile.add_effects(pb::Profile::CUT_MEMORY);
    profile.mutable_cut_memory()->set_cutting_share(draw.in(0, 1));
    profile.mutable_cut_memory()->set_radius_m(draw.in(0.0003, 0.003));
  }
  if (!draw.chance(0.8)) return;
  profile.add_effects(pb::Profile::BONE);
  profile.set_max_force_n(50);
  drawBone(draw, profile);
}

// Draws strokes one after the other; each begins where the last one ended.
class StrokeDraw {
 public:
  StrokeDraw(Draw& draw, const GestureRange& range) : draw_(draw), range_(range) {}

  PassivityStroke start() {
    now_.kind = StrokeKind::kStart;
    now_.depth_m = draw_.in(-0.008, -0.001);
    tilt();
    return last_ = now_;
  }
  PassivityStroke next() {
    const bool inside = now_.depth_m > 0;
    if (!inside)
      draw_.chance(0.15) ? graze() : insert();
    else
      anyInside();
    timed(now_);
    return now_;
  }
  PassivityStroke exit() {
    now_.kind = StrokeKind::kExit;
    now_.depth_m = draw_.in(-0.01, -0.001);
    if (draw_.chance(0.3)) moveAside(0.3);
    timed(now_);
    return now_;
  }

 private:
  void anyInside() {
    using K = StrokeKind;
    constexpr std::array kKinds = {K::kInsert, K::kInsert, K::kHold, K::kRetreat, K::kRetreat,
                                   K::kAside,  K::kTilt,   K::kWide, K::kInsert,  K::kExit};
    constexpr std::size_t kSlanting = 8;  // deeper along a slant, the needle turning too
    const auto drawn = static_cast<std::size_t>(draw_.whole(0, 9));
    now_.kind = kKinds[drawn];
    if (drawn < 2) return insert();
    if (now_.kind == K::kRetreat) now_.depth_m = roundedTo(now_.depth_m * draw_.in(0, 1), 3);
    if (drawn == kSlanting) now_.depth_m = draw_.in(0.001, range_.most_depth_m);
    if (drawn == kSlanting) moveAside(0.7);
    if (now_.kind == K::kAside) moveAside(0.5);
    if (now_.kind == K::kWide) moveAside(1);
    if (now_.kind == K::kTilt || drawn == kSlanting) tilt();
    if (now_.kind == K::kExit) now_.depth_m = draw_.in(-0.006, -0.0005);
  }
  // deeper, along the needle's axis more often than not
  void insert() {
    now_.kind = StrokeKind::kInsert;
    const double before = now_.depth_m;
    now_.depth_m = draw_.chance(0.3) ? draw_.in(0.0005, 0.006) : draw_.in(0.001, range_.most_depth_m);
    const double way = now_.depth_m - before;
    if (std::abs(now_.tilt_x) + std::abs(now_.tilt_y) < 1.5 && draw_.chance(0.7)) {
      now_.x_m = within(now_.x_m + now_.tilt_x * way);
      now_.y_m = within(now_.y_m + now_.tilt_y * way);
    }
  }
  // along the skin, the needle nearly in it
  void graze() {
    now_.kind = StrokeKind::kGraze;
    now_.tilt_x = (draw_.chance(0.5) ? 1 : -1) * draw_.in(5.7, 14.3);  // 80-86°
    now_.tilt_y = draw_.in(-1, 1);
    const double way = draw_.in(0.005, 0.03);
    now_.x_m = within(now_.x_m + std::copysign(way, now_.tilt_x));
    now_.depth_m = draw_.in(0.0002, 0.004);
  }
  [[nodiscard]] double within(double aside_m) const {
    return roundedTo(std::clamp(aside_m, -range_.most_aside_m, range_.most_aside_m), 3);
  }
  void moveAside(double share) {
    const double most = share * range_.most_aside_m;
    now_.x_m = draw_.in(-most, most);
    now_.y_m = draw_.in(-most, most);
  }
  void tilt() {
    const double most = draw_.chance(0.5) ? 0.0 : range_.most_tilt;
    now_.tilt_x = draw_.in(-most, most);
    now_.tilt_y = draw_.in(-most, most);
  }
  // slow, brisk or a rest; never faster than the range allows
  void timed(PassivityStroke& stroke) {
    const double drawn = draw_.chance(0.3) ? draw_.in(0.5, 2) : draw_.in(0.05, 0.6);
    const Vec3 way{stroke.x_m - last_.x_m, stroke.y_m - last_.y_m, stroke.depth_m - last_.depth_m};
    const double least_s = kMinJerkPeak * norm(way) / range_.most_speed_mps;
    const double turn = std::abs(stroke.tilt_x - last_.tilt_x) + std::abs(stroke.tilt_y - last_.tilt_y);
    const double least_turn_s = kMinJerkPeak * std::min(turn, 1.6) / range_.most_turn_radps;
    stroke.seconds = roundedTo(1.01 * std::max({drawn, least_s, least_turn_s}), 3);
    last_ = stroke;
  }

  Draw& draw_;
  const GestureRange& range_;
  PassivityStroke now_, last_;
};

}  // namespace

PassivityGesture randomGesture(std::uint64_t seed, LimbShape shape, const GestureRange& range) {
  Draw draw(seed);
  PassivityGesture gesture;
  gesture.profile.set_id(fmt::format("random-{}", seed));
  gesture.profile.set_name(fmt::format("Random scene {}", seed));
  drawScene(draw, shape, range, gesture.profile);
  if (range.stages) drawStages(seed, gesture.profile);
  gesture.tremor_m = draw.chance(0.5) ? draw.in(10e-6, 150e-6) : 0.0;
  gesture.tremor_seed = 1 + draw.bits() % 1000;
  gesture.encoder_step_m = draw.chance(0.5) ? 10e-6 : 0.0;
  StrokeDraw strokes(draw, range);
  gesture.start = strokes.start();
  const int count = draw.whole(range.fewest_strokes, range.most_strokes);
  for (int i = 0; i < count; ++i) gesture.strokes.push_back(strokes.next());
  gesture.strokes.push_back(strokes.exit());
  // tremor must not leave the tip in the tissue
  gesture.strokes.push_back({StrokeKind::kHold, gesture.strokes.back().x_m, gesture.strokes.back().y_m,
                             gesture.strokes.back().depth_m, gesture.strokes.back().tilt_x,
                             gesture.strokes.back().tilt_y, 0.02});
  return gesture;
}

}  // namespace needlelab
