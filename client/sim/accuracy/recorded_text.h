/// Words and figures that the rows of recorded forces share.
#pragma once

#include <string>

#include "client/sim/accuracy/recorded_run.h"
#include "client/sim/accuracy/row.h"
#include "common/base/clock.h"

namespace needlelab {

/// The time of a tick, of a model that ran along `gesture`.
/// Returns what the time's uncertainty is, in words.
std::string addTickTime(const SceneModel& model, const StraightGesture& gesture, AccuracyRow& row);
/// The greatest change of force from tick to tick, declared releases left out.
void addGreatestStep(const AxialRun& run, AccuracyRow& row);

}  // namespace needlelab
