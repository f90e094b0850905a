// The station's report of old cuts, in chunks and to viewers, matches its engine's memory; and a replay that
// begins anywhere in the recording gives the same bits as one from its beginning.
#include "client/station/run/lesson/memory_follower.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "client/device/hand/hand_plan.h"
#include "client/net/spool/spool_writer.h"
#include "client/view/model/gesture_replica.h"
#include "common/gesture/chunk.h"
#include "common/haptics/cut_snapshot.h"
#include "common/haptics/effects/effect_entry.h"
#include "tests/support/scenes/motions.h"
#include "tests/support/scenes/scenes.h"
#include "tests/support/scenes/stored_sample.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/client/net/spool/spool_samples.h"

namespace needlelab::test {
namespace {

SceneSpec rememberingScene() {
  SceneSpec scene = allEffects();
  scene.effects |= bitOf(Effect::kCutMemory);
  useUsualNumbers(effectEntry(Effect::kCutMemory), scene);
  return scene;
}

// through a round limb, and a FAULT there: after it the needle is outside, as for the station's loop
TEST(MemoryFollower, aFaultEndsAnInsertionThroughTheLimb) {
  SceneSpec scene = withLimb(rememberingScene(), LimbKind::kSphere);
  scene.needle_length_m = 0.3;
  scene.effects &= ~bitOf(Effect::kBone);
  const auto model = std::make_unique<SceneModel>(*compile(scene, 1000));
  const Site site = siteOf(LimbKind::kSphere);
  for (const bool fault : {true, false}) {
    MemoryFollower follower(*model);
    std::uint64_t tick = 0;
    const auto go = [&](double deep_m, std::uint8_t fault_now) {
      GestureSample sample =
          storedSample(tick++, {site.p_surface_m + site.inward * deep_m, orientationAlong(site.inward)}, {});
      sample.fault = fault_now;
      if (fault_now != 0) sample.flags = kFlagNotStepped;
      follower.follow(sample);
    };
    for (int k = -100; k <= 1900; ++k) go(1e-4 * k, 0);  // the sphere is 160 mm thick
    EXPECT_TRUE(follower.cuts().empty()) << "it is through";
    for (int k = 0; fault && k < 100; ++k) go(0.19, 1);
    for (int k = 0; k < 100; ++k) go(0.19, 0);
    EXPECT_EQ(follower.cuts().empty(), !fault);
  }
}

// A press beyond the ball's radius is no insertion, and leaves no cut.
TEST(MemoryFollower, aCappedPressIsNoInsertion) {
  SceneSpec scene = rememberingScene();
  scene.effects |= bitOf(Effect::kPalpation);
  useUsualNumbers(effectEntry(Effect::kPalpation), scene);
  const auto model = std::make_unique<SceneModel>(*compile(scene, 1000));
  const Site site = defaultSite();
  for (const bool capped : {true, false}) {
    MemoryFollower follower(*model);
    std::uint64_t tick = 0;
    const auto go = [&](double deep_m) {
      GestureSample sample =
          storedSample(tick++, {site.p_surface_m + site.inward * deep_m, orientationAlong(site.inward)}, {});
      sample.flags |= capped ? std::uint32_t{kFlagCapped} : 0u;
      follower.follow(sample);
    };
    for (int k = -200; k <= 200; ++k) go(1e-4 * k);
    for (int k = 200; k >= -200; --k) go(1e-4 * k);
    const auto cuts = decodeCuts(follower.cuts());
    ASSERT_TRUE(cuts);
    EXPECT_EQ(cuts->insertions, capped ? 0u : 1u);
  }
}

TEST(MemoryFollower, reportsCutsAtEachExitAndOnceASecondOutside) {
  const auto model = std::make_unique<SceneModel>(*compile(rememberingScene(), 1000));
  const auto engine = std::make_unique<SimState>();
  MemoryFollower follower(*model);
  StepReport report;
  std::uint64_t tick = 0, told_at = 0;
  int exits = 0, seconds = 0;
  bool left = false;
  Motion motion = randomGesture(3, 1000, defaultSite());
  motion.insert(motion.end(), 3500, motion.back());  // at rest outside
  for (const TipSample& tip : joined(motion, randomGesture(4, 1000, defaultSite()))) {
    GestureSample sample = storedSample(tick, tip, {});
    bool outside = false;
    // the gate refused this one, and the sample holds a corrupt pose
    if (tick % 50 == 7) {
      sample.flags = kFlagNotStepped;
      sample.p_WT_m[2] += 0.01;
    } else {
      step(*model, tip, *engine, report);
      left = left || (report.flags & kFlagExit) != 0;
      outside = !engine->inside && report.depth_m <= -1e-5;
    }
    follower.follow(sample);
    const Bytes now = outside ? encodeCuts({tick, engine->cuts, engine->insertions}) : Bytes();
    ASSERT_EQ(follower.cuts(), now) << tick;
    ++tick;
    if (tick % 20 != 0) continue;
    const Bytes bytes = follower.cutsDue();
    const bool due = told_at == 0 || tick - told_at >= 1000;
    ASSERT_EQ(!bytes.empty(), outside && (left || due)) << tick;
    if (bytes.empty()) continue;
    ASSERT_EQ(bytes, now) << tick;
    (left ? exits : seconds)++;
    told_at = tick;
    left = false;
  }
  EXPECT_GT(exits, 1);
  EXPECT_GT(seconds, 2);
  EXPECT_GT(engine->cuts.count, 1u);
}

TEST(MemoryFollower, isSilentInASceneWithoutTheEffect) {
  const auto model = std::make_unique<SceneModel>(*compile(allEffects(), 1000));
  MemoryFollower follower(*model);
  for (int i = 0; i < 2000; ++i) {
    follower.follow({});
    ASSERT_TRUE(follower.cuts().empty());
    ASSERT_TRUE(follower.cutsDue().empty());
  }
}

// ---- a recording with memories ----

/// Five insertions: into the same hole, beside it within the cut's radius, and elsewhere; each rests inside
/// for longer than a chunk, so that some chunks never see the tip outside.
Motion fiveInsertions() {
  constexpr std::pair<double, double> kAsideAndLength_m[] = {
      {0, 0.020}, {0.0004, 0.030}, {0.006, 0.030}, {0, 0.015}, {0.0004, 0.035}};
  Motion motion;
  for (const auto& [aside_m, length_m] : kAsideAndLength_m) {
    Site site = defaultSite();
    site.p_surface_m = site.p_surface_m + site.across_1 * aside_m;
    const Motion once = insertHoldWithdraw(1000, site, site.inward, site.inward, length_m, 0.03, 1.2, 0.008);
    motion.insert(motion.end(), once.begin(), once.end());
  }
  return motion;
}

/// A session as a station records it: the spool's chunks with the follower's memories.
struct RecordedLesson {
  std::shared_ptr<const SceneModel> model;
  std::vector<Bytes> chunks;
};

RecordedLesson recordedLesson(AxialModel axial_model) {
  SceneSpec scene = rememberingScene();
  scene.axial_model = axial_model;
  scene.statistical.table = {{0, 2.0, 0.6}};
  RecordedLesson lesson{std::make_shared<const SceneModel>(*compile(scene, 1000)), {}};
  const TempFolder folder;
  const auto spool = std::move(*Spool::open(folder.path()));
  const auto session = *spool->create(describeSession(makeUuidV7()));
  const auto ring = std::make_unique<SampleRing>();
  FakeTime time;
  MemoryFollower follower(*lesson.model);
  SpoolWriter::Callbacks callbacks;
  callbacks.cut_memory = [&](const GestureSample& sample, bool wanted) {
    follower.follow(sample);
    return wanted ? follower.cuts() : Bytes();
  };
  SpoolWriter writer(*ring, session, {.time = &time, .threads = false}, std::move(callbacks));
  const auto engine = std::make_unique<SimState>();
  StepReport report;
  std::uint64_t tick = 0;
  for (const TipSample& tip : fiveInsertions()) {
    step(*lesson.model, tip, *engine, report);
    EXPECT_TRUE(ring->push(storedSample(tick, tip, report)));
    if (++tick % 300 == 0) writer.writePass();
  }
  EXPECT_TRUE(writer.finish(std::chrono::seconds(1)).ok());
  for (std::uint64_t seq = 0; seq < session->contents().chunks; ++seq)
    lesson.chunks.push_back(*session->readChunk(seq));
  return lesson;
}

/// What a view gets for the last sample fed, bit by bit.
std::vector<std::uint64_t> bitsSeenBy(const GestureReplica& replica) {
  const StepReport& r = replica.report();
  const Moment& now = replica.now();
  std::vector<double> numbers = {r.wrench_W.force_N.x,   r.wrench_W.force_N.y,
                                 r.wrench_W.force_N.z,   r.depth_m,
                                 r.insertion_m,          r.speed_mps,
                                 r.lateral_error_m,      r.cutting_N,
                                 r.attracted_N,          r.friction_N,
                                 r.puncture_N,           r.clamping_N,
                                 now.alpha_rad,          r.wrench_W.torque_Nm.x,
                                 r.wrench_W.torque_Nm.y, r.wrench_W.torque_Nm.z};
  numbers.insert(numbers.end(), now.terms.begin(), now.terms.end());
  if (now.inside)
    for (const Vec3 v : {now.p_entry_W_m, now.u_W, r.p_wall_W_m}) {
      numbers.push_back(v.x);
      numbers.push_back(v.y);
      numbers.push_back(v.z);
    }
  std::vector<std::uint64_t> bits;
  for (const double number : numbers) bits.push_back(std::bit_cast<std::uint64_t>(number));
  return bits;
}

/// Replays chunks, each with its memory; calls `see(sample, told)` after each sample.
template <typename See>
void play(GestureReplica& replica, const Bytes& chunk, const See& see) {
  const auto samples = decodeChunk(chunk);
  ASSERT_TRUE(samples.ok());
  const auto cuts = cutsIn(cutMemoryOf(chunk));
  for (const GestureSample& sample : *samples) {
    replica.feed(sample);
    const bool told = cuts && cuts->tick == sample.tick;
    if (told) replica.takeCuts(*cuts);
    see(sample, told);
  }
}

/// STATISTICAL draws by the number of the insertion, which is also remembered.
class RecordedCuts : public testing::TestWithParam<AxialModel> {
 protected:
  void SetUp() override {
    GestureReplica replica(lesson_.model);
    for (const Bytes& chunk : lesson_.chunks) {
      play(replica, chunk, [&](const GestureSample&, bool) {
        ASSERT_FALSE(replica.now().approximate);
        from_first_.push_back(bitsSeenBy(replica));
      });
    }
    ASSERT_GT(lesson_.chunks.size(), 12u);
  }
  /// From chunk `begin` on the view equals the one from the first chunk on, as soon as a memory has arrived.
  /// Until then it is marked approximate, also before the current insertion is noticed.
  void expectSameFrom(GestureReplica& replica, std::size_t begin) {
    bool known = false;
    for (std::size_t c = begin; c < lesson_.chunks.size() && !HasFatalFailure(); ++c)
      play(replica, lesson_.chunks[c], [&](const GestureSample& sample, bool told) {
        known = known || told;
        const bool inside = replica.now().inside;
        const bool unnoticed = !known && !inside && sample.layer >= 0;
        ASSERT_EQ(replica.now().approximate, unnoticed || (inside && !known)) << begin << ", " << sample.tick;
        if (known) {
          ASSERT_EQ(bitsSeenBy(replica), from_first_[sample.tick]) << begin << ", " << sample.tick;
        }
        exact_ += known && inside ? 1u : 0u;
      });
  }

  const RecordedLesson lesson_ = recordedLesson(GetParam());
  std::vector<std::vector<std::uint64_t>> from_first_;  // by tick
  std::size_t exact_ = 0;                               // compared ticks inside
};

TEST_P(RecordedCuts, eachChunkWithTheTipOutsideHasTheMemoryAndNoOther) {
  std::uint32_t most_tracks = 0;
  std::size_t without = 0;
  for (const Bytes& chunk : lesson_.chunks) {
    const auto samples = decodeChunk(chunk);
    ASSERT_TRUE(samples.ok());
    const auto outside =
        std::find_if(samples->begin(), samples->end(), [](const GestureSample& s) { return s.layer < 0; });
    const auto cuts = cutsIn(cutMemoryOf(chunk));
    ASSERT_EQ(cuts.has_value(), outside != samples->end()) << samples->front().tick;
    without += cuts ? 0 : 1;
    if (!cuts) {
      EXPECT_EQ(chunk, encodeChunk(Resolution::standard(), *samples)) << "as without the effect";
      continue;
    }
    // a tick or two outside may be due to the rounding of positions
    EXPECT_LE(cuts->tick - outside->tick, 2u);
    most_tracks = std::max(most_tracks, cuts->cuts.count);
    EXPECT_EQ(chunk.size(),
              encodeChunk(Resolution::standard(), *samples).size() + 22 + 60 * cuts->cuts.count);
  }
  EXPECT_GT(without, 3u);
  EXPECT_GT(most_tracks, 1u);
}

TEST_P(RecordedCuts, aReplayFromAnyChunkMatchesTheFullOneExactly) {
  for (std::size_t begin = 1; begin < lesson_.chunks.size(); ++begin) {
    GestureReplica replica(lesson_.model);
    expectSameFrom(replica, begin);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(exact_, from_first_.size());
}

TEST_P(RecordedCuts, aReplayAfterAMissingChunkMatchesTheFullOneExactly) {
  for (std::size_t missing = 0; missing + 1 < lesson_.chunks.size(); ++missing) {
    GestureReplica replica(lesson_.model);
    for (std::size_t c = 0; c < missing; ++c)
      play(replica, lesson_.chunks[c], [](const GestureSample&, bool) {});
    replica.noteGap();
    expectSameFrom(replica, missing + 1);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(exact_, from_first_.size());
}

INSTANTIATE_TEST_SUITE_P(Models, RecordedCuts,
                         testing::Values(AxialModel::kEnhancedTrackingWall, AxialModel::kStatistical),
                         [](const auto& tested) { return std::string(axialModelName(tested.param)); });

}  // namespace
}  // namespace needlelab::test
