/// A gesture in readable form: a scene and a few strokes of the needle's tip. Used for random gestures, the
/// motions of cases.json and stored counter-examples.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "client/device/hand/hand_plan.h"
#include "common/base/range.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"
#include "common/haptics/scene_spec.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// The purpose of a stroke, for readers only; it does not affect the motion.
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

/// Target of the tip and the needle's direction there. Depth runs along W's −z from W's origin, which lies on
/// the skin; the axis is (tilt_x, tilt_y, −1), normalised.
struct PassivityStroke {
  StrokeKind kind = StrokeKind::kInsert;
  double x_m = 0, y_m = 0, depth_m = 0;
  double tilt_x = 0, tilt_y = 0;  ///< tangents
  double seconds = 0;             ///< minimum-jerk motion from the previous stroke; more than 0
};

/// A scene and a prescribed motion in it. `profile`'s limb touches W's origin with its normal along +z.
struct PassivityGesture {
  pb::Profile profile;
  double rate_hz = 1000;
  double tremor_m = 0;  ///< peak per axis, 8-12 Hz
  std::uint64_t tremor_seed = 1;
  double encoder_step_m = 0;  ///< 0 = exact
  PassivityStroke start;      ///< its `seconds` is ignored
  std::vector<PassivityStroke> strokes;
};

/// The strokes as a plan for the simulated hand; a stroke without movement is a rest.
HandPlan planOf(const PassivityGesture& gesture);
/// The poses of a plan at each tick.
std::vector<TipSample> samplesOf(const HandPlan& plan, double rate_hz);
/// The motion at each tick, including tremor and encoder. Deterministic.
std::vector<TipSample> samplesOf(const PassivityGesture& gesture);

/// `value` rounded to at most `digits` (1-15) significant decimal digits: the double nearest to that decimal.
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

/// Reads `start` and `strokes` into `gesture`; the rest stays unchanged. Missing fields of a stroke are as in
/// the previous one. Errors: kInvalidInput naming field (prefixed by `where`), value and range; also for
/// unknown fields.
Status readMotion(const nlohmann::json& json, const std::string& where, PassivityGesture& gesture);

/// Settings besides the seed.
struct GestureRange {
  bool stages = false;  ///< also draws CUT_MEMORY and BONE; the rest of a seed's gesture stays the same
  ClampingMode clamping = ClampingMode::kConservative;
};

/// A random scene and gesture as of a hand with a needle: at most 0.15 m/s and 6 rad/s, 45 mm deep and 12 mm
/// aside; plane, sphere and capsule alternate by seed. Starts and ends outside. Numbers have three
/// significant digits, so that a file holds exactly the gesture that ran.
PassivityGesture randomGesture(std::uint64_t seed, const GestureRange& range = {});

}  // namespace needlelab
