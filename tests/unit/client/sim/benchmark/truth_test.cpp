// Whether the benchmark names the law that generated the curves, or an equally good one, and none for noise.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "client/sim/benchmark/benchmark.h"
#include "tests/support/run_form.h"
#include "tests/unit/client/sim/benchmark/made_curves.h"

namespace needlelab {
namespace {

using test::MadeLaw;
using test::MadeSet;

struct KnownTruth {
  const char* name;
  MadeLaw law;
  std::vector<std::string> right;  ///< one of these must be named; empty: none may be
  std::vector<std::string> wrong;  ///< none of these may be named: they lack a dependency of the law
  double specimens_off;
  std::uint64_t seed = 1;
};
std::ostream& operator<<(std::ostream& out, const KnownTruth& truth) {
  return out << truth.name << " " << truth.specimens_off << " seed " << truth.seed;
}

class BenchmarkTruth : public testing::TestWithParam<KnownTruth> {};

TEST_P(BenchmarkTruth, theRightLawIsNamedZeroShotAndFewShot) {
  const KnownTruth& truth = GetParam();
  MadeSet made;
  made.speeds_mps = {0.002, 0.02};
  made.specimens_off = truth.specimens_off;
  made.seed = truth.seed;
  BenchmarkOptions options;
  options.times = false;
  options.questions = {HoldOut::kSpecimen, HoldOut::kSpecimenStart, HoldOut::kSpecimenInsertion};
  const auto report = runBenchmark(test::madeSet(truth.law, made), options);
  ASSERT_TRUE(report.ok()) << report.error().message;
  ASSERT_EQ(report->questions.size(), 3u);
  for (const QuestionResult& question : report->questions) {
    EXPECT_EQ(question.units.size(), 8u) << "specimen × speed";
    std::string names;
    bool found = false;
    for (const BenchmarkRow* row : question.named()) {
      names += " " + row->model;
      EXPECT_EQ(std::find(truth.wrong.begin(), truth.wrong.end(), row->model), truth.wrong.end())
          << question.text << ": " << row->model;
      found = found || std::find(truth.right.begin(), truth.right.end(), row->model) != truth.right.end();
    }
    if (truth.right.empty())
      EXPECT_EQ(names, "") << question.text;
    else
      EXPECT_TRUE(found) << benchmarkText(*report);
  }
  if (truth.right.empty()) {
    EXPECT_NE(report->conclusion.find("No law is named"), std::string::npos) << report->conclusion;
  }
}

std::vector<KnownTruth> truths() {
  std::vector<KnownTruth> all;
  std::vector<std::pair<double, std::uint64_t>> sets = {{0, 1}, {0.25, 1}};
  if (test::longForm()) sets.push_back({0.25, 2});
  for (const auto& [off, seed] : sets) {
    all.push_back({"spring-damper",
                   test::madeVoigt(),
                   {"VOIGT"},
                   {"DIRECT", "TRACKING_WALL", "ENHANCED_TRACKING_WALL", "PRECOMPUTED", "GOD_OBJECT",
                    "FIRST_ORDER", "OKAMURA", "DAHL", "STATISTICAL", "GORDON_EXPONENTIAL"},
                   off,
                   seed});
    // walls, and DIRECT with a force per layer, are the same law on the way in
    all.push_back({"layers",
                   test::madeLayers(),
                   {"ENHANCED_TRACKING_WALL", "TRACKING_WALL", "DIRECT"},
                   {"VOIGT", "GOD_OBJECT", "FIRST_ORDER", "OKAMURA", "DAHL", "RATE_DEPENDENT_FRACTURE",
                    "GORDON_EXPONENTIAL"},
                   off,
                   seed});
    // on the way in DAHL is OKAMURA with a different friction
    all.push_back({"Okamura", test::madeOkamura(), {"OKAMURA", "DAHL"}, {"VOIGT", "GOD_OBJECT"}, off, seed});
    all.push_back({"noise", test::madeNoise(6 + seed), {}, {}, off, seed});
  }
  return all;
}
INSTANTIATE_TEST_SUITE_P(Known, BenchmarkTruth, testing::ValuesIn(truths()));

}  // namespace
}  // namespace needlelab
