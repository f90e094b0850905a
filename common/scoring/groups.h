/// The groups of measures, one file each, and what they all read. Private to this folder.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"
#include "scoring/anatomy.h"
#include "scoring/measures.h"
#include "scoring/track.h"

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
  /// `words` is the measure as a person would call it, e.g. "Peak force". Values that are not finite make no
  /// row.
  void add(std::string name, double value, std::string unit, std::string words);
  std::vector<Measure> take() { return std::move(rows_); }

 private:
  std::vector<Measure> rows_;
};

void addMotion(const Gesture& gesture, Rows& rows);  ///< time, path, speed, smoothness
void addTissue(const Gesture& gesture, Rows& rows);  ///< depth, forces, what the needle did in tissue
void addAim(const Gesture& gesture, Rows& rows);     ///< target and hazards
/// Aspirations and injections.
void addSyringe(const Gesture& gesture, std::span<const pb::SyringeEvent> events, Rows& rows);

/// Fills min, max, passed and the sentence of every row; adds rows for requirements on what was not measured.
void applyRequirements(const pb::Exercise* exercise, std::vector<Measure>& measures);

/// A value as a person reads it: "3.2 N", "12.4 mm", "0.35 m", "8.1 cm²".
std::string valueText(double value, const std::string& unit);

}  // namespace needlelab
