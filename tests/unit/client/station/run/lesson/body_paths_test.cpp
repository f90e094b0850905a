// Paths in a body: the follower's are the engine's; a replay that has them has the engine's bits from the
// next insertion on, wherever it begins; one that has none says so.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include "client/net/spool/spool_writer.h"
#include "client/station/run/lesson/memory_follower.h"
#include "client/view/model/gesture_replica.h"
#include "common/gesture/chunk.h"
#include "common/haptics/body/body_engine.h"
#include "common/haptics/body/path_snapshot.h"
#include "tests/support/anatomy/bodies.h"
#include "tests/support/anatomy/late_paths.h"
#include "tests/support/scenes/motions.h"
#include "tests/support/scenes/stored_sample.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/client/net/spool/spool_samples.h"

namespace needlelab::test {
namespace {

/// An arm whose skin is tough.
SceneSpec armScene() {
  FieldSpec field = arm();
  field.structures[0].layer.membrane = MembraneSpec{800, 4e5, 1.5};
  return sceneIn(field);
}

/// Insertions beside each other, the first onto the bone; then a hand that tilts and moves aside.
Motion armMotion() {
  constexpr std::pair<double, double> kAsideAndLength_m[] = {{0, 0.032}, {0.006, 0.030}, {-0.012, 0.020}};
  Motion motion;
  for (const auto& [aside_m, length_m] : kAsideAndLength_m) {
    Site site = defaultSite();
    site.p_surface_m = site.p_surface_m + site.across_2 * aside_m;
    const Vec3 way = tilted(site.inward, 10 * aside_m, site.across_2);
    const Motion once =
        withTremor(insertHoldWithdraw(1000, site, way, way, length_m, 0.04, 0.4, 0.01), 1000, 2e-4, 7);
    motion.insert(motion.end(), once.begin(), once.end());
  }
  return joined(motion, randomGesture(5, 1000, defaultSite()));
}

std::vector<std::uint64_t> bitsOf(const StepReport& r) {
  std::vector<std::uint64_t> bits = {r.flags, static_cast<std::uint64_t>(r.layer),
                                     static_cast<std::uint64_t>(r.phase)};
  for (const double number :
       {r.wrench_W.force_N.x, r.wrench_W.force_N.y, r.wrench_W.force_N.z, r.wrench_W.torque_Nm.x,
        r.wrench_W.torque_Nm.y, r.wrench_W.torque_Nm.z, r.depth_m, r.insertion_m, r.speed_mps,
        r.lateral_error_m, r.cutting_N, r.attracted_N, r.friction_N, r.puncture_N, r.clamping_N})
    bits.push_back(std::bit_cast<std::uint64_t>(number));
  return bits;
}

struct Recorded {
  std::vector<StepReport> reports;  // by tick
  std::vector<GestureSample> samples;
  std::vector<Bytes> chunks;                                         // lossless
  std::vector<std::pair<std::vector<GestureSample>, Bytes>> pieces;  // for viewers, each with its paths
};

/// A session as a station steps and records it; some of its paths are late.
class BodyPaths : public testing::Test {
 protected:
  void SetUp() override {
    const TempFolder folder;
    const auto spool = std::move(*Spool::open(folder.path()));
    auto description = describeSession(makeUuidV7());
    setResolution(description, Resolution::lossless());
    const auto session = *spool->create(description);
    const auto ring = std::make_unique<SampleRing>();
    FakeTime time;
    MemoryFollower follower(*model_);
    SpoolWriter::Callbacks callbacks;
    callbacks.cut_memory = [&](const GestureSample& sample, bool wanted) {
      follower.follow(sample);
      return wanted ? follower.cuts() : Bytes();
    };
    callbacks.paths = [&](bool first) { return follower.path(first); };
    callbacks.piece = [&](const SamplePiece& piece) {
      recorded_.pieces.emplace_back(*piece.samples, follower.pathsDue());
    };
    SpoolWriter writer(*ring, session, {.time = &time, .threads = false}, std::move(callbacks));
    LatePaths paths(*model_, [](int ask, const PathAsk&) { return ask % 3 == 2 ? 1 : 0; });
    SceneEngine engine(*model_, &paths);
    std::uint64_t tick = 0;
    for (const TipSample& tip : armMotion()) {
      StepReport report;
      engine.step(tip, report);
      recorded_.reports.push_back(report);
      recorded_.samples.push_back(storedSample(tick, tip, report));
      ASSERT_TRUE(ring->push(recorded_.samples.back()));
      if (++tick % 300 == 0) writer.writePass();
    }
    ASSERT_TRUE(writer.finish(std::chrono::seconds(1)).ok());
    for (std::uint64_t seq = 0; seq < session->contents().chunks; ++seq)
      recorded_.chunks.push_back(*session->readChunk(seq));
    const auto has = [&](std::uint32_t flag) {
      return std::count_if(recorded_.reports.begin(), recorded_.reports.end(),
                           [&](const StepReport& r) { return r.layer >= 0 && (r.flags & flag) != 0; });
    };
    ASSERT_GT(recorded_.chunks.size(), 5u);
    ASSERT_GT(has(kFlagEntry), 3);
    ASSERT_GT(has(kFlagNewPath), 20);
    ASSERT_GT(has(kFlagKeptPath), 20);
  }

  /// Inside, the replica has the engine's bits from the first entry it sees on, and is called approximate
  /// before.
  void expectExactFromTheNextEntry(const GestureReplica& replica, const GestureSample& sample,
                                   bool& entered) {
    entered = entered || (sample.flags & kFlagEntry) != 0;
    if (sample.layer < 0) return;
    if (!entered) {
      ASSERT_TRUE(replica.now().approximate) << sample.tick;
      return;
    }
    ASSERT_FALSE(replica.now().approximate) << sample.tick;
    StepReport as_stored = replica.report();
    // a reader that joined later asks in other ticks
    as_stored.flags = (as_stored.flags & ~kFlagKeptPath) | (sample.flags & kFlagKeptPath);
    ASSERT_EQ(bitsOf(as_stored), bitsOf(recorded_.reports[sample.tick])) << sample.tick;
    ++exact_;
  }

  const std::shared_ptr<const SceneModel> model_ =
      std::make_shared<const SceneModel>(*compile(armScene(), 1000));
  Recorded recorded_;
  std::size_t exact_ = 0;
};

TEST_F(BodyPaths, aReplayFromAnyChunkIsExactFromTheNextInsertion) {
  for (std::size_t begin = 0; begin < recorded_.chunks.size(); ++begin) {
    GestureReplica replica(model_);
    bool entered = false;
    for (std::size_t c = begin; c < recorded_.chunks.size(); ++c) {
      replica.takePaths(pathListOf(recorded_.chunks[c]));
      const auto samples = decodeChunk(recorded_.chunks[c]);
      ASSERT_TRUE(samples.ok()) << samples.error().message;
      for (const GestureSample& sample : *samples) {
        replica.feed(sample);
        expectExactFromTheNextEntry(replica, sample, entered);
        if (HasFatalFailure()) return;
      }
    }
  }
  EXPECT_GT(exact_, recorded_.samples.size());
}

TEST_F(BodyPaths, aViewerWhoJoinsLateIsExactFromTheNextInsertion) {
  for (std::size_t begin = 0; begin < recorded_.pieces.size(); begin += 17) {
    GestureReplica replica(model_);
    bool entered = false;
    for (std::size_t p = begin; p < recorded_.pieces.size(); ++p) {
      replica.takePaths(recorded_.pieces[p].second);
      for (const GestureSample& sample : recorded_.pieces[p].first) {
        replica.feed(sample);
        expectExactFromTheNextEntry(replica, sample, entered);
        if (HasFatalFailure()) return;
      }
    }
  }
  EXPECT_GT(exact_, recorded_.samples.size());
}

TEST_F(BodyPaths, withoutPathsEverythingInsideIsCalledApproximate) {
  GestureReplica replica(model_);
  for (const GestureSample& sample : recorded_.samples) {
    replica.feed(sample);
    ASSERT_EQ(replica.now().approximate, sample.layer >= 0) << sample.tick;
  }
}

// each stored number errs by half a step, which the replica may not take for a difference
TEST_F(BodyPaths, roundedSamplesWithPathsAreNotApproximate) {
  GestureReplica replica(model_);
  std::size_t inside = 0, approximate = 0;
  for (const Bytes& chunk : recorded_.chunks) {
    const Bytes rounded = encodeChunk(Resolution::standard(), *decodeChunk(chunk), {}, pathListOf(chunk));
    replica.takePaths(pathListOf(rounded));
    const auto samples = decodeChunk(rounded);
    ASSERT_TRUE(samples.ok()) << samples.error().message;
    for (const GestureSample& sample : *samples) {
      replica.feed(sample);
      inside += sample.layer >= 0 ? 1u : 0u;
      approximate += replica.now().approximate ? 1u : 0u;
    }
  }
  EXPECT_GT(inside, 3000u);
  EXPECT_EQ(approximate, 0u);
}

TEST_F(BodyPaths, aMissingPathMakesTheRestOfItsInsertionApproximate) {
  std::vector<PathSnapshot> paths;
  for (const Bytes& chunk : recorded_.chunks)
    for (const PathSnapshot& path : pathsIn(pathListOf(chunk))) paths.push_back(path);
  const auto is = [&](const PathSnapshot& path, std::uint32_t flag) {
    const GestureSample& sample = recorded_.samples[path.tick];
    return sample.layer >= 0 && (sample.flags & flag) != 0;
  };
  const auto entry =
      std::find_if(paths.begin(), paths.end(), [&](const auto& path) { return is(path, kFlagEntry); });
  const auto missing =
      std::find_if(entry + 1, paths.end(), [&](const auto& path) { return is(path, kFlagNewPath); });
  ASSERT_NE(missing, paths.end());
  const std::uint64_t from = missing->tick;
  paths.erase(missing);
  GestureReplica replica(model_);
  bool known = true;
  std::size_t next = 0;
  for (const GestureSample& sample : recorded_.samples) {
    while (next < paths.size() && paths[next].tick <= sample.tick) replica.takePath(paths[next++]);
    replica.feed(sample);
    if (sample.tick == from) known = false;
    if ((sample.flags & kFlagEntry) != 0) known = true;
    if (sample.layer >= 0) {
      ASSERT_EQ(replica.now().approximate, !known) << sample.tick;
    }
  }
}

TEST_F(BodyPaths, aFollowerThatLostSamplesSendsNoMorePaths) {
  MemoryFollower follower(*model_);
  bool disagreed = false;
  std::size_t before = 0;
  for (const GestureSample& sample : recorded_.samples) {
    if (sample.tick >= 300 && sample.tick < 333) continue;
    follower.follow(sample);
    const bool any = !follower.path(true).empty();
    before += any && sample.tick < 300 ? 1 : 0;
    if (sample.tick > 333 && !any && !disagreed) {
      disagreed = true;
      follower.pathsDue();  // those from before
    }
    ASSERT_FALSE(disagreed && any) << sample.tick;
  }
  EXPECT_GT(before, 200u);
  EXPECT_TRUE(disagreed);
  EXPECT_TRUE(follower.pathsDue().empty());
}

}  // namespace
}  // namespace needlelab::test
