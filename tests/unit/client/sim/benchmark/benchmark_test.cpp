// The benchmark on sets whose truth is known.
#include "client/sim/benchmark/benchmark.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/support/recordings/recordings.h"
#include "tests/support/run_form.h"
#include "tests/unit/client/sim/benchmark/made_curves.h"

namespace needlelab {
namespace {

using test::madeExponential;
using test::madeFracture;
using test::madeSet;
using test::MadeSet;
using test::madeVoigt;
using testing::HasSubstr;
using testing::Not;

BenchmarkReport ran(const CurveSet& set, std::vector<HoldOut> questions, std::size_t max_numbers = 20) {
  BenchmarkOptions options;
  options.questions = std::move(questions);
  options.max_numbers = max_numbers;
  options.times = false;
  auto report = runBenchmark(set, options);
  EXPECT_TRUE(report.ok()) << report.error().message;
  return report.ok() ? *report : BenchmarkReport{};
}

const BenchmarkRow& rowOf(const QuestionResult& question, const std::string& model) {
  for (const BenchmarkRow& row : question.rows)
    if (row.model == model) return row;
  ADD_FAILURE() << "no row of " << model;
  return question.rows.front();
}

TEST(Benchmark, findsRateDependentFractureAtAnUnseenSpeed) {
  for (std::uint64_t seed = 1; seed <= (test::longForm() ? 2u : 1u); ++seed) {
    MadeSet made;
    made.specimens = 2;
    made.speeds_mps = {0.001, 0.0015, 0.002, 0.003, 0.005, 0.008, 0.012, 0.02};
    made.seed = seed;
    const BenchmarkReport report = ran(madeSet(madeFracture(3e-3), made), {HoldOut::kSpeed});
    ASSERT_EQ(report.questions.size(), 1u);
    const QuestionResult& speed = report.questions[0];
    ASSERT_NE(speed.best(), nullptr);
    EXPECT_EQ(speed.best()->model, "RATE_DEPENDENT_FRACTURE") << benchmarkText(report);
    EXPECT_EQ(speed.best()->verdict, BenchmarkVerdict::kNamed) << benchmarkText(report);
    EXPECT_EQ(speed.units.size(), 16u) << "specimen × speed";
    EXPECT_THAT(report.conclusion, HasSubstr("For an unseen speed: RATE_DEPENDENT_FRACTURE"));
  }
}

TEST(Benchmark, findsTheExponentialInAnUnseenSpecimen) {
  for (std::uint64_t seed = 1; seed <= (test::longForm() ? 2u : 1u); ++seed) {
    MadeSet made;
    made.specimens = 5;
    made.noise_N = 0.05;
    made.seed = seed;
    const BenchmarkReport report = ran(madeSet(madeExponential(), made), {HoldOut::kSpecimen});
    ASSERT_EQ(report.questions.size(), 1u);
    EXPECT_EQ(report.questions[0].best()->model, "GORDON_EXPONENTIAL") << benchmarkText(report);
  }
}

TEST(Benchmark, findsTheEnginesModelThatMadeTheCurves) {
  MadeSet made;
  made.specimens = 2;
  made.speeds_mps = {0.001, 0.003, 0.006, 0.013, 0.03};
  if (test::longForm()) made.speeds_mps = {0.001, 0.002, 0.003, 0.005, 0.008, 0.012, 0.02, 0.03};
  const BenchmarkReport report = ran(madeSet(madeVoigt(), made), {HoldOut::kSpeed});
  const QuestionResult& speed = report.questions.at(0);
  const BenchmarkRow& voigt = rowOf(speed, "VOIGT");
  EXPECT_EQ(voigt.verdict, BenchmarkVerdict::kNamed) << benchmarkText(report);
  // rows scatter by 0.02/√3 N, and a bin has two or three of them
  EXPECT_LT(voigt.error_N, 0.012);
  EXPECT_LE(voigt.error_N, 1.02 * speed.best()->error_N) << benchmarkText(report);
  ASSERT_TRUE(voigt.energy_given_J.has_value());
}

TEST(Benchmark, twoSpecimensTellNothing) {
  MadeSet made;
  made.specimens = 2;
  const BenchmarkReport report = ran(madeSet(madeExponential(), made), {HoldOut::kSpecimen});
  EXPECT_THAT(report.questions.at(0).text, HasSubstr("at least 3 are needed"));
  for (const BenchmarkRow& row : report.questions[0].rows) {
    EXPECT_EQ(row.verdict, row.kind == ModelKind::kFormula || row.kind == ModelKind::kEngine
                               ? BenchmarkVerdict::kUndecided
                               : BenchmarkVerdict::kNone);
  }
}

TEST(Benchmark, oneRecordedCurveIsFittedAndPredictsNothing) {
  for (const test::Recordings& recordings : test::allRecordings()) {
    SCOPED_TRACE(recordings.name());
    const auto set = readCurveSet(recordings.folder / "needle_force");
    ASSERT_TRUE(set.ok()) << set.error().message;
    const BenchmarkReport report = ran(*set, {});
    ASSERT_EQ(report.questions.size(), 2u) << "the end, and blocks";
    EXPECT_THAT(report.conclusion, HasSubstr("cannot tell which model predicts"));
    EXPECT_THAT(report.conclusion, HasSubstr("1 specimen, 1 needle, 1 speed"));
    for (const QuestionResult& question : report.questions) {
      EXPECT_THAT(question.text, HasSubstr("Noise floor, no competitor: CONNECT_THE_DOTS"));
      for (const BenchmarkRow& row : question.rows) {
        EXPECT_NE(row.verdict, BenchmarkVerdict::kNamed) << row.model;
        if (row.kind != ModelKind::kFloor) {
          EXPECT_LE(row.parameters, 20u) << row.model;
        }
      }
    }
    const QuestionResult& blocks = report.questions[1];
    EXPECT_EQ(blocks.what, HoldOut::kBlocks);
    if (recordings.real) {
      // no model with 20 parameters follows the curve as closely as its own dots
      EXPECT_LT(rowOf(blocks, "CONNECT_THE_DOTS").error_N, blocks.best()->error_N);
      EXPECT_NEAR(rowOf(blocks, "CONNECT_THE_DOTS").error_N, 0.081, 0.002);
    }
    // a baseline through all dots has no residue and therefore no width: its band is missed
    EXPECT_THAT(rowOf(blocks, "CONNECT_THE_DOTS").band, HasSubstr("too narrow"));
  }
}

TEST(Benchmark, aBandFromTheSpreadOfSpecimensIsKept) {
  MadeSet made;
  made.specimens = 12;
  made.specimens_off = 0.2;
  const BenchmarkReport report = ran(madeSet(madeVoigt(), made), {HoldOut::kSpecimen});
  const BenchmarkRow& mean = rowOf(report.questions.at(0), "CONNECT_THE_DOTS");
  EXPECT_GT(mean.in_band, 0.8);
  EXPECT_THAT(mean.band, Not(HasSubstr("too narrow"))) << mean.band;
}

TEST(Benchmark, theSameInputGivesTheSameBits) {
  MadeSet made;
  made.specimens = 3;
  made.to_m = 0.01;
  const CurveSet set = madeSet(madeVoigt(), made);
  const BenchmarkReport a = ran(set, {HoldOut::kSpecimen}), b = ran(set, {HoldOut::kSpecimen});
  EXPECT_EQ(benchmarkRows(a).dump(), benchmarkRows(b).dump());
  EXPECT_EQ(benchmarkRest(a).dump(), benchmarkRest(b).dump());
}

TEST(Benchmark, errorIsTheMeanOverUnitsWithStudentsInterval) {
  MadeSet made;
  made.specimens = 3;
  made.specimens_off = 0.3;
  made.to_m = 0.01;
  const BenchmarkReport report = ran(madeSet(madeVoigt(), made), {HoldOut::kSpecimen});
  for (const BenchmarkRow& row : report.questions.at(0).rows) {
    ASSERT_EQ(row.unit_errors_N.size(), 3u);
    double mean = 0, squares = 0;
    for (const double one : row.unit_errors_N) mean += one / 3;
    for (const double one : row.unit_errors_N) squares += (one - mean) * (one - mean);
    const double half = 4.30265 * std::sqrt(squares / 2 / 3);
    EXPECT_NEAR(row.error_N, mean, 1e-12);
    EXPECT_NEAR(*row.error_high_N, mean + half, 1e-4 * half + 1e-12);
    EXPECT_NEAR(*row.error_low_N, std::max(0.0, mean - half), 1e-4 * half + 1e-12);
    EXPECT_GE(row.max_error_N, row.error_N);
  }
}

TEST(Benchmark, holdAndWithdrawalAreAskedOfModelsThatCanAnswer) {
  MadeSet made;
  made.speeds_mps = {0.005, 0.02};
  made.to_m = 0.012;
  made.hold_s = 2;
  const BenchmarkReport report = ran(madeSet(madeVoigt(), made), {HoldOut::kHold, HoldOut::kWithdrawal}, 10);
  ASSERT_EQ(report.questions.size(), 2u) << benchmarkText(report);
  for (const QuestionResult& question : report.questions) {
    // the damper gives 0.1 and 0.4 N, nothing at rest, and opposes the spring on the way out: only VOIGT
    // models this
    EXPECT_EQ(question.best()->model, "VOIGT") << benchmarkText(report);
    EXPECT_EQ(question.best()->verdict, BenchmarkVerdict::kNamed) << benchmarkText(report);
    EXPECT_LT(question.best()->error_N, 0.03);
    for (const BenchmarkRow& row : question.rows) EXPECT_NE(row.model, "GORDON_EXPONENTIAL");
  }
  EXPECT_THAT(report.notes,
              testing::Contains(HasSubstr("GORDON_EXPONENTIAL is omitted: it knows the way in only")));
}

TEST(Benchmark, optionsOutOfRangeAreRefused) {
  BenchmarkOptions options;
  options.max_numbers = 6;
  const auto report = runBenchmark(madeSet(madeVoigt(), {}), options);
  ASSERT_FALSE(report.ok());
  EXPECT_THAT(report.error().message, HasSubstr("--numbers 6"));
  EXPECT_THAT(report.error().message, HasSubstr("7 to 100"));
  options = {};
  options.margin = 0.6;
  EXPECT_FALSE(runBenchmark(madeSet(madeVoigt(), {}), options).ok());
  options = {};
  options.calibration_m = 0.06;
  EXPECT_FALSE(runBenchmark(madeSet(madeVoigt(), {}), options).ok());
}

TEST(Benchmark, saysWhichTraitsChangeTogether) {
  MadeSet made;
  made.specimens = 3;
  made.to_m = 0.01;
  CurveSet set = madeSet(madeVoigt(), made);
  for (ForceCurve& curve : set.curves) curve.needle = "of " + curve.specimen;
  const BenchmarkReport report = ran(set, {HoldOut::kNeedle});
  EXPECT_THAT(report.notes, testing::Contains(HasSubstr("specimen and needle always change together")));
}

TEST(EnergyGiven, aSceneOfTheWallIsPassive) {
  CurveScene scene{fittedSceneBase(), 0};
  scene.spec.effects = bitOf(Effect::kCutting);
  scene.spec.layers.push_back({});
  scene.spec.layers[0].thickness_m = 0.1;
  scene.spec.layers[0].cutting_force_N = 1;
  const auto energy = energyGiven_J(scene, 0.02);
  ASSERT_TRUE(energy.ok()) << energy.error().message;
  EXPECT_LT(*energy, 5e-5);
  EXPECT_GE(*energy, 0);
}

}  // namespace
}  // namespace needlelab
