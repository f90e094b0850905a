// What a fold shows to a model, and what it withholds.
#include "client/sim/benchmark/training.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace needlelab {
namespace {

/// A line of `slope` N/m to 10 mm, ten rows per millimetre.
ForceCurve lineOf(const std::string& specimen, const std::string& needle, double speed_mps, double slope) {
  ForceCurve curve;
  curve.name = specimen + needle;
  curve.specimen = specimen;
  curve.needle = needle;
  curve.tissue = "gel";
  curve.speed_mps = speed_mps;
  curve.diameter_m = 0.001;
  for (int i = 0; i < 100; ++i) {
    curve.depth_m.push_back((i + 0.5) * 1e-4);
    curve.force_N.push_back(slope * curve.depth_m.back());
  }
  return curve;
}

CurveSet threeSpecimens() {
  CurveSet set;
  set.curves = {lineOf("a", "18G", 0.001, 100), lineOf("b", "18G", 0.002, 200),
                lineOf("c", "18G", 0.002, 600)};
  return set;
}

TEST(Training, eachSpecimenIsHeldOutOnceAndNeverSeenThen) {
  const CurveSet set = threeSpecimens();
  const auto curves = binnedCurves(set);
  const auto folds = foldsOf(HoldOut::kSpecimen, curves);
  ASSERT_EQ(folds.size(), 3u);
  std::set<std::size_t> held_out;
  for (const Fold& fold : folds)
    for (std::size_t i = 0; i < curves.size(); ++i)
      if (!fold.fit_on(i, curves[i].curve.bins.front())) held_out.insert(i);
  EXPECT_EQ(held_out, (std::set<std::size_t>{0, 1, 2}));

  // held out: a. The others have 200 and 600 N/m, mean 400 N/m
  const TrainingSet training = trainingSet(curves, folds[0]);
  for (std::size_t i = 0; i < training.all.bins.size(); ++i) {
    EXPECT_NEAR(training.all.bins[i].value, 400 * training.all.bins[i].at, 1e-12);
    EXPECT_EQ(training.all.counts[i], 2);
    // each one is off by 200 N/m
    EXPECT_NEAR(training.all.squares[i], 2 * std::pow(200 * training.all.bins[i].at, 2), 1e-9);
  }
  ASSERT_EQ(training.kinds.size(), 1u);
  EXPECT_EQ(training.kinds[0].kind.speed_mps, 0.002) << "the speed of what is held out is not among them";
  EXPECT_TRUE(training.diameters);
}

TEST(Training, aTissueWithASingleNeedleHasNoFolds) {
  const CurveSet set = threeSpecimens();
  const auto curves = binnedCurves(set);
  EXPECT_TRUE(foldsOf(HoldOut::kNeedle, curves).empty());
  EXPECT_EQ(foldsOf(HoldOut::kSpeed, curves).size(), 2u);
  EXPECT_EQ(foldsOf(HoldOut::kBlocks, curves).size(), 2u);
}

TEST(Training, aTissueIsPredictedFromItsOwnCurvesOnly) {
  CurveSet set = threeSpecimens();
  for (const char* specimen : {"d", "e"}) {
    set.curves.push_back(lineOf(specimen, "18G", 0.001, 1000));
    set.curves.back().tissue = "liver";
  }
  const auto curves = binnedCurves(set);
  const auto folds = foldsOf(HoldOut::kSpecimen, curves);
  ASSERT_EQ(folds.size(), 5u);
  for (const Fold& fold : folds) {
    std::set<std::string> tissues;
    for (const std::size_t i : fold.curves) tissues.insert(curves[i].source->tissue);
    EXPECT_EQ(tissues.size(), 1u) << fold.held_out;
  }
}

TEST(Training, theEndIsTheDeeperHalf) {
  const CurveSet set = threeSpecimens();
  const auto curves = binnedCurves(set);
  const auto folds = foldsOf(HoldOut::kEnd, curves);
  ASSERT_EQ(folds.size(), 1u);
  for (const CurveBin& bin : curves[0].curve.bins) EXPECT_EQ(folds[0].fit_on(0, bin), bin.at < 0.005);
}

TEST(Training, blocksHoldEachBinOutOnce) {
  const CurveSet set = threeSpecimens();
  const auto curves = binnedCurves(set);
  const auto folds = foldsOf(HoldOut::kBlocks, curves);
  ASSERT_EQ(folds.size(), 2u);
  for (const CurveBin& bin : curves[0].curve.bins)
    EXPECT_NE(folds[0].fit_on(0, bin), folds[1].fit_on(0, bin));
}

}  // namespace
}  // namespace needlelab
