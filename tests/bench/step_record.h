/// Runs the registered benchmarks, and writes their results into a folder of this machine's.
#pragma once

#include <filesystem>
#include <string>

namespace needlelab::test {

struct RecordOptions {
  std::filesystem::path results;  ///< `--results FOLDER`; empty = only show
  std::string commit;             ///< `--commit TEXT`
};

/// Removes its own options from the command line; the rest belongs to Google Benchmark.
RecordOptions takeRecordOptions(int& argc, char** argv);

/// FOLDER/<machine>/step.json (Google Benchmark's) and README.md, a table with the goals of
/// tests/bench/README.md. Returns the exit code: 0; 1 when writing failed or a benchmark could not run; 2 for
/// a wrong command line.
int runAndRecord(const RecordOptions& options, int argc, char** argv);

}  // namespace needlelab::test
