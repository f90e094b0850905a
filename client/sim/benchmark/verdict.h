/// The benchmark's rule: which models are named.
#pragma once

#include "client/sim/benchmark/benchmark.h"

namespace needlelab {

/// Fills the question's margin, differences, verdicts and text from its rows' errors.
/// - The margin is `share` of the held-out rms force, the error of NO_FORCE.
/// - The trivial is the trivial baseline with least error, the best the model with least error.
///   CONNECT_THE_DOTS has a number for each bin: it is the noise floor, and takes no part.
/// - A model is named if, over units, the 95 % interval of what it beats the trivial by lies above the
/// margin,
///   and that of what it is behind the best does not reach above the margin (non-inferiority).
/// - Two intervals say no: one that lies below the margin for the trivial, above it for the best. Else the
/// data
///   cannot tell.
void decide(QuestionResult& question, double share);

/// What is named for what, over all questions that predict.
std::string conclusionOf(const BenchmarkReport& report);

}  // namespace needlelab
