/// The accuracy report: one table, a sentence for each comparator, CSV, and the data of its picture.
#pragma once

#include <string>
#include <vector>

#include "client/sim/accuracy/row.h"
#include "client/sim/tools/gnuplot.h"

namespace needlelab {

/// The table, a block for each comparator and scene, with the sentence below. Of the verification the rows at
/// 1 kHz and 10 µm: the others are in CSV and picture.
std::string accuracyTable(const AccuracyRows& rows);

/// All rows with the JSON's columns, in the same order. Texts in double quotes; empty where absent.
std::string accuracyCsv(const AccuracyRows& rows);

/// What plots/accuracy.gp reads: blocks, and the variables beside `data`.
struct AccuracyPicture {
  std::string data;
  std::vector<PlotVariable> variables;
};
AccuracyPicture accuracyPicture(const AccuracyRows& rows);

}  // namespace needlelab
