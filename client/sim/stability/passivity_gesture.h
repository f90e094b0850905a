/// A gesture in a readable form: a scene and a few strokes of the needle's tip. Random gestures, the motions
/// of cases.json and kept counter-examples have this form.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "client/device/hand_plan.h"
#include "common/base/range.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"
#include "common/haptics/scene_spec.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// The purpose of a stroke. It changes nothing in the motion: it lets a reader follow.
enum class StrokeKind : std::uint8_t {
  kInsert,
  kHold,
  kRetreat,
  kAside,
  kTilt,
  kWide,
  kGraze,
  kExit,
  kStart
};
inline constexpr std::array<std::string_view, 9> kStrokeNames = {
    "insert", "hold", "retreat", "aside", "tilt", "wide", "graze", "exit", "start"};

/// Where the tip goes and how the needle stands there. Depth runs along W's −z from W's origin, which lies on
/// the skin; the axis is (tilt_x, tilt_y, −1), made a unit vector.
struct PassivityStroke {
  StrokeKind kind = StrokeKind::kInsert;
  double x_m = 0, y_m = 0, depth_m = 0;
  double tilt_x = 0, tilt_y = 0;  ///< tangents
  double seconds = 0;             ///< minimum-jerk motion from the stroke before; more than 0
};

/// A scene and a prescribed motion in it. `profile`'s limb touches W's origin with its normal along +z.
struct PassivityGesture {
  pb::Profile profile;
  double rate_hz = 1000;
  double tremor_m = 0;  ///< peak per axis, 8-12 Hz
  std::uint64_t tremor_seed = 1;
  double encoder_step_m = 0;  ///< 0 = exact
  PassivityStroke start;      ///< its `seconds` is not used
  std::vector<PassivityStroke> strokes;
};

/// The strokes as a plan for the simulated hand; a stroke to where the tip already is rests there.
HandPlan planOf(const PassivityGesture& gesture);
/// The poses of a plan, tick by tick.
std::vector<TipSample> samplesOf(const HandPlan& plan, double rate_hz);
/// The motion tick by tick, tremor and encoder included. Deterministic.
std::vector<TipSample> samplesOf(const PassivityGesture& gesture);

/// `value` with at most `digits` (1-15) significant decimal digits: the double nearest to that decimal.
double roundedTo(double value, int digits);

/// A stroke's fields in JSON.
struct StrokeField {
  std::string_view name;
  double PassivityStroke::*member;
  NumberRange range;
};
inline constexpr std::array<StrokeField, 6> kStrokeFields = {
    {{"x_m", &PassivityStroke::x_m, {-1, 1}},
     {"y_m", &PassivityStroke::y_m, {-1, 1}},
     {"depth_m", &PassivityStroke::depth_m, {-1, 1}},
     {"tilt_x", &PassivityStroke::tilt_x, {-1000, 1000}},
     {"tilt_y", &PassivityStroke::tilt_y, {-1000, 1000}},
     {"seconds", &PassivityStroke::seconds, {1e-3, 600}}}};

/// Reads `start` and `strokes` into `gesture`; all else of it stays. A stroke's fields that are left out are
/// as in the one before. Errors: kInvalidInput naming field, value and range, fields named from `where` on;
/// unknown fields are refused.
Status readMotion(const nlohmann::json& json, const std::string& where, PassivityGesture& gesture);

enum class LimbShape : std::uint8_t { kPlane, kSphere, kCapsule };
/// Limb of the random gesture with this seed: they take turns.
LimbShape shapeOf(std::uint64_t seed);

/// What gestures are drawn from. The ranges are those of a hand at a needle: speed at most 0.15 m/s.
struct GestureRange {
  double most_depth_m = 0.045, most_aside_m = 0.012;
  double most_speed_mps = 0.15, most_turn_radps = 6;
  double most_tilt = 0.9;          ///< tangent; grazing strokes lie at 80-86° whatever this says
  double all_effects_share = 0.7;  ///< the others have a random set of effects
  bool stages = false;             ///< draws CUT_MEMORY and BONE too; all else of a seed stays
  ClampingMode clamping = ClampingMode::kConservative;
  int fewest_strokes = 3, most_strokes = 12;
};

/// A random scene and gesture. Starts and ends outside. Numbers have three significant digits, so that the
/// file holds exactly the gesture that ran.
PassivityGesture randomGesture(std::uint64_t seed, LimbShape shape, const GestureRange& range = {});

}  // namespace needlelab
