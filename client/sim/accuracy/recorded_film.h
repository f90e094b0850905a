/// Puncture of a test film by three needles: fits a power law of force over outer diameter to two needles and
/// predicts the third.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "client/sim/accuracy/recorded_data.h"

namespace needlelab {

/// Known data of a needle: outer diameters of ISO 9626 hypodermic tubing as sold, and mean and standard
/// deviation of single punctures as the recording's source states them (data/README.md).
struct FilmNeedle {
  std::string name;
  double diameter_m = 0;
  double stated_mean_N = 0, stated_sd_N = 0;
};
const std::array<FilmNeedle, 3>& filmNeedles();

/// A needle's measured puncture force.
struct FilmForce {
  std::string needle;
  double diameter_m = 0;
  double mean_N = 0;
  double sd_N = 0;  ///< of the mean
  int punctures = 0;
};

/// Peak of each trace (its greatest sample), averaged per needle. A single puncture varies by the stated
/// standard deviation; five traces are too few to estimate it from. Errors: kInvalidInput for a needle
/// without traces.
Result<std::vector<FilmForce>> filmForcesOf(const std::vector<FilmTrace>& traces);
/// The stated means, each with the standard deviation of a single puncture: how many went into the mean is
/// not stated, so this is the larger uncertainty.
std::vector<FilmForce> statedFilmForces();

/// One needle, predicted from the two others by F = a·dᵇ through both.
struct FilmPrediction {
  FilmForce measured;
  double exponent = 0;  ///< b
  double predicted_N = 0;
  double predicted_sd_N = 0;  ///< of both others, by error propagation in ln F
  double z = 0;               ///< (predicted − measured)/√(sd² of both)
};
FilmPrediction predictFilmForce(const FilmForce& left_out, const FilmForce& a, const FilmForce& b);

/// The force of a membrane that ruptures at `force_N`, through the engine, when a needle at 3 mm/s meets it:
/// the greatest force before it is through, in N. Errors: those of `compile`.
Result<double> renderedPuncture_N(double force_N);

}  // namespace needlelab
