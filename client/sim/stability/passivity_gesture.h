/// A gesture as a person can read and write it: a scene and a few strokes of the needle's tip. The random
/// gestures of the passivity observer are made, shrunk and kept in this form.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "client/device/hand_plan.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// What a stroke was made for. It changes nothing in the motion: it lets a reader follow.
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

/// The tip's pose where a stroke ends.
Pose poseOf(const PassivityStroke& stroke);
/// The strokes as a plan for the simulated hand; a stroke to where the tip already is rests there.
HandPlan planOf(const PassivityGesture& gesture);
/// The motion tick by tick, tremor and encoder included. Deterministic.
std::vector<TipSample> samplesOf(const PassivityGesture& gesture);

}  // namespace needlelab
