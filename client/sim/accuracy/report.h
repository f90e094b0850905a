/// The accuracy report: one table, a sentence per comparator, CSV, and the picture's data.
#pragma once

#include <string>
#include <vector>

#include "client/sim/accuracy/row.h"
#include "client/sim/tools/gnuplot.h"

namespace needlelab {

/// The table: a block per comparator and scene, followed by the sentence. Of the verification it only has the
/// rows at 1 kHz and 10 µm; CSV and picture have all.
std::string accuracyTable(const AccuracyRows& rows);

/// All rows with the JSON's columns, in the same order. Texts in double quotes; missing values are empty.
std::string accuracyCsv(const AccuracyRows& rows);

/// Input of plots/accuracy.gp: the blocks in `data`, and the variables.
struct AccuracyPicture {
  std::string data;
  std::vector<PlotVariable> variables;
};
AccuracyPicture accuracyPicture(const AccuracyRows& rows);

}  // namespace needlelab
