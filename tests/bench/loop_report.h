/// Report of the comparison between haptic loop and cyclictest, judged by the goals of tests/bench/README.md.
#pragma once

#include <string>
#include <vector>

#include "tests/bench/loop_slices.h"

namespace needlelab::test {

/// How far the loop may be behind cyclictest.
struct LoopGoals {
  double share_more = 1e-4;  ///< of wake-ups late by more than T, beyond cyclictest's share
  double p99_ratio = 1.3;
};

struct LoopVerdict {
  bool met = false;
  std::string text;  ///< "wake-up p99: 46.1 µs, at most 1.3 × 44.2 µs"
};

/// One verdict a goal.
std::vector<LoopVerdict> judge(const LoopBenchResult& result, const LoopGoals& goals);

/// A Markdown table, readable on a terminal too.
std::string loopTable(const LoopBenchResult& result);

/// version, machine, options, both sides over all, slice by slice, verdicts.
std::string loopJson(const LoopBenchResult& result, const LoopGoals& goals, const std::string& commit);

}  // namespace needlelab::test
