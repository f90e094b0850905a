/// The table of `needlelab-sim run` (DESIGN §5): one row a tick.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/haptics/engine.h"

namespace needlelab {

/// The columns, with a newline.
std::string runHeader();

/// Appends the row of a tick: 17 significant digits, wall `nan` when there is none, phase by name.
/// `needle_length_m` is for alpha_rad.
void appendRunRow(std::string& out, double t_s, const StepReport& report, double needle_length_m);

/// FNV-1a, 64 bits, of a text: as every double is written so that it reads back the same, equal hashes mean
/// equal bits.
std::uint64_t fnv1a(std::string_view text);

}  // namespace needlelab
