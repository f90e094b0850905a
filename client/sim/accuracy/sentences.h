/// The report's sentences: one for each panel, true of these rows, with their numbers.
#pragma once

#include <string>

#include "client/sim/accuracy/row.h"

namespace needlelab {

/// The rows that the table shows: all but the verification's at other rates and encoder steps than the
/// station's, which the picture shows.
bool isMain(const AccuracyRow& row);

/// For who buys a loop, an encoder, a mesh or a model. Empty without rows.
std::string sentenceOf(Comparator comparator, const AccuracyRows& rows);

/// What FEM's error costs in time. Empty without rows of FEM that have a time.
std::string femSentence(const AccuracyRows& rows);
/// What a tick costs at all. Empty without rows that have a time.
std::string costSentence(const AccuracyRows& rows);

}  // namespace needlelab
