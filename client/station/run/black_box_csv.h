/// A black box's ticks as a table for people and programs.
#pragma once

#include <string>
#include <vector>

#include "client/station/run/black_box_tick.h"

namespace needlelab {

/// A header with units (README.md of this folder says what each column is), then a row per tick. Numbers read
/// back bit by bit.
std::string blackBoxCsv(const std::vector<BlackBoxTick>& ticks);

/// "black box 1: the emergency stop is pressed, at tick 4711": why the stretch was kept.
std::string blackBoxText(const BlackBoxDump& dump);

}  // namespace needlelab
