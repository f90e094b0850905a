#include "common/scoring/measures.h"

#include <cassert>
#include <cmath>

#include "common/haptics/limits.h"
#include "common/scoring/groups.h"
#include "common/scoring/measure_table.h"
#include "common/scoring/syringe_events.h"

namespace needlelab {

void Rows::add(std::string name, double value, std::string words) {
  const MeasureKind* const kind = measureKind(name);
  assert(kind != nullptr);
  if (!std::isfinite(value) || kind == nullptr) return;
  Measure row;
  row.name = std::move(name);
  row.value = value + 0.0;  // −0 becomes 0
  row.unit = kind->unit;
  row.words = words.empty() ? std::string(kind->words) : std::move(words);
  rows_.push_back(std::move(row));
}

std::vector<Measure> scoreGesture(std::span<const GestureSample> samples, double rate_hz,
                                  const pb::Profile& profile, const Pose& X_WL, const pb::Exercise* exercise,
                                  std::span<const TipPath> references) {
  if (!(rate_hz >= kMinRateHz && rate_hz <= kMaxRateHz)) return {};
  std::vector<GestureSample> storage;
  const std::span<const GestureSample> usable = cleaned(samples, storage);
  const Gesture gesture{usable, rate_hz, runsOf(usable, rate_hz), anatomyOf(profile, X_WL), &profile};
  Rows rows;
  addMotion(gesture, rows);
  addActions(gesture, rows);
  addTissue(gesture, rows);
  addAim(gesture, rows);
  addSyringe(gesture, syringeEvents(usable, rate_hz, profile, X_WL), rows);
  addReferences(gesture, X_WL, references, rows);
  std::vector<Measure> measures = rows.take();
  applyRequirements(exercise, measures);
  return measures;
}

}  // namespace needlelab
