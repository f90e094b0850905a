/// A reader's engine: it takes the station's paths, keeps its own where there are none, and survives any.
#include "common/haptics/body/given_paths.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "tests/support/anatomy/bodies.h"
#include "tests/support/random.h"
#include "tests/support/scenes/motions.h"
#include "tests/unit/common/haptics/runs.h"

namespace needlelab::test {
namespace {

SceneModel inTheArm() {
  return compiled(sceneIn(arm()), kRate_hz);
}

StoredTick storedOf(const StepReport& report) {
  return {report.wrench_W.force_N, report.p_wall_W_m, report.layer, report.phase, report.flags};
}

/// The station: every tick with its report, and the path that it was stepped with.
struct Station {
  Motion motion = randomGesture(11, kRate_hz, defaultSite());
  std::vector<StepReport> reports;
  std::vector<PathSnapshot> paths;  // as in a recording: at entries, and new ones inside

  explicit Station(const SceneModel& model) {
    SceneEngine engine(model);
    for (std::uint64_t tick = 0; tick < motion.size(); ++tick) {
      StepReport& report = reports.emplace_back();
      engine.step(motion[tick], report);
      const bool begins = engine.state().inside && (report.flags & kFlagNewPath) != 0;
      if (begins || (report.flags & kFlagEntry) != 0) paths.push_back({tick, engine.pathInUse()});
    }
  }
};

TEST(GivenPaths, anEngineThatContinuesAnotherHasItsBits) {
  const auto model = std::make_unique<SceneModel>(inTheArm());
  const Station station(*model);
  SceneEngine whole(*model), part(*model);
  StepReport of_whole, of_part;
  for (std::size_t tick = 0; tick < station.motion.size(); ++tick) {
    if (tick % 137 == 0) part.continueFrom(whole);
    whole.step(station.motion[tick], of_whole);
    part.step(station.motion[tick], of_part);
    ASSERT_EQ(of_part.wrench_W.force_N, of_whole.wrench_W.force_N) << tick;
    ASSERT_EQ(of_part.depth_m, of_whole.depth_m) << tick;
    ASSERT_EQ(of_part.flags, of_whole.flags) << tick;
  }
}

TEST(GivenPaths, areKnownWhenTheEntrysAndEachNewOneWereTaken) {
  const auto model = std::make_unique<SceneModel>(inTheArm());
  const Station station(*model);
  ASSERT_GT(station.paths.size(), 20u);
  for (const std::size_t missing : {station.paths.size(), std::size_t{0}, std::size_t{5}}) {
    SceneEngine reader(*model);
    GivenPaths paths;
    for (std::size_t i = 0; i < station.paths.size(); ++i)
      if (i != missing) paths.take(station.paths[i]);
    bool known = false;
    StepReport report;
    for (std::uint64_t tick = 0; tick < station.motion.size(); ++tick) {
      const StoredTick stored = storedOf(station.reports[tick]);
      paths.giveFor(tick, stored, reader);
      reader.stepAsStored(station.motion[tick], stored, report);
      if ((stored.flags & kFlagEntry) != 0) known = true;
      if (missing < station.paths.size() && tick == station.paths[missing].tick) known = false;
      ASSERT_EQ(paths.unknown(), !known) << missing << ", " << tick;
      if (!known || stored.layer < 0) continue;
      ASSERT_EQ(report.wrench_W.force_N, stored.force_W_N) << missing << ", " << tick;
    }
  }
}

TEST(GivenPaths, anEarlierTickForgetsThePathsOfLaterOnes) {
  GivenPaths paths;
  EXPECT_TRUE(paths.noneFrom(0));
  PathSnapshot path;
  for (const std::uint64_t tick : {50, 60, 70}) {
    path.tick = tick;
    paths.take(path);
  }
  EXPECT_FALSE(paths.noneFrom(70));
  EXPECT_TRUE(paths.noneFrom(71));
  path.tick = 10;
  paths.take(path);
  EXPECT_FALSE(paths.noneFrom(10));
  EXPECT_TRUE(paths.noneFrom(11));
}

/// A path that decodePath takes, with nothing to do with the body.
PathSnapshot anyPath(Random& random, std::uint64_t tick) {
  const auto direction = [&] {
    return normalized(Vec3{random.in(-1, 1), random.in(-1, 1), random.in(0.1, 1)});
  };
  PathSnapshot made;
  made.tick = tick;
  PathLayers& path = made.path;
  path.point_W_m = randomPoint(random, {-5, -5, -5}, {5, 5, 5});
  path.normal_W = direction();
  path.asked_depth_m = random.in(0, 0.02);
  path.ball_W_m = randomPoint(random, {-5, -5, -30}, {5, 5, 0});
  path.ball_radius_m = random.in(0, 0.05);
  path.count = static_cast<std::uint32_t>(random.in(1, 8));
  for (std::uint32_t i = 0; i < path.count; ++i)
    path.layers[i] = {static_cast<StructureIndex>(random.in(0, 5)),
                      i == 0 ? 0 : path.layers[i - 1].top_m + random.in(1e-9, 0.005)};
  if (random.in(0, 1) < 0.2 && path.count > 1) path.layers[path.count - 1].structure = kOutside;
  return made;
}

TEST(GivenPaths, pathsOfAnotherBodyLeaveForcesWithinTheirBound) {
  const auto model = std::make_unique<SceneModel>(inTheArm());
  const Station station(*model);
  Random random(4);
  std::size_t inside = 0;
  for (int run = 0; run < 10; ++run) {
    SceneEngine reader(*model);
    GivenPaths paths;
    StepReport report;
    for (std::uint64_t tick = 0; tick < station.motion.size(); ++tick) {
      StoredTick stored = storedOf(station.reports[tick]);
      if (random.in(0, 1) < 0.05) {
        const auto decoded = decodePath(encodePath(anyPath(random, tick)));
        ASSERT_TRUE(decoded.ok()) << decoded.error().message;
        paths.take(*decoded);
        if (random.in(0, 1) < 0.7) stored.flags |= random.in(0, 1) < 0.2 ? kFlagEntry : kFlagNewPath;
      }
      paths.giveFor(tick, stored, reader);
      reader.stepAsStored(station.motion[tick], stored, report);
      ASSERT_LE(norm(report.wrench_W.force_N), model->body_spec->max_force_N + 1e-9) << run << ", " << tick;
      inside += reader.state().inside ? 1u : 0u;
    }
  }
  EXPECT_GT(inside, 1000u);
}

}  // namespace
}  // namespace needlelab::test
