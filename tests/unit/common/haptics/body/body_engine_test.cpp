/// The engine in a body: where a body is as simple as shells, its forces are the shells'; what a path may
/// change, and when.
#include "common/haptics/body/body_engine.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "common/anatomy/march.h"
#include "common/haptics/models/like_for_like.h"
#include "tests/support/anatomy/bodies.h"
#include "tests/support/anatomy/late_paths.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/support/reference/reference_engine.h"
#include "tests/unit/common/haptics/runs.h"

namespace needlelab::test {
namespace {

constexpr double kPi_rad = std::numbers::pi;
constexpr std::uint64_t kPathWait = 5;  // of a path, at 1 kHz

/// Straight from one place to another.
void moveTo(Motion& motion, Vec3 to, Quat q, double speed_mps) {
  const Vec3 from = motion.empty() ? to : motion.back().p_WT_m;
  const auto ticks = static_cast<int>(std::ceil(norm(to - from) / speed_mps * kRate_hz));
  for (int k = 1; k <= ticks; ++k)
    motion.push_back({from + (to - from) * (k / static_cast<double>(ticks)), q});
}
void hold(Motion& motion, int ticks) {
  const TipSample last = motion.back();
  for (int k = 0; k < ticks; ++k) motion.push_back(last);
}

/// From 20 mm above the skin at (x, y), along the needle, to a depth along it, and out again.
Motion insertion(Vec3 skin_m, double angle_rad, double depth_m, double speed_mps) {
  const Quat q = leaning(angle_rad);
  const Vec3 axis = zAxis(q);
  Motion motion{{skin_m - axis * 0.02, q}};
  hold(motion, 50);
  moveTo(motion, skin_m + axis * depth_m, q, speed_mps);
  hold(motion, 300);
  moveTo(motion, skin_m - axis * 0.01, q, speed_mps);
  return motion;
}

std::vector<StepReport> runInBody(const SceneSpec& spec, const Motion& motion) {
  const auto model = std::make_unique<SceneModel>(compiled(spec, kRate_hz));
  SceneEngine engine(*model);
  std::vector<StepReport> reports;
  for (const TipSample& sample : motion) engine.step(sample, reports.emplace_back());
  return reports;
}

class SlabInABody : public testing::TestWithParam<AxialModel> {};

TEST_P(SlabInABody, feelsAsTheSameLayersInShells) {
  SceneSpec body = sceneIn(slabOfTissue());
  body.effects &= ~bitOf(Effect::kBone);
  body = likeForLike(body, GetParam());
  for (const double degrees : {0.0, 25.0, -50.0}) {
    const Motion motion = insertion({0.004, -0.003, 0}, degrees * kPi_rad / 180, 0.02, 0.03137);
    const auto in_body = runInBody(body, motion);
    const auto in_shells = EngineRun(slabAsShells(body), kRate_hz).run(motion);
    double most_N = 0;
    bool entered = false;
    for (std::size_t i = 0; i < motion.size(); ++i) {
      SCOPED_TRACE("tick " + std::to_string(i));
      const StepReport &a = in_body[i], &b = in_shells[i];
      ASSERT_NEAR(norm(a.wrench_W.force_N - b.wrench_W.force_N), 0, 2e-4);  // boundaries are found to 0.1 µm
      ASSERT_EQ(a.layer, b.layer < 0 ? -1 : kSlabStructures[b.layer]);
      ASSERT_EQ(a.phase, b.phase);
      most_N = std::max(most_N, norm(b.wrench_W.force_N));
      entered = entered || (a.flags & kFlagEntry) != 0;
    }
    EXPECT_TRUE(entered);
    EXPECT_GT(most_N, 0.5) << "the comparison has forces to compare";
  }
}
INSTANTIATE_TEST_SUITE_P(Models, SlabInABody,
                         testing::Values(AxialModel::kEnhancedTrackingWall, AxialModel::kTrackingWall,
                                         AxialModel::kDirect, AxialModel::kVoigt, AxialModel::kGodObject,
                                         AxialModel::kFirstOrder, AxialModel::kOkamura, AxialModel::kDahl),
                         [](const auto& info) { return std::string(axialModelName(info.param)); });

TEST(BodyEngine, refusesModelsThatNeedLayersAtFixedDepths) {
  for (const AxialModel model : {AxialModel::kFem, AxialModel::kPrecomputed, AxialModel::kStatistical}) {
    SceneSpec spec = sceneIn(slabOfTissue());
    spec.axial_model = model;
    const Status status = validate(spec);
    ASSERT_FALSE(status.ok());
    EXPECT_NE(status.error().message.find("does not work in a volume"), std::string::npos)
        << status.error().message;
  }
}

// a straight needle beside the middle of a round arm meets its layers where the circle does
TEST(BodyEngine, meetsARoundArmsLayersAtTheirChords) {
  const double beside_m = 0.015;
  const double skin_m = std::sqrt(0.04 * 0.04 - beside_m * beside_m);
  const double muscle_m = std::sqrt(0.038 * 0.038 - beside_m * beside_m);
  Motion motion{{{0, beside_m, 0.01}, leaning(0)}};
  hold(motion, 50);
  moveTo(motion, {0, beside_m, -0.03}, leaning(0), 0.02);
  const auto reports = runInBody(sceneIn(arm()), motion);
  double entry_m = 0, change_m = 0;
  for (std::size_t i = 1; i < motion.size(); ++i) {
    const double below_m = -0.04 + skin_m - motion[i].p_WT_m.z;
    if (reports[i].layer == 0 && reports[i - 1].layer < 0) entry_m = below_m;
    if (reports[i].layer == 1 && reports[i - 1].layer == 0) change_m = below_m;
  }
  EXPECT_NEAR(entry_m, 0, 0.04e-3);  // a tick is 0.02 mm
  EXPECT_NEAR(change_m, skin_m - muscle_m, 0.06e-3);
}

TEST(BodyEngine, usesAPathFiveMillisecondsAfterItWasAsked) {
  SceneSpec spec = sceneIn(arm());
  Motion motion{{{0, 0, 0.02}, leaning(0)}};
  hold(motion, 200);  // nothing new to ask
  moveTo(motion, {0, 0.02, 0.02}, leaning(0), 0.1);
  const auto reports = runInBody(spec, motion);
  std::vector<std::size_t> used;
  for (std::size_t i = 0; i < reports.size(); ++i) {
    EXPECT_EQ(reports[i].flags & kFlagKeptPath, 0u);
    if ((reports[i].flags & kFlagNewPath) != 0) used.push_back(i);
  }
  ASSERT_GE(used.size(), 3u);
  EXPECT_EQ(used[0], kPathWait);
  EXPECT_GT(used[1], 200u) << "a resting hand asks for nothing";
  for (std::size_t i = 2; i < used.size(); ++i) EXPECT_GE(used[i] - used[i - 1], kPathWait);
}

TEST(BodyEngine, keepsItsPathWhileTheNextIsLateAndSaysSo) {
  const auto model = std::make_unique<SceneModel>(compiled(sceneIn(arm()), kRate_hz));
  LatePaths late(*model, [](int ask, const PathAsk&) { return ask == 0 ? 0 : 2; });
  SceneEngine engine(*model, &late);
  Motion motion{{{0, 0, 0.02}, leaning(0)}};
  hold(motion, 30);
  moveTo(motion, {0, 0.02, 0.02}, leaning(0), 0.05);
  StepReport report;
  std::vector<std::size_t> kept, used;
  for (std::size_t i = 0; i < motion.size(); ++i) {
    engine.step(motion[i], report);
    if ((report.flags & kFlagKeptPath) != 0) kept.push_back(i);
    if ((report.flags & kFlagNewPath) != 0) used.push_back(i);
  }
  ASSERT_GE(used.size(), 3u);
  ASSERT_GE(kept.size(), 2u);
  EXPECT_EQ(kept[1] - kept[0], kPathWait);
  EXPECT_EQ(used[1] - kept[1], kPathWait) << "late twice";
}

TEST(BodyEngine, followsAStationsLatePathsFromItsTicks) {
  const auto model = std::make_unique<SceneModel>(compiled(sceneIn(arm()), kRate_hz));
  LatePaths late(*model, [](int ask, const PathAsk&) { return ask == 0 ? 0 : 1; });
  SceneEngine station(*model, &late), follower(*model);
  Motion motion = insertion({0, 0.012, -0.001}, 0.3, 0.03, 0.04);
  StepReport report, followed;
  for (std::size_t i = 0; i < motion.size(); ++i) {
    station.step(motion[i], report);
    StoredTick stored;
    stored.force_W_N = report.wrench_W.force_N;
    stored.p_wall_W_m = report.p_wall_W_m;
    stored.layer = report.layer;
    stored.phase = report.phase;
    stored.flags = report.flags;
    follower.stepAsStored(motion[i], stored, followed);
    ASSERT_EQ(followed.wrench_W.force_N, report.wrench_W.force_N) << i;
    ASSERT_EQ(followed.layer, report.layer) << i;
    ASSERT_EQ(followed.flags, report.flags) << i;
  }
  EXPECT_EQ(hashOf(follower.state()), hashOf(station.state()));
}

TEST(BodyEngine, ticksNeverUseTheHeapOnPathsThatAnotherMade) {
  /// Made beforehand; the engine's ticks only take them.
  class Beforehand final : public PathMaker {
   public:
    void ask(const PathAsk&) noexcept override {}
    bool take(PathStack*& made) noexcept override {
      made = next < made_.size() ? made_[next++] : nullptr;
      return true;
    }
    void retire(PathStack* path) noexcept override { retired[count++ % retired.size()] = path; }
    std::vector<PathStack*> made_;
    std::size_t next = 0, count = 0;
    std::array<PathStack*, 4096> retired{};
  };
  const auto model = std::make_unique<SceneModel>(compiled(sceneIn(arm()), kRate_hz));
  const Motion motion = insertion({0, 0.002, 0}, 0.1, 0.035, 0.04);  // on to bone
  Beforehand paths;
  std::vector<std::unique_ptr<PathStack>> owned;
  {
    SceneEngine engine(*model);
    StepReport report;
    for (const TipSample& sample : motion) {
      engine.step(sample, report);
      if ((report.flags & kFlagNewPath) != 0) owned.push_back(compilePath(*model, *engine.path()));
    }
  }
  for (const auto& path : owned) paths.made_.push_back(path.get());
  std::uint64_t calls = 0;
  std::uint32_t seen = 0;
  bool touched = false;
  {
    SceneEngine engine(*model, &paths);
    StepReport report;
    {
      const NoAllocScope scope;
      for (const TipSample& sample : motion) {
        engine.step(sample, report);
        seen |= report.flags;
        touched = touched || engine.state().bone.touching;
      }
      calls = scope.calls();
    }
  }
  EXPECT_EQ(calls, 0u);
  EXPECT_TRUE(seen & kFlagEntry);
  EXPECT_TRUE(seen & kFlagNewPath);
  EXPECT_TRUE(touched);
}

/// The layers along a line, by asking the field every 5 µm; slivers go to the layer before.
std::vector<std::pair<int, double>> layersByAsking(const Field& field, Vec3 from_m, Vec3 axis, double reach_m,
                                                   double min_m) {
  constexpr double kStep_m = 5e-6;
  std::vector<std::pair<int, double>> runs;
  for (double t_m = kStep_m; t_m < reach_m; t_m += kStep_m) {
    const StructureIndex here = field.at(from_m + axis * t_m).structure;
    if (here == kOutside) break;
    if (runs.empty() || runs.back().first != here) runs.emplace_back(here, runs.empty() ? 0.0 : t_m);
  }
  for (std::size_t i = 1; i + 1 < runs.size();) {
    const bool sliver = runs[i + 1].second - runs[i].second < min_m;
    if (!sliver) {
      ++i;
      continue;
    }
    runs.erase(runs.begin() + static_cast<std::ptrdiff_t>(i));
    if (runs[i].first == runs[i - 1].first) runs.erase(runs.begin() + static_cast<std::ptrdiff_t>(i));
  }
  return runs;
}

// straight needles into the forearm: the reference engine, written from FORCE_MODEL.md, in the layers that
// the field has along the line
TEST(BodyEngine, feelsTheLayersThatTheFieldHasAlongTheNeedle) {
  FieldSpec spec = forearm();
  for (std::size_t i = 0; i < spec.structures.size(); ++i) {
    const bool is_bone = spec.structures[i].layer.is_bone;
    spec.structures[i].layer = tissue(0.3 + 0.25 * static_cast<double>(i), 5 + 3 * static_cast<double>(i));
    spec.structures[i].layer.is_bone = is_bone;
  }
  SceneSpec body = sceneIn(spec);
  body.needle_length_m = 0.03;
  body.effects = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted) | bitOf(Effect::kShaftFriction);
  const Field field = fieldOf(spec);
  const FieldBody skin(fieldOf(spec));
  Random random(5);
  double sum_N2 = 0;
  int ticks = 0, met = 0;
  for (int i = 0; i < 60; ++i) {
    const Vec3 from_m = randomPoint(random, {-20, -14, 0}, {30, 14, 0});
    const double angle = random.in(-0.5, 0.5);
    const Vec3 axis = zAxis(leaning(angle));
    const Vec3 above_m = Vec3{from_m.x, from_m.y, 0.004};
    const auto entry = findEntry(field, above_m, axis, 0.03);
    if (!entry) continue;
    const Vec3 entry_m = above_m + axis * *entry, normal = skin.normal(entry_m);
    const double slant = -dot(normal, axis);
    const auto layers = layersByAsking(field, entry_m, axis, 0.03, 0.35e-3);
    SceneSpec shells = body;
    shells.limb = PlaneLimb{entry_m, normal};
    shells.layers.clear();
    for (std::size_t k = 0; k < layers.size(); ++k) {
      LayerSpec layer = body.layers[static_cast<std::size_t>(layers[k].first)];
      layer.is_bone = false;
      layer.thickness_m = k + 1 < layers.size() ? (layers[k + 1].second - layers[k].second) * slant : 1;
      shells.layers.push_back(layer);
    }
    Motion motion{{entry_m - axis * 0.006, leaning(angle)}};
    hold(motion, 50);
    moveTo(motion, entry_m + axis * 0.015, leaning(angle), 0.02);
    const auto reports = runInBody(body, motion);
    ReferenceEngine reference(shells, kRate_hz);
    for (std::size_t k = 0; k < motion.size(); ++k) {
      const auto wanted = reference.step(motion[k]);
      if (reports[k].layer < 0) continue;
      const double off_N = norm(reports[k].wrench_W.force_N - wanted.wrench_W.force_N);
      sum_N2 += off_N * off_N;
      ++ticks;
    }
    met += static_cast<int>(layers.size());
  }
  EXPECT_GT(met, 250) << "many layers";
  EXPECT_LT(std::sqrt(sum_N2 / ticks), 0.02);
}

TEST(BodyEngine, restsOnRoundBoneAndReportsItsStructure) {
  // straight down onto the middle of the bone: its top is 29 mm below the skin
  Motion motion{{{0, 0, 0.02}, leaning(0)}};
  hold(motion, 50);
  moveTo(motion, {0, 0, -0.031}, leaning(0), 0.02);
  hold(motion, 400);
  const auto reports = runInBody(sceneIn(arm()), motion);
  const StepReport& last = reports.back();
  EXPECT_EQ(last.layer, 2) << "the bone's structure";
  EXPECT_NEAR(last.stage_N[stageOf(Effect::kBone)], 600 * 0.002, 0.01);
}

TEST(BodyEngine, startsInsideWithoutForceUntilItWasOutside) {
  Motion motion{{{0, 0, -0.01}, leaning(0)}};
  hold(motion, 100);
  const auto reports = runInBody(sceneIn(arm()), motion);
  EXPECT_EQ(reports.back().wrench_W.force_N, Vec3{});
  EXPECT_TRUE(reports.back().flags & kFlagStartedInside);
}

}  // namespace
}  // namespace needlelab::test
