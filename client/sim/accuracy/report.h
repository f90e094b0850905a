/// The accuracy report as text: aligned tables for a person, CSV for other programs.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "client/sim/accuracy/row.h"
#include "client/sim/tools/gnuplot.h"

namespace needlelab {

/// A table for each group of comparable rows, with units, its comparator above and its limits below;
/// columns that no row of the group fills are left out. `front` marks the Pareto front.
std::string accuracyTables(const AccuracyRows& rows);

/// All rows with the JSON's columns, in the same order. Texts in double quotes; empty where absent.
std::string accuracyCsv(const AccuracyRows& rows);

/// `text` in lines of at most `width` letters (UTF-8), each begun with `indent`.
std::string wrapped(std::string_view text, std::size_t width, std::string_view indent);

/// A picture that accuracy.gp draws.
struct AccuracyPicture {
  std::string name;                     ///< "accuracy_model"; the overview is "accuracy"
  std::string data;                     ///< blocks; the plot file finds their path in `data`
  std::vector<PlotVariable> variables;  ///< beside `data`
};

/// One for each study that has rows with cost and error (error over time per tick, the Pareto front drawn,
/// and where it says more a second diagram), and with more than one study an overview.
std::vector<AccuracyPicture> accuracyPictures(const AccuracyRows& rows);

}  // namespace needlelab
