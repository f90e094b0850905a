/// The accuracy report: one table, a sentence per comparator, CSV, and the picture's data.
#pragma once

#include <string>
#include <vector>

#include "client/sim/accuracy/row.h"
#include "client/sim/tools/gnuplot.h"

namespace needlelab {

/// The table: a block per comparator and scene, followed by the sentence, if there is one. Of the
/// verification it only has the rows at 1 kHz and 10 µm; CSV and picture have all.
std::string accuracyTable(const AccuracyRows& rows);

/// All rows with the JSON's columns, in the same order. Texts in double quotes; missing values are empty.
std::string accuracyCsv(const AccuracyRows& rows);

/// What plots/accuracy.gp needs beside the CSV.
std::vector<PlotVariable> accuracyPicture(const AccuracyRows& rows);

// --- the sentences

/// Whether the table shows the row. The verification's rows at rates and encoder steps other than the
/// station's appear only in the picture.
bool isMain(const AccuracyRow& row);

/// What the rows of the verification or the refinement say about the price of accuracy. Empty for another
/// comparator, or without its rows.
std::string sentenceOf(Comparator comparator, const AccuracyRows& rows);

}  // namespace needlelab
