/// The CSV of `run`: one row per tick, one column per effect's term.
#pragma once

#include <string>

#include "common/haptics/engine.h"

namespace needlelab {

/// The column names, with a newline.
std::string runHeader();

/// Appends the row of a tick: 17 significant digits, wall `nan` if there is none, phase by name.
/// `needle_length_m` is for alpha_rad.
void appendRunRow(std::string& out, double t_s, const StepReport& report, double needle_length_m);

}  // namespace needlelab
