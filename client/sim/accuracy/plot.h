/// The pictures of the accuracy report.
#pragma once

#include <string>
#include <vector>

#include "client/sim/accuracy/row.h"

namespace needlelab {

/// A picture for sim/gnuplot.h.
struct AccuracyPicture {
  std::string name;  ///< "accuracy_model"; the overview is "accuracy"
  std::string script;
  int width_px = 0, height_px = 0;
};

/// One for each study that has rows with cost and error (error over time per tick, the Pareto front drawn,
/// and where it says more a second diagram), and with more than one study an overview.
std::vector<AccuracyPicture> accuracyPictures(const AccuracyRows& rows);

}  // namespace needlelab
