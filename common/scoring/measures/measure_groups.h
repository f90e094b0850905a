/// The groups of measures and their common input. Private to common/scoring.
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

  /// The duration of sample `i` in s: half of the time to each neighbour in its run. 0 for a single sample.
  [[nodiscard]] double weight_s(std::size_t i) const;
};

/// In W.
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

/// Collects rows.
class Rows {
 public:
  /// Adds a row with the unit and words of measure_table.h; `words` replaces the table's words, e.g. with a
  /// layer's name. Adds no row if the value is not finite or the name is not in the table (asserted).
  void add(std::string name, double value, std::string words = {});
  std::vector<Measure> take() { return std::move(rows_); }

 private:
  std::vector<Measure> rows_;
};

void addMotion(const Gesture& gesture, Rows& rows);   ///< time, path, speed, smoothness
void addActions(const Gesture& gesture, Rows& rows);  ///< movements, turns, work against clamping

/// Measures computed from the samples themselves. All groups share one pass, so that the recording is not
/// decoded for each.
class SampleGroup {
 public:
  SampleGroup() = default;
  SampleGroup(const SampleGroup&) = delete;
  SampleGroup& operator=(const SampleGroup&) = delete;
  virtual ~SampleGroup() = default;

  /// Takes sample `i` of the gesture. Call it once for each sample, in order.
  virtual void add(std::size_t i) = 0;
  /// After the last sample: reads some of them again, in steps. Returns true when done.
  virtual bool finish(StepWork& /*work*/) { return true; }
  /// Call when done.
  virtual void addRows(Rows& rows) const = 0;
};
/// In the order of their rows: depth, forces and events of the needle in tissue; target and hazards; errors
/// against the plan, if there is one. `gesture` must outlive them.
std::vector<std::unique_ptr<SampleGroup>> sampleGroups(const Gesture& gesture);

/// Aspirations and injections.
void addSyringe(const Gesture& gesture, std::span<const pb::SyringeEvent> events, Rows& rows);

/// Adds the distance from the nearest reference gesture.
void addReferences(const Gesture& gesture, const Pose& X_WL, std::span<const TipPath> references, Rows& rows);

/// Fills min, max, passed and the sentence of every row; adds rows for requirements on measures that the
/// gesture does not have. `layer_names`: the profile's.
void applyRequirements(const pb::Exercise* exercise, std::span<const std::string> layer_names,
                       std::vector<Measure>& measures);

}  // namespace needlelab
