/// The report's sentences: one per panel, derived from these rows, with numbers.
#pragma once

#include <string>

#include "client/sim/accuracy/row.h"

namespace needlelab {

/// Whether the table shows the row. The verification's rows at rates and encoder steps other than the
/// station's appear only in the picture.
bool isMain(const AccuracyRow& row);

/// Advice for choosing a loop, encoder, mesh or model. Empty without rows.
std::string sentenceOf(Comparator comparator, const AccuracyRows& rows);

/// What lower FEM errors cost in time. Empty without timed FEM rows.
std::string femSentence(const AccuracyRows& rows);
/// What a tick costs overall. Empty without timed rows.
std::string costSentence(const AccuracyRows& rows);

}  // namespace needlelab
