#include "client/sim/stability/gestures/passivity_gesture.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "client/device/hand/hand.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

double onGrid(double value, double step) {
  return step > 0 ? std::floor(value / step + 0.5) * step : value;
}

// The tip's pose at the end of a stroke.
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
  // via text, to get the same double as reading "0.0123" would
  std::array<char, 40> text{};
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::scientific, digits - 1)
          .ptr;
  double rounded = 0;
  std::from_chars(text.data(), end, rounded);
  return rounded;
}

namespace {

constexpr std::uint64_t kStagesSeed = 1'000'000'007;  // far from the seeds of scenes
constexpr double kMinJerkPeak = 1.875;                // maximum over mean speed of a minimum-jerk move
constexpr double kMaxDepth_m = 0.045, kMaxAside_m = 0.012, kMaxSpeed_mps = 0.15, kMaxTurn_radps = 6;
constexpr double kMaxTilt = 0.9;  // tangent; grazing strokes use 80-86° regardless
constexpr int kFewestStrokes = 3, kMaxStrokes = 12;

// One draw per statement, because the evaluation order of arguments is unspecified.
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

void drawLimb(Draw& draw, std::uint64_t seed, pb::Limb& limb) {
  if (seed % 3 == 0) {
    put(*limb.mutable_plane()->mutable_point_m(), 0, 0, 0);
    put(*limb.mutable_plane()->mutable_normal(), 0, 0, 1);
  } else if (seed % 3 == 1) {
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
  // ruptures within its layer, with at most 300 N/m before that
  auto& membrane = *layer.mutable_puncture();
  membrane.set_linear_n_per_m(draw.in(100, 250));
  membrane.set_quadratic_n_per_m2(draw.chance(0.5) ? draw.in(1000, 20'000) : 0.0);
  membrane.set_force_n(roundedTo(draw.in(0.2, 0.95) * membrane.linear_n_per_m() * layer.thickness_m(), 3));
}

// All effects, or any set, or only one, so that no other effect hides its energy.
void drawEffects(Draw& draw, pb::Profile& profile) {
  constexpr double kAllShare = 0.7;
  const bool all = draw.chance(kAllShare), alone = draw.chance(0.5);
  constexpr int kFirst = 1, kLast = static_cast<int>(kPlacedEffectCount);  // for stages see below
  const int only = draw.whole(kFirst, kLast);
  for (int effect = kFirst; effect <= kLast; ++effect)
    if (const bool drawn = draw.chance(0.5); all || effect == only || (drawn && !alone))
      profile.add_effects(numberOfEffect(static_cast<Effect>(effect - 1)));
}

void drawScene(Draw& draw, std::uint64_t seed, ClampingMode clamping, pb::Profile& profile) {
  profile.mutable_needle()->set_length_m(draw.in(0.03, 0.09));
  drawLimb(draw, seed, *profile.mutable_limb());
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
  fixture.set_mode(clamping == ClampingMode::kConservative ? pb::VirtualFixture::CONSERVATIVE
                                                           : pb::VirtualFixture::PROPORTIONAL);
  profile.mutable_orientation_limit()->set_stiffness_nm_per_rad(draw.in(0.1, 2));
  profile.mutable_orientation_limit()->set_max_torque_nm(draw.in(0.05, 0.2));
  profile.mutable_shaft_friction()->set_stiffness_n_per_m(draw.in(60, 200));
  profile.set_max_force_n(10);
  drawEffects(draw, profile);
}

// A bone below the first layer or deeper; under a plane it slants, sometimes up to the skin.
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

// The stages use their own draws, so a seed's scene and strokes do not change without them. A prescribed
// motion presses a bone by up to 40 mm, so the cap, which may rotate a sum of forces, is set high.
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

// Draws strokes one after the other; each starts where the previous one ended.
class StrokeDraw {
 public:
  explicit StrokeDraw(Draw& draw) : draw_(draw) {}

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
    constexpr std::size_t kSlanting = 8;  // deeper along a slant, with the needle turning too
    const auto drawn = static_cast<std::size_t>(draw_.whole(0, 9));
    now_.kind = kKinds[drawn];
    if (drawn < 2) return insert();
    if (now_.kind == K::kRetreat) now_.depth_m = roundedTo(now_.depth_m * draw_.in(0, 1), 3);
    if (drawn == kSlanting) now_.depth_m = draw_.in(0.001, kMaxDepth_m);
    if (drawn == kSlanting) moveAside(0.7);
    if (now_.kind == K::kAside) moveAside(0.5);
    if (now_.kind == K::kWide) moveAside(1);
    if (now_.kind == K::kTilt || drawn == kSlanting) tilt();
    if (now_.kind == K::kExit) now_.depth_m = draw_.in(-0.006, -0.0005);
  }
  // Goes deeper, mostly along the needle's axis.
  void insert() {
    now_.kind = StrokeKind::kInsert;
    const double before = now_.depth_m;
    now_.depth_m = draw_.chance(0.3) ? draw_.in(0.0005, 0.006) : draw_.in(0.001, kMaxDepth_m);
    const double way = now_.depth_m - before;
    if (std::abs(now_.tilt_x) + std::abs(now_.tilt_y) < 1.5 && draw_.chance(0.7)) {
      now_.x_m = within(now_.x_m + now_.tilt_x * way);
      now_.y_m = within(now_.y_m + now_.tilt_y * way);
    }
  }
  // Moves along the skin with the needle almost parallel to it.
  void graze() {
    now_.kind = StrokeKind::kGraze;
    now_.tilt_x = (draw_.chance(0.5) ? 1 : -1) * draw_.in(5.7, 14.3);  // 80-86°
    now_.tilt_y = draw_.in(-1, 1);
    const double way = draw_.in(0.005, 0.03);
    now_.x_m = within(now_.x_m + std::copysign(way, now_.tilt_x));
    now_.depth_m = draw_.in(0.0002, 0.004);
  }
  static double within(double aside_m) {
    return roundedTo(std::clamp(aside_m, -kMaxAside_m, kMaxAside_m), 3);
  }
  void moveAside(double share) {
    const double most = share * kMaxAside_m;
    now_.x_m = draw_.in(-most, most);
    now_.y_m = draw_.in(-most, most);
  }
  void tilt() {
    const double most = draw_.chance(0.5) ? 0.0 : kMaxTilt;
    now_.tilt_x = draw_.in(-most, most);
    now_.tilt_y = draw_.in(-most, most);
  }
  // Slow, brisk or resting; never faster than the range allows.
  void timed(PassivityStroke& stroke) {
    const double drawn = draw_.chance(0.3) ? draw_.in(0.5, 2) : draw_.in(0.05, 0.6);
    const Vec3 way{stroke.x_m - last_.x_m, stroke.y_m - last_.y_m, stroke.depth_m - last_.depth_m};
    const double min_s = kMinJerkPeak * norm(way) / kMaxSpeed_mps;
    const double turn = std::abs(stroke.tilt_x - last_.tilt_x) + std::abs(stroke.tilt_y - last_.tilt_y);
    const double min_turn_s = kMinJerkPeak * std::min(turn, 1.6) / kMaxTurn_radps;
    stroke.seconds = roundedTo(1.01 * std::max({drawn, min_s, min_turn_s}), 3);
    last_ = stroke;
  }

  Draw& draw_;
  PassivityStroke now_, last_;
};

}  // namespace

PassivityGesture randomGesture(std::uint64_t seed, const GestureRange& range) {
  Draw draw(seed);
  PassivityGesture gesture;
  gesture.profile.set_id(fmt::format("random-{}", seed));
  gesture.profile.set_name(fmt::format("Random scene {}", seed));
  drawScene(draw, seed, range.clamping, gesture.profile);
  if (range.stages) drawStages(seed, gesture.profile);
  gesture.tremor_m = draw.chance(0.5) ? draw.in(10e-6, 150e-6) : 0.0;
  gesture.tremor_seed = 1 + draw.bits() % 1000;
  gesture.encoder_step_m = draw.chance(0.5) ? 10e-6 : 0.0;
  StrokeDraw strokes(draw);
  gesture.start = strokes.start();
  const int count = draw.whole(kFewestStrokes, kMaxStrokes);
  for (int i = 0; i < count; ++i) gesture.strokes.push_back(strokes.next());
  gesture.strokes.push_back(strokes.exit());
  // tremor must not leave the tip in the tissue
  gesture.strokes.push_back({StrokeKind::kHold, gesture.strokes.back().x_m, gesture.strokes.back().y_m,
                             gesture.strokes.back().depth_m, gesture.strokes.back().tilt_x,
                             gesture.strokes.back().tilt_y, 0.02});
  return gesture;
}

namespace {

using nlohmann::json;

Error wrong(const std::string& field, const std::string& text) {
  return {ErrorCode::kInvalidInput, field + ": " + text};
}

Status readNumber(const json& value, const std::string& field, NumberRange range, double& to) {
  if (!value.is_number()) return wrong(field, value.dump() + " is not a number");
  if (!range.contains(value.get<double>())) return outOfRange(field, value.get<double>(), range);
  to = value.get<double>();
  return {};
}

// On input, `stroke` is the previous one.
Status readStroke(const json& value, const std::string& where, PassivityStroke& stroke, bool is_start) {
  if (!value.is_object()) return wrong(where, "is not an object");
  if (!is_start && !value.contains("seconds")) return wrong(where + ".seconds", "is missing");
  for (const auto& [name, number] : value.items()) {
    const std::string field = where + "." + name;
    if (name == "kind" && !is_start) {
      const auto* const kind =
          number.is_string() ? std::find(kStrokeNames.begin(), kStrokeNames.end(), number.get<std::string>())
                             : kStrokeNames.end();
      if (kind == kStrokeNames.end()) return wrong(field, number.dump() + " is not a kind of stroke");
      stroke.kind = static_cast<StrokeKind>(kind - kStrokeNames.begin());
      continue;
    }
    const auto* const known = std::find_if(kStrokeFields.begin(), kStrokeFields.end(),
                                           [&name = name](const StrokeField& f) { return f.name == name; });
    if (known == kStrokeFields.end() || (is_start && name == "seconds")) return wrong(field, "is unknown");
    RETURN_IF_ERROR(readNumber(number, field, known->range, stroke.*known->member));
  }
  return {};
}

}  // namespace

Status readMotion(const json& motion, const std::string& where, PassivityGesture& gesture) {
  if (!motion.is_object()) return wrong(where, "is not an object");
  gesture.strokes.clear();
  gesture.start = {};
  gesture.start.kind = StrokeKind::kStart;
  for (const auto& [name, value] : motion.items())
    if (name != "start" && name != "strokes") return wrong(where + "." + name, "is unknown");
  // each stroke starts where the previous one ended
  if (!motion.contains("start")) return wrong(where + ".start", "is missing");
  RETURN_IF_ERROR(readStroke(motion["start"], where + ".start", gesture.start, true));
  const auto strokes = motion.find("strokes");
  if (strokes == motion.end() || !strokes->is_array())
    return wrong(where + ".strokes", "is missing or no list");
  PassivityStroke stroke = gesture.start;
  for (std::size_t i = 0; i < strokes->size(); ++i) {
    stroke.kind = StrokeKind::kInsert;
    const std::string field = fmt::format("{}.strokes[{}]", where, i);
    RETURN_IF_ERROR(readStroke((*strokes)[i], field, stroke, false));
    gesture.strokes.push_back(stroke);
  }
  return {};
}

}  // namespace needlelab
