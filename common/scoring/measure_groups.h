/// The groups of measures and what they all read. Private to this folder.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "common/scoring/anatomy.h"
#include "common/scoring/dtw.h"
#include "common/scoring/measure_table.h"
#include "common/scoring/measures.h"
#include "common/scoring/track.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// One gesture, prepared once.
struct Gesture {
  std::span<const GestureSample> samples;  ///< cleaned, may be empty
  double rate_hz = 0;
  std::vector<Run> runs;
  Anatomy anatomy;
  const pb::Profile* profile = nullptr;

  /// How long sample `i` lasted, in s: half of the time to each neighbour in its run. 0 for a lonely sample.
  [[nodiscard]] double weight_s(std::size_t i) const;
};

/// Collects rows.
class Rows {
 public:
  /// Unit and words are those of measure_table.h; `words`: in place of those, e.g. with a layer's tissue.
  /// Values that are not finite make no row, and names that the table does not have neither (asserted).
  void add(std::string name, double value, std::string words = {});
  std::vector<Measure> take() { return std::move(rows_); }

 private:
  std::vector<Measure> rows_;
};

void addMotion(const Gesture& gesture, Rows& rows);   ///< time, path, speed, smoothness
void addActions(const Gesture& gesture, Rows& rows);  ///< movements, turns, work against clamping
void addTissue(const Gesture& gesture, Rows& rows);   ///< depth, forces, what the needle did in tissue
void addAim(const Gesture& gesture, Rows& rows);      ///< target and hazards
/// Aspirations and injections.
void addSyringe(const Gesture& gesture, std::span<const pb::SyringeEvent> events, Rows& rows);

/// How far from the nearest reference gesture.
void addReferences(const Gesture& gesture, const Pose& X_WL, std::span<const TipPath> references, Rows& rows);
TipPath tipPathOf(const Gesture& gesture, const Pose& X_WL);

/// Fills min, max, passed and the sentence of every row; adds rows for requirements on what was not measured.
void applyRequirements(const pb::Exercise* exercise, std::vector<Measure>& measures);

}  // namespace needlelab
