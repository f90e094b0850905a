/// The pictures of `needlelab-sim stability`.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "client/sim/stability/case.h"
#include "common/base/result.h"

namespace needlelab {

/// The script of a picture and its size; see plotPng.
struct StabilityPicture {
  std::string script;
  int width_px = 0, height_px = 0;
};

/// Cases × models, each cell with its verdict and what was measured.
StabilityPicture overviewPicture(const std::vector<CaseRow>& rows);
/// The force of the wall, Voigt and direct in the cases in which they were held still; `csv` is written with
/// the curves. Nothing to draw (an empty script) when none of them was run.
Result<StabilityPicture> holdsPicture(const std::vector<CaseOutcome>& outcomes,
                                      const std::filesystem::path& csv);

/// Writes stability.png, stability-holds.csv and stability-holds.png into the folder;
/// without gnuplot says that there are none, on stderr.
Status drawStability(const std::vector<CaseOutcome>& outcomes, const std::filesystem::path& out);

}  // namespace needlelab
