/// The benchmark's result as tables, CSV, JSON and picture data.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "client/sim/benchmark/verdict.h"
#include "client/sim/tools/gnuplot.h"

namespace needlelab {

/// The data, a table per question with its text below, the notes, the conclusion.
std::string benchmarkText(const BenchmarkReport& report);

/// One row per model and question, with the JSON's columns except `unit_errors_n`. Texts in double quotes.
std::string benchmarkCsv(const BenchmarkReport& report);

/// The rows, and the rest: `data`, `questions`, `notes`, `conclusion`.
nlohmann::ordered_json benchmarkRows(const BenchmarkReport& report);
nlohmann::ordered_json benchmarkRest(const BenchmarkReport& report);

/// Input of plots/benchmark.gp: the blocks in `data`, and the variables.
struct BenchmarkPicture {
  std::string data;
  std::vector<PlotVariable> variables;
};
BenchmarkPicture benchmarkPicture(const BenchmarkReport& report);

}  // namespace needlelab
