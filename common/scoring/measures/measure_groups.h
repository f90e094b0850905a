/// What measures are computed from: a gesture, and the facts that its groups find. Private to common/scoring.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/profile/planned_line.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/motion/dtw.h"
#include "common/scoring/motion/recorded_samples.h"
#include "common/scoring/motion/track.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// One gesture, prepared once.
struct Gesture {
  const RecordedSamples& samples;  ///< may be empty
  double rate_hz = 0;
  std::vector<Run> runs;
  Anatomy anatomy;
  const pb::Profile* profile = nullptr;
  std::optional<PlannedLine> plan_W;  ///< the exercise's, if it has one
  double dwell_s = 0;                 ///< how long the tip must stay in a target to reach it

  /// The duration of sample `i` in s: half of the time to each neighbour in its run. 0 for a single sample.
  [[nodiscard]] double weight_s(std::size_t i) const;
};

/// The tip in W.
inline Vec3 tipOf(const GestureSample& s) {
  return {s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]};
}

/// The furthest point of the last insertion: the needle's place before withdrawal. Takes the samples in
/// order.
class FinalPoint {
 public:
  void add(const GestureSample& sample, std::size_t i) {
    const bool inside = isInside(sample);
    if (inside && (!was_inside_ || sample.insertion_m >= furthest_m_)) {
      index = i;
      furthest_m_ = sample.insertion_m;
    }
    was_inside_ = inside;
  }
  std::optional<std::size_t> index;  ///< empty: never in tissue

 private:
  bool was_inside_ = false;
  double furthest_m_ = 0;
};

/// Forces while the tip was in a layer.
struct LayerFacts {
  double peak_N = 0;
  double impulse_Ns = 0, weight_s = 0;  ///< the mean is their quotient
};

/// What is found once for all measures of a gesture. The groups say how; the rows in measure_rows.cpp take
/// their values from here or from `gesture`.
struct GestureFacts {
  const Gesture* gesture = nullptr;

  // the motion (findMotion)
  double elapsed_s = 0, path_m = 0, path_in_m = 0, time_s = 0, time_in_s = 0, peak_mps = 0, swept_m2 = 0;
  std::optional<double> sparc, ldlj;
  int movements = 0, turns = 0;  // (findActions)

  std::optional<double> needle_s;  ///< since the uncapped needle's first contact; empty: there was none

  // holes: gaps of more than kLongestBridge_s between samples
  double missing_s = 0;             ///< their time
  std::optional<bool> ends_inside;  ///< the last sample is in tissue; empty: none is
  bool incomplete = false;          ///< one began or ended in tissue, or was long enough for an insertion

  // the needle in tissue
  double depth_m = 0, insertion_m = 0, lateral_m = 0, peak_N = 0;
  double impulse_Ns = 0, weight_s = 0;
  std::vector<LayerFacts> layers;
  GestureScore::LatePaths late_paths;
  int entries = 0, withdrawals = 0, trajectory_changes = 0;
  std::optional<double> inefficiency;

  // hazards and target; empty: the patient has none, or the needle was never in tissue
  std::vector<std::string> hazards_touched;  ///< their names
  int bone_contacts = 0, hub_contacts = 0;
  std::optional<bool> target_reached;
  std::optional<double> at_target_s, target_distance_m, target_nearest_m;

  // the plan; empty: the exercise has none, or the needle was never in tissue
  std::optional<double> planned_entry_m, planned_angle_rad, planned_line_m;
  double planned_line_ms = 0;  ///< over `weight_s`: the mean distance

  bool has_landmark = false;
  std::optional<double> landmark_s;  ///< empty: it has none, or it was not found

  // the syringe (findSyringe)
  int aspirations = 0, injections = 0;
  double injected = 0, injected_in_target = 0;
  std::optional<bool> aspirated_before;  ///< empty: no injection in tissue

  // the references (findNearest)
  std::optional<double> expert_path_m;
};

void findMotion(GestureFacts& facts);   ///< time, path, speed, smoothness
void findActions(GestureFacts& facts);  ///< movements, turns

/// Facts that come from the samples themselves. All groups share one pass, so that the recording is not
/// decoded for each.
class SampleGroup {
 public:
  SampleGroup() = default;
  SampleGroup(const SampleGroup&) = delete;
  SampleGroup& operator=(const SampleGroup&) = delete;
  virtual ~SampleGroup() = default;

  /// Takes sample `i` of the gesture. Call it once for each sample, in order.
  virtual void add(std::size_t i) = 0;
  /// After the last sample: reads some of them again, in steps, and completes the facts. Returns true when
  /// done.
  virtual bool finish(StepWork& work) = 0;
};
/// Depth, forces and events of the needle in tissue; target and hazards; errors against the plan, if there is
/// one. `facts`, with its gesture, must outlive them; they fill it.
std::vector<std::unique_ptr<SampleGroup>> sampleGroups(GestureFacts& facts);

/// Aspirations and injections.
void findSyringe(std::span<const pb::SyringeEvent> events, GestureFacts& facts);

/// The distance from the nearest reference gesture.
void findNearest(const Pose& X_WL, std::span<const TipPath> references, GestureFacts& facts);

/// The measures that the gesture has, in the table's order; `layer_names`: the profile's.
std::vector<Measure> measuresOf(const GestureFacts& facts, std::span<const std::string> layer_names);

/// Fills min, max, passed and the sentence of every row; adds rows for requirements on measures that the
/// gesture does not have, with the reason by `facts`. `layer_names`: the profile's.
void applyRequirements(const pb::Exercise* exercise, const GestureFacts& facts,
                       std::span<const std::string> layer_names, std::vector<Measure>& measures);

}  // namespace needlelab
