/// Tests small versions of the studies against a formula or another method.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "client/sim/accuracy/gesture.h"
#include "client/sim/accuracy/row.h"
#include "client/sim/accuracy/study.h"
#include "client/sim/accuracy/tls_loopback.h"
#include "common/base/clock.h"
#include "common/gesture/chunk.h"
#include "common/haptics/models/like_for_like.h"
#include "tests/support/scenes.h"

namespace needlelab {
namespace {

void quiet(std::string_view, double) {}

// for tests of everything but times
AccuracyOptions hardlyTimed() {
  AccuracyOptions options;
  options.effort = CostEffort{2, 20, 1, 1};
  return options;
}

TEST(Timing, quantilesAreThoseOfTheBatches) {
  std::vector<double> means;
  for (int i = 100; i >= 1; --i) means.push_back(i);
  const Timing timing = timingOf(means, 10);
  EXPECT_EQ(timing.median_ns, 50);
  EXPECT_EQ(timing.p99_ns, 99);
  EXPECT_EQ(timing.least_ns, 1);
  EXPECT_EQ(timing.batches, 100u);
}

TEST(Timing, noBatchesGiveZeros) {
  EXPECT_EQ(timingOf({}, 1).median_ns, 0);
  EXPECT_EQ(timingOf({}, 1).p99_ns, 0);
}

TEST(Timing, aLoopTwiceAsLongTakesAboutTwiceAsLong) {
  const auto timed = [](int rounds) {
    return timeFor(0.02,
                   [rounds] {
                     double x = 1;
                     for (int i = 0; i < rounds; ++i) x = x * 1.0000001 + 1e-9;
                     keep(x);
                   })
        .least_ns;
  };
  EXPECT_NEAR(timed(4000) / timed(2000), 2, 0.5);
}

// three meshes whose work and stiffness fall by half, and the last of which cuts
std::vector<MeshRow> madeUpMeshes() {
  std::vector<MeshRow> meshes(3);
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    MeshRow& mesh = meshes[m];
    mesh.nodes = 1000 << m;
    mesh.precompute_s = 0.1 * std::pow(2, m);
    mesh.one_solve.p50_s = 4e-4 * std::pow(2, m);
    mesh.one_solve.p99_s = 6e-4 * std::pow(2, m);
    mesh.one_solve.solves = 500;
    mesh.live_step_p50_s = 3e-7;
    mesh.live_step_p99_s = 5e-7;
    mesh.force_rms_error_N = m == 2 ? 0 : 0.3 / std::pow(2, m);
    mesh.work_J = -0.1305;
    mesh.stiffness_N_per_m = 7000;
    mesh.stroke_m = 0.057;
    mesh.first_cut_m = 0.005;
  }
  meshes[2].force_limit_N = MeshLimit{true, 1.5, 0.02, 0.005};
  meshes[2].work_limit_J = MeshLimit{true, 1.25, 0.0005, 0.0001};
  meshes[2].stiffness_limit_N_per_m = MeshLimit{};
  return meshes;
}

TEST(MeshRows, haveTheSecondsOfTheirMakingAndTheTailOfManySolves) {
  const AccuracyRows rows = rowsOf(madeUpMeshes(), 27);
  ASSERT_EQ(rows.size(), 6u);
  EXPECT_EQ(rows[1].variant, "compliance made before");
  EXPECT_EQ(rows[1].precompute_s, 0.2);
  EXPECT_EQ(rows[1].fits_rate, true);
  EXPECT_EQ(rows[4].variant, "solved in each tick");
  EXPECT_FALSE(rows[4].precompute_s);
  EXPECT_DOUBLE_EQ(*rows[4].median_ns, 8e5);
  EXPECT_DOUBLE_EQ(*rows[4].p99_ns, 1.2e6);
  EXPECT_EQ(rows[3].fits_rate, true);
  EXPECT_EQ(rows[4].fits_rate, false) << "the median is within 1 ms, the tail is not";
  EXPECT_THAT(rows[4].uncertainty, testing::HasSubstr("timed 500 times"));
}

TEST(MeshRows, sayTheirLimitsAndWhatTheFinestMissesItself) {
  auto meshes = madeUpMeshes();
  const AccuracyRows rows = rowsOf(meshes, 27);
  EXPECT_THAT(rows[0].uncertainty, testing::HasSubstr("force no limit yet"));
  EXPECT_THAT(rows[2].uncertainty, testing::HasSubstr("force 0.02 ± 0.005 N rms from its limit (order 1.5)"));
  EXPECT_THAT(rows[2].uncertainty,
              testing::HasSubstr("work of the stroke -130.5 mJ, limit -130 ± 0.1 mJ (order 1.2)"));
  EXPECT_THAT(rows[2].uncertainty, testing::HasSubstr("of the finest, does not converge"));
  EXPECT_THAT(rows[2].cannot_show, testing::HasSubstr("gives E, times 27 in all layers"));
  for (const AccuracyRow& row : rows) EXPECT_DOUBLE_EQ(*row.rms_error_spread_n, 0.025);
  // where the force does not converge, the last change
  meshes[2].force_limit_N = MeshLimit{};
  EXPECT_DOUBLE_EQ(*rowsOf(meshes, 27)[0].rms_error_spread_n, 0.15);
}

TEST(MeshRows, nameAStrokeThatHangsOnWhetherItCuts) {
  auto meshes = madeUpMeshes();
  meshes[0].first_cut_m = 0.056;
  meshes[1].first_cut_m.reset();
  meshes[1].cut_share = 0.976;
  const AccuracyRows rows = rowsOf(meshes, 1);
  EXPECT_THAT(rows[0].uncertainty, testing::HasSubstr("the tip first cuts at 56 mm of a stroke of 57 mm"));
  EXPECT_THAT(rows[1].uncertainty, testing::HasSubstr("it reaches 97.6 % of the cutting force"));
  EXPECT_THAT(rows[2].uncertainty, testing::Not(testing::HasSubstr("hangs on")));
}

// the trap of before: the needle indented 57 mm, the whole stroke, before it cut
TEST(FemScene, meetsTheStiffnessOfTheScenesWallsAndCutsEarly) {
  const auto scene = femScene();
  ASSERT_TRUE(scene.ok()) << scene.error().message;
  EXPECT_NEAR(scene->young_factor, 28, 3);
  const auto meshes = meshStudy(scene->spec, {{2000}});
  ASSERT_TRUE(meshes.ok());
  const MeshRow& mesh = meshes->front();
  ASSERT_TRUE(mesh.first_cut_m);
  // the first layer's cutting force at the walls' stiffness, and the coarse mesh is stiffer
  const double indent_m = scene->spec.fem.layers[0].cutting_N / scene->spec.tracking_wall.stiffness_N_per_m;
  EXPECT_GT(*mesh.first_cut_m, 0.5 * indent_m);
  EXPECT_LT(*mesh.first_cut_m, 1.02 * indent_m);
  EXPECT_LT(mesh.work_J, -0.1);
  EXPECT_EQ(cutRemark(mesh), "");
}

TEST(ErrorRuns, spreadIsTheStandardDeviationOfTheRuns) {
  ErrorRuns runs;
  for (const double e : {1.0, 2.0, 3.0}) {
    ErrorSum sum;
    sum.add(e);
    sum.add(-e);
    runs.add(sum);
  }
  EXPECT_DOUBLE_EQ(runs.spread(), 1);
  EXPECT_DOUBLE_EQ(runs.rms(), std::sqrt(14.0 / 3));
  EXPECT_DOUBLE_EQ(runs.max(), 3);
}

TEST(ForceProfile, asksForCuttingInAttractedOutAndNothingOutside) {
  const SceneSpec spec = test::paperSixLayers();
  ForceProfile profile(spec, 1000);
  EXPECT_EQ(profile.next(-0.001, Intent::kIn), 0);
  EXPECT_EQ(profile.next(0.001, Intent::kIn), -spec.layers[0].cutting_force_N);
  EXPECT_EQ(profile.next(0.0031, Intent::kIn), -spec.layers[1].cutting_force_N);
  EXPECT_EQ(profile.next(0.0031, Intent::kOut), spec.layers[1].attracted_force_N);
}

TEST(ForceProfile, fallsInARestAsTheStopDoes) {
  const SceneSpec spec = test::paperOneDof();
  ForceProfile profile(spec, 1000);
  profile.next(0.01, Intent::kIn);
  const auto dwell = static_cast<int>(spec.tracking_wall.stop_dwell_s * 1000);
  const auto stop = static_cast<int>(spec.tracking_wall.stop_duration_s * 1000);
  for (int i = 0; i < dwell; ++i) EXPECT_NEAR(profile.next(0.01, Intent::kRest), -1.0, 1e-9);
  double half = 0;
  for (int i = 0; i < stop / 2; ++i) half = profile.next(0.01, Intent::kRest);
  EXPECT_NEAR(half, -0.55, 1e-6);  // half way from 1 N to 0.1 N
  for (int i = 0; i < stop; ++i) half = profile.next(0.01, Intent::kRest);
  EXPECT_NEAR(half, -0.1, 1e-9);
}

TEST(Rendering, theWallInDeepTissueGivesWhatTheProfileAsksFor) {
  // A straight insertion far below the skin: the wall has reached the cutting force and stays there.
  const SceneSpec spec = test::paperOneDof();
  const auto model = compile(spec, 1000);
  ASSERT_TRUE(model.ok());
  const StudyGesture gesture = studyGesture(spec, 3, 1000);
  const auto forces = axialForces(*model, gesture);
  ForceProfile profile(spec, 1000);
  int compared = 0;
  for (std::size_t i = 0; i < forces.size(); ++i) {
    const double depth_m = signedDepth(spec.limb, gesture.tips[i].p_WT_m);
    const double asked_N = profile.next(depth_m, gesture.intents[i]);
    if (gesture.intents[i] != Intent::kIn || depth_m < 0.004) continue;
    if (i < 1500) {
      EXPECT_NEAR(forces[i], asked_N, 0.06) << i;
    }  // tremor backs up by 50 µm, 500 N/m
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

TEST(Rendering, aFallAtALayersChangeIsAReleaseARiseIsNot) {
  EXPECT_TRUE(isRelease(kFlagLayerChange, -2, -1));
  EXPECT_FALSE(isRelease(kFlagLayerChange, -1, -2));
  EXPECT_FALSE(isRelease(0, -2, -1));
  EXPECT_FALSE(isRelease(kFlagRupture, -1, 0.5)) << "through zero it rises again";
}

TEST(Rendering, aHandFeelsTheWallsStiffnessAndNoneOfAForceThatIsConstant) {
  const SceneSpec spec = test::paperSixLayers();
  const auto felt = [&](AxialModel model) {
    const auto compiled = compile(likeForLike(spec, model), 1000);
    EXPECT_TRUE(compiled.ok()) << compiled.error().message;
    return feltStiffness_N_per_m(*compiled, spec);
  };
  EXPECT_NEAR(felt(AxialModel::kEnhancedTrackingWall), 500, 1);
  EXPECT_NEAR(felt(AxialModel::kVoigt), 500, 1) << "the damper is at rest";
  EXPECT_NEAR(felt(AxialModel::kDirect), 0, 1e-9) << "within a layer its force is constant";
  EXPECT_EQ(stiffnessRemark(480, 500, "the scene asks for"), "");
  EXPECT_THAT(stiffnessRemark(43, 500, "the scene asks for"),
              testing::HasSubstr("43 N/m, the scene asks for 500"));
}

TEST(StorageStudy, errorsAreWithinHalfAStepAndFewerBytesCostMoreError) {
  std::vector<std::string> notes;
  const auto rows = storageStudy({}, quiet, notes);
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  EXPECT_THAT(notes, testing::Contains(testing::HasSubstr("NEEDLELAB_DATA")));
  double bytes = 1e9;
  for (const AccuracyRow& row : *rows) {
    SCOPED_TRACE(row.reference + " " + std::to_string(*row.quantum_m));
    EXPECT_FALSE(row.uncertainty.empty());
    EXPECT_FALSE(row.cannot_show.empty());
    if (!row.model.empty()) continue;  // the engine itself; there is no bound by formula
    const double step_N = scaledResolution(*row.quantum_m).force_N;
    EXPECT_LE(*row.max_error_n, std::sqrt(3.0) / 2 * step_N + 1e-12);
    EXPECT_LE(*row.rms_error_m, *row.quantum_m / 2 + 1e-12);
    EXPECT_TRUE(row.runs_ns);
    EXPECT_LT(*row.bytes_per_sample, bytes);
    bytes = *row.bytes_per_sample;
  }
}

TEST(StorageStudy, losslessPosesGiveTheSameForcesBitForBit) {
  const auto lesson = generatedLesson();
  ASSERT_TRUE(lesson.ok());
  const auto once = recomputedForces(lesson->model, lesson->samples);
  const auto stored = decodeChunk(encodeChunk(Resolution::lossless(), lesson->samples));
  ASSERT_TRUE(stored.ok()) << stored.error().message;
  const auto again = recomputedForces(lesson->model, *stored);
  ASSERT_EQ(once.size(), again.size());
  double most_N = 0;
  for (std::size_t i = 0; i < once.size(); ++i) {
    ASSERT_EQ(once[i].z, again[i].z);
    most_N = std::max(most_N, norm(once[i]));
  }
  EXPECT_GT(most_N, 0.5) << "a lesson that never meets tissue proves nothing";
}

TEST(TlsLoopback, aFrameArrivesWholeAndTheRecordsBytesAreCounted) {
  const auto loop = TlsLoopback::open();
  ASSERT_TRUE(loop.ok()) << loop.error().message;
  pb::Envelope envelope;
  envelope.mutable_live_frame()->set_frame_seq(7);
  envelope.mutable_live_frame()->set_data(std::string(1000, 'x'));
  const auto frame = encodeFrame(envelope);
  ASSERT_TRUE(frame.ok());
  const auto before = (*loop)->cipherBytes();
  const auto arrived = (*loop)->pass(*frame);
  ASSERT_TRUE(arrived.ok()) << arrived.error().message;
  EXPECT_EQ(arrived->live_frame().frame_seq(), 7u);
  EXPECT_EQ(arrived->live_frame().data().size(), 1000u);
  // TLS 1.3: a header of 5 bytes, one for the type, a tag of 16 (RFC 8446 §5.2)
  EXPECT_EQ((*loop)->cipherBytes() - before, (*frame)->size() + kFrameHeaderBytes + 22);
}

TEST(LiveStudy, aFrameWaitsByFormulaAndALongerOneCostsFewerBytes) {
  std::vector<std::string> notes;
  const auto rows = liveStudy({}, quiet, notes);
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  for (std::size_t i = 0; i < rows->size(); ++i) {
    const AccuracyRow& row = (*rows)[i];
    // The newest sample does not wait, the oldest waits for all others. The rest is the machine's: no bound.
    EXPECT_GE(*row.latency_ms, (*row.frame_s * 1e3 - 1) / 2);
    EXPECT_TRUE(row.runs_ns);
    if (i == 0) continue;
    EXPECT_LT(*row.bytes_per_s, *(*rows)[i - 1].bytes_per_s);
  }
}

TEST(ModelStudy, everyAxialModelHasARowInEveryScene) {
  std::vector<std::string> notes;
  const auto rows = modelProfileStudy(hardlyTimed(), quiet, notes);
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  EXPECT_THAT(notes, testing::IsEmpty());
  EXPECT_EQ(rows->size(), 2 * (kAxialModelCount + 1)) << "VOIGT twice: with a raw and an adaptive velocity";
  for (const AccuracyRow& row : *rows) {
    const bool by_the_wall = row.model == "ENHANCED_TRACKING_WALL" || row.model == "TRACKING_WALL" ||
                             row.model == "PRECOMPUTED" || row.model == "STATISTICAL";
    EXPECT_EQ(row.own_law, by_the_wall) << row.model;
    EXPECT_EQ(row.cannot_show.find("own law") != std::string::npos, by_the_wall) << row.model;
    EXPECT_TRUE(row.cost && row.felt_stiffness_N_per_m) << row.model;
    if (row.model != "FEM") continue;
    // 500 N/m at the skin; deeper the tissue above the tip holds it, too, which at most doubles that. As
    // derived from lateral stiffness it was 19 N/m
    EXPECT_GT(*row.felt_stiffness_N_per_m, 450) << row.scene;
    EXPECT_LT(*row.felt_stiffness_N_per_m, 1250) << row.scene;
    EXPECT_THAT(row.cannot_show,
                testing::HasSubstr("so that the tip meets the stiffness of the scene's walls"));
  }
  std::map<std::string, const AccuracyRow*> six_layers;
  for (const AccuracyRow& row : *rows) {
    EXPECT_TRUE(row.median_ns && row.p99_ns && row.fits_rate) << row.model;
    EXPECT_FALSE(row.uncertainty.empty() || row.cannot_show.empty()) << row.model;
    if (row.scene == "paper-six-layers") six_layers[row.model] = &row;
  }
  // An unlimited spring is far off; the 2018 wall has no force on the way out; DIRECT steps at a layer.
  EXPECT_LT(*six_layers["ENHANCED_TRACKING_WALL"]->rms_error_n, *six_layers["TRACKING_WALL"]->rms_error_n);
  EXPECT_LT(*six_layers["TRACKING_WALL"]->rms_error_n, *six_layers["VOIGT"]->rms_error_n);
  EXPECT_GE(*six_layers["DIRECT"]->max_step_n, 0.5);
  EXPECT_LT(*six_layers["ENHANCED_TRACKING_WALL"]->max_step_n, 0.05);
}

TEST(RateStudy, aFasterLoopIsNearerToTheFastestAndCostsMore) {
  std::vector<std::string> notes;
  const auto rows = rateStudy(hardlyTimed(), quiet, notes);
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  const AccuracyRow* slower = nullptr;
  for (const AccuracyRow& row : *rows) {
    if (slower != nullptr && slower->scene == row.scene) {
      EXPECT_GT(*row.rate_hz, *slower->rate_hz);
      EXPECT_LT(*row.rms_error_n, *slower->rms_error_n) << row.scene << " at " << *row.rate_hz;
      // b/(T (1/2 + delay))/K grows as the rate does
      EXPECT_NEAR(*row.stiffness_margin / *slower->stiffness_margin, *row.rate_hz / *slower->rate_hz, 1e-9);
    }
    slower = &row;
  }
  // 1.7 N·s/m, a tick of delay, 500 N/m
  EXPECT_NEAR(*rows->front().stiffness_margin, 1.7 / (1.5 / 250) / 500, 1e-9);
}

}  // namespace
}  // namespace needlelab
