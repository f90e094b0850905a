// The models' initial guesses on curves whose parameters are known in closed form.
#include "client/sim/curves/curve_models.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "common/haptics/scene_spec.h"

namespace needlelab {
namespace {

constexpr double kBin_m = 0.25e-3;

/// A bin per 0.25 mm from 0 to 20 mm.
std::vector<CurveBin> binsOf(const std::function<double(double depth_m)>& force_N) {
  std::vector<CurveBin> bins;
  for (int i = 0; i <= 80; ++i) {
    CurveBin bin;
    bin.at = i * kBin_m;
    bin.value = force_N(bin.at);
    bins.push_back(bin);
  }
  return bins;
}

std::vector<double> startsOf(const CurveModel& model) {
  std::vector<double> starts;
  for (const FitParameter& parameter : model.parameters) starts.push_back(parameter.start);
  return starts;
}

/// 100 N/m from 2 mm on; falls to 0.2 N after 10 mm, and rises again at 50 N/m.
double oneRupture(double depth_m) {
  if (depth_m < 2e-3) return 0;
  return depth_m <= 10e-3 ? 100 * (depth_m - 2e-3) : 0.2 + 50 * (depth_m - 10e-3 - kBin_m);
}

TEST(FindRuptures, givesPlaceAndForceOfPeakAndValley) {
  const auto ruptures = findRuptures(binsOf(oneRupture), 0.3);
  ASSERT_EQ(ruptures.size(), 1u);
  EXPECT_DOUBLE_EQ(ruptures[0].depth_m, 10e-3);
  EXPECT_DOUBLE_EQ(ruptures[0].peak_N, 0.8);
  EXPECT_NEAR(ruptures[0].valley_m, 10e-3 + kBin_m, 1e-12);
  EXPECT_NEAR(ruptures[0].valley_N, 0.2, 1e-12);
  // the curve falls by 0.6 N
  EXPECT_EQ(findRuptures(binsOf(oneRupture), 0.59).size(), 1u);
  EXPECT_TRUE(findRuptures(binsOf(oneRupture), 0.61).empty());
}

TEST(FindRuptures, aFinalDropCountsAndAWobbleDoesNotSplitIt) {
  const auto falls = [](double depth_m) { return depth_m < 10e-3 ? 1.0 : 0.4 - 20 * (depth_m - 10e-3); };
  const auto ruptures = findRuptures(binsOf(falls), 0.3);
  ASSERT_EQ(ruptures.size(), 1u);
  EXPECT_NEAR(ruptures[0].valley_N, 0.2, 1e-12);
  EXPECT_NEAR(ruptures[0].valley_m, 20e-3, 1e-12);
  // rises by less than a third of the smallest fall between them
  const auto wobbles = [&](double depth_m) {
    return falls(depth_m) + (std::abs(depth_m - 15e-3) < 0.5 * kBin_m ? 0.09 : 0);
  };
  EXPECT_EQ(findRuptures(binsOf(wobbles), 0.3).size(), 1u);
  EXPECT_TRUE(findRuptures({}, 0.3).empty());
}

TEST(LayeredModel, cutsAStaircaseAtItsStepsAndTakesEachStepsForce) {
  const auto stairs = [](double depth_m) { return depth_m < 5e-3 ? 0.5 : depth_m < 12e-3 ? 2.0 : 1.25; };
  const CurveModel model = layeredModel(AxialModel::kEnhancedTrackingWall, binsOf(stairs));
  ASSERT_EQ(model.parameters.size(), 3u) << model.variant;
  EXPECT_EQ(model.numbers(), 5u) << "two tops were chosen from the data";
  const CurveScene scene = model.scene(startsOf(model));
  EXPECT_EQ(scene.surface_m, 0);
  ASSERT_EQ(scene.spec.layers.size(), 3u);
  // a step lies halfway between the last bin before it and the first after it
  EXPECT_NEAR(scene.spec.layers[0].thickness_m, 5e-3 - 0.5 * kBin_m, 1e-12);
  EXPECT_NEAR(scene.spec.layers[1].thickness_m, 7e-3, 1e-12);
  EXPECT_DOUBLE_EQ(scene.spec.layers[0].cutting_force_N, 0.5);
  EXPECT_DOUBLE_EQ(scene.spec.layers[1].cutting_force_N, 2.0);
  EXPECT_DOUBLE_EQ(scene.spec.layers[2].cutting_force_N, 1.25);
}

TEST(LayeredModel, hasNoMoreLayersThanAProfileAllows) {
  const CurveModel model =
      layeredModel(AxialModel::kDirect, binsOf([](double depth_m) { return 500 * depth_m; }));
  EXPECT_LE(model.parameters.size(), kMaxLayers);
  EXPECT_GT(model.parameters.size(), kMaxLayers / 2) << "a slope is worth many";
}

TEST(LineModel, beginsAtTheContactWithTheSlopeOfTheCurve) {
  const auto line = [](double depth_m) { return std::max(0.0, 200 * (depth_m - 4e-3)); };
  const CurveModel direct = lineModel(AxialModel::kDirect, binsOf(line));
  ASSERT_EQ(direct.parameters.size(), 2u);
  // the contact is the last bin with at most 5 % of the maximum force: 0.16 N, at 4.75 mm
  EXPECT_NEAR(direct.parameters[0].start, 4.75e-3, 1e-12);
  EXPECT_NEAR(direct.parameters[1].start, 200 * 16e-3 / (20e-3 - 4.75e-3), 1e-9);
  const CurveModel voigt = lineModel(AxialModel::kVoigt, binsOf(line));
  ASSERT_EQ(voigt.parameters.size(), 3u);
  const CurveScene scene = voigt.scene({1e-3, 300, 7});
  EXPECT_EQ(scene.surface_m, 1e-3);
  EXPECT_EQ(scene.spec.voigt.stiffness_N_per_m, 300);
  EXPECT_EQ(scene.spec.voigt.damping_Ns_per_m, 7);
}

TEST(GodObjectModel, hasOneSlopeAndATopPerRupture) {
  const CurveModel model = godObjectModel(binsOf(oneRupture));
  // stiffness, top and position of the rupture; the contact is the last bin with at most 5 % of 0.8 N, at
  // 2.25 mm
  ASSERT_EQ(model.parameters.size(), 3u);
  EXPECT_NEAR(model.parameters[1].start, 2.25e-3, 1e-12);
  EXPECT_NEAR(model.parameters[2].start, 10e-3, 1e-12);
  EXPECT_NEAR(model.parameters[0].start, 0.8 / (10e-3 - 2.25e-3), 1e-9);
  const CurveScene scene = model.scene({100, 2e-3, 10e-3});
  EXPECT_DOUBLE_EQ(scene.spec.layers.at(0).cutting_force_N, 0.8) << "where the spring reaches it";
}

TEST(TableModel, hasARowPerMillimetreWithTheCurvesForce) {
  const CurveModel model = tableModel(binsOf([](double depth_m) { return 100 * depth_m; }));
  const CurveScene scene = model.scene(startsOf(model));
  ASSERT_EQ(scene.spec.precomputed.table.size(), 21u);
  for (std::size_t i = 0; i < 21; ++i) {
    EXPECT_DOUBLE_EQ(scene.spec.precomputed.table[i].depth_m, static_cast<double>(i) * 1e-3);
    EXPECT_NEAR(scene.spec.precomputed.table[i].cutting_N, 0.1 * static_cast<double>(i), 1e-12);
  }
}

TEST(CurveModels, keepToTheNumbersThatTheyMayHave) {
  // a sawtooth of eight ruptures of 0.25 to 2 N: the smallest are dropped first
  const auto saw = [](double depth_m) {
    const double tooth = std::floor(depth_m / 2.5e-3);
    return (depth_m - 2.5e-3 * tooth) * 100 * (4 + tooth);
  };
  for (const std::size_t most : {7u, 10u, 20u, 30u})
    for (const CurveModel& model : curveModels(binsOf(saw), most)) {
      EXPECT_LE(model.numbers(), most) << axialModelName(model.model) << ", " << model.variant;
      EXPECT_EQ(model.scene(startsOf(model)).spec.axial_model, model.model);
    }
  const auto pieces = curvePieces(binsOf(saw), 2);
  ASSERT_LE(pieces.size(), 2u);
  EXPECT_GT(pieces.back().rupture_m, 17e-3) << "the greatest falls are the last";
}

TEST(TableModel, hasAsManyRowsAsItMayFromTopToEnd) {
  const CurveModel model = tableModel(binsOf([](double depth_m) { return 100 * depth_m; }), 5);
  const CurveScene scene = model.scene(startsOf(model));
  ASSERT_EQ(scene.spec.precomputed.table.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(scene.spec.precomputed.table[i].depth_m, static_cast<double>(i) * 5e-3, 1e-12);
    EXPECT_NEAR(scene.spec.precomputed.table[i].cutting_N, 0.5 * static_cast<double>(i), 1e-9);
  }
}

TEST(FirstOrderModel, saysWhatOfItsSourceItLeavesOut) {
  const CurveModel model = firstOrderModel(binsOf(oneRupture));
  EXPECT_NE(model.variant.find("without Okamura's viscous (Karnopp) friction"), std::string::npos);
}

}  // namespace
}  // namespace needlelab
