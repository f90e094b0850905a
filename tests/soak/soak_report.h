/// A soak run as files: samples.csv, minutes.csv, table.txt, soak.png.
#pragma once

#include <string>
#include <vector>

#include "tests/soak/soak_judge.h"

namespace needlelab::test {

/// For a person; the last line is the verdict.
std::string tableText(const std::vector<Finding>& findings);

/// Into `options.out`. The picture only where gnuplot is. Errors: kFailed.
Status writeReport(const SoakData& data, const SoakOptions& options, const SoakMinutes& minutes,
                   const std::vector<Finding>& findings);

}  // namespace needlelab::test
