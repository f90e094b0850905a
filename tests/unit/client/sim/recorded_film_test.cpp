// The film's power law: propagation of uncertainty by an independent computation, and the recorded punctures.
#include "client/sim/accuracy/recorded_film.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/recordings/recordings.h"

namespace needlelab {
namespace {

TEST(RecordedFilm, needlesOnOnePowerLawPredictEachOtherExactly) {
  std::vector<FilmForce> forces;
  for (const FilmNeedle& needle : filmNeedles())
    forces.push_back({needle.name, needle.diameter_m, 3 * std::pow(needle.diameter_m * 1e3, 0.7), 0.01, 1});
  for (std::size_t i = 0; i < 3; ++i) {
    const auto p = predictFilmForce(forces[i], forces[(i + 1) % 3], forces[(i + 2) % 3]);
    EXPECT_NEAR(p.predicted_N, forces[i].mean_N, 1e-12);
    EXPECT_NEAR(p.exponent, 0.7, 1e-12);
    EXPECT_NEAR(p.z, 0, 1e-10);
  }
}

TEST(RecordedFilm, uncertaintyOfThePredictionIsItsSlopeOverEachForce) {
  const FilmForce out{"18G", 1.27e-3, 0.3, 0.02, 1}, a{"16G", 1.651e-3, 0.364, 0.013, 1},
      b{"21G", 0.8192e-3, 0.231, 0.023, 1};
  const auto predicted = [&](double fa, double fb) {
    const double exponent = std::log(fa / fb) / std::log(a.diameter_m / b.diameter_m);
    return fa * std::pow(out.diameter_m / a.diameter_m, exponent);
  };
  const double h = 1e-6;
  const double da = (predicted(a.mean_N + h, b.mean_N) - predicted(a.mean_N - h, b.mean_N)) / (2 * h);
  const double db = (predicted(a.mean_N, b.mean_N + h) - predicted(a.mean_N, b.mean_N - h)) / (2 * h);
  const auto p = predictFilmForce(out, a, b);
  EXPECT_NEAR(p.predicted_N, predicted(a.mean_N, b.mean_N), 1e-12);
  EXPECT_NEAR(p.predicted_sd_N, std::hypot(da * a.sd_N, db * b.sd_N), 1e-8);
  EXPECT_NEAR(p.z, (p.predicted_N - 0.3) / std::hypot(p.predicted_sd_N, 0.02), 1e-12);
}

TEST(RecordedFilm, aNeedleWithoutTracesIsNamed) {
  const auto forces = filmForcesOf({{"16G-1", "16G", {0.1, 0.3}}, {"18G-1", "18G", {0.2}}});
  ASSERT_FALSE(forces.ok());
  EXPECT_NE(forces.error().message.find("21G"), std::string::npos);
}

TEST(RecordedFilm, theEngineRupturesAtThePredictedForce) {
  const auto peak = renderedPuncture_N(0.3);
  ASSERT_TRUE(peak.ok());
  EXPECT_LE(*peak, 0.3);
  EXPECT_GT(*peak, 0.3 - 0.3 / 1e-3 * 3e-6 - 1e-12) << "one tick of 3 µm before";
}

TEST(RecordedFilm, eachRecordedNeedleIsPredictedByTheTwoOthers) {
  for (const test::Recordings& recordings : test::allRecordings()) {
    SCOPED_TRACE(recordings.name());
    const auto traces = readFilmTraces(recordings.folder / kFilmFile);
    ASSERT_TRUE(traces.ok()) << traces.error().message;
    EXPECT_EQ(traces->size(), 5u);
    const auto forces = filmForcesOf(*traces);
    ASSERT_TRUE(forces.ok()) << forces.error().message;
    for (const auto& set : {*forces, statedFilmForces()})
      for (std::size_t i = 0; i < 3; ++i) {
        const auto p = predictFilmForce(set[i], set[(i + 1) % 3], set[(i + 2) % 3]);
        EXPECT_LE(std::fabs(p.z), 2) << set[i].needle;
      }
  }
}

}  // namespace
}  // namespace needlelab
