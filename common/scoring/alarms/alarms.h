/// Alarms of a lesson: one table for the trainee's window, tones, the instructor's tile, marks, and reports.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/haptics/geometry.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/anatomy/bone_contacts.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Most urgent first.
enum class Alarm : std::uint8_t { kFault, kHazard, kBone, kForce, kDepth, kDevice, kTime };

/// To add an alarm, add a row.
struct AlarmKind {
  Alarm alarm;
  std::string_view name;  ///< in messages and options: "hazard"
  std::string_view word;  ///< for a screen read from two metres: "HAZARD"
  bool of_gesture;        ///< found in the samples; hidden from the trainee without the aid ALARMS
  bool danger;            ///< true: red, with a tone by default; false: orange
};
std::span<const AlarmKind> alarmKinds();
const AlarmKind& kindOf(Alarm alarm);

/// An ongoing alarm.
struct ActiveAlarm {
  Alarm alarm = Alarm::kHazard;
  std::string detail;  ///< "axillary nerve", "5.2 N, allowed 4.5 N"
  friend bool operator==(const ActiveAlarm&, const ActiveAlarm&) = default;
};

/// How often an alarm began since the start of the lesson, and whether it is ongoing.
struct AlarmCount {
  Alarm alarm = Alarm::kHazard;
  std::uint32_t begun = 0;
  bool now = false;
  std::string detail;  ///< of the ongoing one, otherwise of the first
};

/// An alarm stays this long after its cause, so that a person can read it; the same cause within that time
/// is the same alarm.
inline constexpr double kAlarmLasts_s = 1;
/// The force limit if the exercise has none on `peak_force_n`.
inline constexpr double kUsualForceLimit_N = 8;
/// How far below its lowest target a tip is too deep if the exercise has no limit on `greatest_depth_m`.
inline constexpr double kTooDeep_m = 0.005;

/// The limits that raise an alarm when exceeded; infinite: never.
struct AlarmLimits {
  double force_N = std::numeric_limits<double>::infinity();
  double depth_m = std::numeric_limits<double>::infinity();  ///< of the tip under the surface
};
/// The limits of a lesson: the exercise's, or the defaults above. `exercise` may be null.
AlarmLimits alarmLimitsOf(const Anatomy& anatomy, const pb::Exercise* exercise);

/// The data of a tick that alarms need.
struct AlarmTick {
  double time_s = 0;  ///< ascending
  double force_N = 0;
  bool inside = false;  ///< the tip is in tissue; otherwise the members below are meaningless
  Vec3 tip_W_m, skin_W_m;
  int layer = -1;
  bool hub_on_skin = false;
};

/// Finds the alarms of a gesture. Costs about 10 ns per tick and hazard while the tip is in tissue.
/// Thread: one.
class GestureAlarms {
 public:
  GestureAlarms() = default;  ///< none
  /// `anatomy`: the profile's.
  GestureAlarms(const pb::Profile& profile, const Anatomy& anatomy, const AlarmLimits& limits);

  /// Takes the next tick; returns the alarms that begin in it, valid until the next call. A time earlier than
  /// the last one begins another gesture.
  std::span<const ActiveAlarm> add(const AlarmTick& tick);
  /// The ongoing alarms, most urgent first; hazards in the profile's order, bones among them as kBone.
  [[nodiscard]] std::vector<ActiveAlarm> now() const;
  /// One row for each alarm that began at least once, most urgent first.
  [[nodiscard]] std::vector<AlarmCount> counts() const;
  void restart();

 private:
  struct State {
    Alarm alarm;
    std::string name;  ///< the hazard's; "" for others
    std::optional<double> until_s = std::nullopt;
    double worst = 0;
    std::uint32_t begun = 0;
  };
  void check(std::size_t state, bool on, double worst = 0);
  [[nodiscard]] std::string detailOf(const State& state) const;

  Anatomy anatomy_;
  std::vector<Region> hazards_;  ///< without bones
  BoneContacts bones_;
  AlarmLimits limits_;
  std::vector<State> states_;  ///< a row for each hazard, then bone, force, depth, hub
  double time_s_ = 0;
  std::vector<ActiveAlarm> begun_;
};

}  // namespace needlelab
