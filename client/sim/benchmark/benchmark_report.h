/// The benchmark's result as tables, CSV, JSON and the data of its picture.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "client/sim/benchmark/benchmark.h"
#include "client/sim/tools/gnuplot.h"

namespace needlelab {

/// The data, a table for each question with its text below, the notes, the conclusion.
std::string benchmarkText(const BenchmarkReport& report);

/// A row for each model of each question, with the JSON's columns but `unit_errors_n`. Texts in double
/// quotes.
std::string benchmarkCsv(const BenchmarkReport& report);

/// The rows, and what belongs beside them: `data`, `questions`, `notes`, `conclusion`.
nlohmann::ordered_json benchmarkRows(const BenchmarkReport& report);
nlohmann::ordered_json benchmarkRest(const BenchmarkReport& report);

/// What plots/benchmark.gp reads: blocks, and the variables beside `data`.
struct BenchmarkPicture {
  std::string data;
  std::vector<PlotVariable> variables;
};
BenchmarkPicture benchmarkPicture(const BenchmarkReport& report);

}  // namespace needlelab
