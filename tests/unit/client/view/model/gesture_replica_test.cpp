#include "client/view/model/gesture_replica.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <span>

#include "common/gesture/chunk.h"
#include "common/profile/scene_of_profile.h"
#include "tests/support/scenes/stored_sample.h"
#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

using test::SampleLesson;
using test::sampleLesson;
using test::storedSample;
using test::tipOf;

// every number of the report, bit by bit, without the padding
std::vector<std::uint64_t> bitsOf(const StepReport& r) {
  const double numbers[] = {r.wrench_W.force_N.x,
                            r.wrench_W.force_N.y,
                            r.wrench_W.force_N.z,
                            r.wrench_W.torque_Nm.x,
                            r.wrench_W.torque_Nm.y,
                            r.wrench_W.torque_Nm.z,
                            r.p_wall_W_m.x,
                            r.p_wall_W_m.y,
                            r.p_wall_W_m.z,
                            r.depth_m,
                            r.insertion_m,
                            r.speed_mps,
                            r.lateral_error_m,
                            r.cutting_N,
                            r.attracted_N,
                            r.friction_N,
                            r.puncture_N,
                            r.clamping_N,
                            r.clamping_stiffness_N_per_m};
  std::vector<std::uint64_t> bits;
  for (const double number : numbers) {
    // nan means "no wall", whatever its bits
    std::uint64_t word = 0;
    if (!std::isnan(number)) std::memcpy(&word, &number, sizeof word);
    bits.push_back(word);
  }
  bits.push_back(r.flags);
  bits.push_back(static_cast<std::uint64_t>(r.layer));
  bits.push_back(static_cast<std::uint64_t>(r.phase));
  return bits;
}

TEST(GestureReplica, givesTheEnginesReportsBitByBit) {
  for (const char* name : {"shoulder-adult", "lumbar-adult", "paper-six-layers", "shoulder-models"}) {
    const SampleLesson lesson = sampleLesson(name);
    GestureReplica replica(lesson.model);
    for (std::size_t i = 0; i < lesson.samples.size(); ++i) {
      const Moment& now = replica.feed(lesson.samples[i]);
      ASSERT_EQ(bitsOf(replica.report()), bitsOf(lesson.reports[i])) << name << ", tick " << i;
      ASSERT_FALSE(now.approximate) << name << ", tick " << i;
    }
    EXPECT_EQ(replica.fed(), lesson.samples.size());
  }
}

TEST(GestureReplica, findsEntryLineAndAlpha) {
  const SampleLesson lesson = sampleLesson("shoulder-adult");
  GestureReplica replica(lesson.model);
  bool seen_inside = false;
  for (const GestureSample& sample : lesson.samples) {
    const Moment& now = replica.feed(sample);
    ASSERT_EQ(now.inside, sample.layer >= 0) << sample.tick;
    const double length_m = lesson.scene->needle.length_m;
    ASSERT_NEAR(now.alpha_rad, std::atan((length_m - now.insertion_m) / (length_m + now.insertion_m)), 1e-12);
    if (!now.inside) continue;
    seen_inside = true;
    // P0 lies on the skin, and the sample's lateral error is its distance from the line through P0.
    ASSERT_NEAR(depthAt(*lesson.scene, now.p_entry_W_m), 0, 1e-6);
    ASSERT_NEAR(norm(now.u_W), 1, 1e-9);
    const Vec3 from = now.p_WT_m - now.p_entry_W_m;
    ASSERT_NEAR(norm(from - now.u_W * dot(from, now.u_W)), sample.lateral_error_m, 1e-9);
    if (now.term(Effect::kClamping) > 1e-6) {
      ASSERT_LT(dot(now.clamping_W, from - now.u_W * dot(from, now.u_W)), 0);
    }
  }
  EXPECT_TRUE(seen_inside);
}

TEST(GestureReplica, theEffectForcesAddUpToTheHandForce) {
  const SampleLesson lesson = sampleLesson("shoulder-adult");
  GestureReplica replica(lesson.model);
  for (const GestureSample& sample : lesson.samples) {
    const Moment& now = replica.feed(sample);
    if (!now.inside) continue;
    const double along_N = now.term(Effect::kCutting) + now.term(Effect::kAttracted) +
                           now.term(Effect::kShaftFriction) + now.term(Effect::kPuncture);
    const Vec3 sum = now.u_W * along_N + now.clamping_W * now.term(Effect::kClamping);
    ASSERT_NEAR(norm(sum - now.force_W_N), 0, 1e-9) << sample.tick;
  }
}

TEST(GestureReplica, ticksThatTheStationMissedAreNoGap) {
  // A station that missed ticks: its engine did not run them either.
  const SampleLesson whole = sampleLesson("shoulder-adult");
  auto engine = std::make_unique<SimState>();
  StepReport report;
  GestureReplica replica(whole.model);
  for (std::size_t i = 0; i < whole.samples.size(); ++i) {
    if (i % 7 == 3 || (i > 1500 && i < 1530)) continue;
    GestureSample sample = whole.samples[i];
    step(*whole.model, tipOf(sample), *engine, report);
    sample = storedSample(sample.tick, tipOf(sample), report);
    const Moment& now = replica.feed(sample);
    ASSERT_EQ(bitsOf(replica.report()), bitsOf(report));
    ASSERT_FALSE(now.approximate);
  }
}

TEST(GestureReplica, lostSamplesAreFlaggedUntilTheTipIsOutside) {
  const SampleLesson lesson = sampleLesson("shoulder-adult");
  GestureReplica replica(lesson.model);
  bool gap = false, flagged = false;
  for (std::size_t i = 0; i < lesson.samples.size(); ++i) {
    const GestureSample& sample = lesson.samples[i];
    if (!gap && sample.layer >= 1) {
      // 200 ms are lost in the tissue
      gap = true;
      replica.noteGap();
      i += 200;
      continue;
    }
    const Moment& now = replica.feed(sample);
    if (!gap) {
      ASSERT_FALSE(now.approximate);
    } else if (now.inside) {
      ASSERT_TRUE(now.approximate);
      flagged = true;
      // The entry and the line were received earlier.
      ASSERT_NEAR(depthAt(*lesson.scene, now.p_entry_W_m), 0, 1e-6);
    } else {
      ASSERT_FALSE(now.approximate);
    }
  }
  EXPECT_TRUE(flagged);
}

TEST(GestureReplica, anEntryThatWasNotSeenIsGuessedFromThePose) {
  const SampleLesson lesson = sampleLesson("shoulder-adult");
  GestureReplica replica(lesson.model);
  std::size_t first = 0;
  while (lesson.samples[first].layer < 2) ++first;
  double worst_m = 0;
  int guessed = 0;
  for (std::size_t i = first; i < lesson.samples.size(); ++i) {
    const Moment& now = replica.feed(lesson.samples[i]);
    if (lesson.samples[i].layer < 0 || i < first + 10) continue;
    ASSERT_TRUE(now.inside && now.approximate) << i;
    ++guessed;
    worst_m = std::max(worst_m, std::fabs(depthAt(*lesson.scene, now.p_entry_W_m)));
  }
  EXPECT_GT(guessed, 500);
  // Within a few millimetres of the skin: better than no line.
  EXPECT_LT(worst_m, 0.004);
  EXPECT_FALSE(replica.now().inside);
  EXPECT_FALSE(replica.now().approximate);
}

TEST(GestureReplica, whatWasNotSteppedIsShownAndNotStepped) {
  const SampleLesson lesson = sampleLesson("shoulder-adult");
  GestureReplica replica(lesson.model), clean(lesson.model);
  for (const GestureSample& sample : lesson.samples) {
    clean.feed(sample);
    replica.feed(sample);
    if (sample.tick == 2000) break;
  }
  ASSERT_TRUE(replica.now().inside);
  GestureSample bad = lesson.samples[2001];
  bad.p_WT_m[0] = std::numeric_limits<double>::quiet_NaN();
  bad.flags |= kFlagNotStepped;
  bad.fault = 1;
  const Vec3 before = replica.now().p_WT_m;
  const Moment& now = replica.feed(bad);
  EXPECT_EQ(now.p_WT_m, before);
  EXPECT_EQ(now.fault, 1);
  EXPECT_EQ(now.term(Effect::kCutting), 0);  // in a FAULT there is no force
  const GestureSample after = lesson.samples[2002];
  replica.feed(after);
  clean.feed(after);
  EXPECT_EQ(bitsOf(replica.report()), bitsOf(clean.report()));
}

TEST(GestureReplica, aStoredRecordingGivesNearlyTheSame) {
  const SampleLesson lesson = sampleLesson("shoulder-adult");
  const Resolution resolution;
  GestureReplica replica(lesson.model);
  double worst_N = 0, worst_m = 0;
  for (std::size_t first = 0; first < lesson.samples.size(); first += 1000) {
    const std::size_t count = std::min<std::size_t>(1000, lesson.samples.size() - first);
    const Bytes chunk = encodeChunk(resolution, std::span(lesson.samples).subspan(first, count));
    const auto decoded = decodeChunk(chunk);
    ASSERT_TRUE(decoded) << decoded.error().message;
    for (std::size_t i = 0; i < decoded->size(); ++i) {
      const Moment& now = replica.feed((*decoded)[i]);
      ASSERT_FALSE(now.approximate);
      const StepReport& report = lesson.reports[first + i];
      worst_m = std::max(worst_m, std::fabs(now.depth_m - report.depth_m));
      if (report.depth_m > 1e-4 && (report.flags & kFlagRupture) == 0)
        worst_N = std::max(worst_N, std::fabs(now.term(Effect::kCutting) - report.cutting_N));
    }
  }
  EXPECT_LT(worst_m, 2e-6);
  // Half a micrometre on a wall of 500 N/m; a layer change may be one tick off.
  EXPECT_LT(worst_N, 0.02);
}

TEST(GestureReplica, aStreamOfReducedRateIsCalledApproximateInside) {
  const SampleLesson lesson = sampleLesson("shoulder-adult");
  const auto spec = sceneSpecOf(lesson.profile);
  ASSERT_TRUE(spec);
  auto slow = compile(*spec, 100);
  ASSERT_TRUE(slow);
  GestureReplica replica(std::make_shared<const SceneModel>(*slow), true, 1000);
  double worst_m = 0;
  for (std::size_t i = 0; i < lesson.samples.size(); i += 10) {
    const Moment& now = replica.feed(lesson.samples[i]);
    EXPECT_EQ(now.approximate, now.inside);
    EXPECT_DOUBLE_EQ(now.time_s, static_cast<double>(i) / 1000);
    if (now.inside)
      worst_m = std::max(worst_m, std::fabs(replica.report().insertion_m - lesson.samples[i].insertion_m));
  }
  EXPECT_LT(worst_m, 1e-4);
}

TEST(GestureReplica, anEarlierTickRestartsTheReplay) {
  const SampleLesson lesson = sampleLesson("shoulder-adult");
  GestureReplica replica(lesson.model);
  replica.feed(lesson.samples[2500]);
  replica.feed(lesson.samples[0]);
  EXPECT_EQ(replica.fed(), 1u);
  for (std::size_t i = 1; i < 2500; ++i) replica.feed(lesson.samples[i]);
  EXPECT_EQ(bitsOf(replica.report()), bitsOf(lesson.reports[2499]));
}

// ---- CUT_MEMORY: earlier cuts act on later insertions ----

/// The sample lesson's hand three times, in a scene with memory; the engine's reports and its memory after
/// each sample.
struct RememberingLesson {
  std::shared_ptr<const SceneModel> model;
  std::vector<GestureSample> samples;
  std::vector<StepReport> reports;
  std::vector<CutSnapshot> cuts;
};

RememberingLesson rememberingLesson() {
  const SampleLesson once = sampleLesson("shoulder-adult");
  auto spec = sceneSpecOf(once.profile);
  EXPECT_TRUE(spec);
  spec->effects |= bitOf(Effect::kCutMemory);
  useUsualNumbers(effectEntry(Effect::kCutMemory), *spec);
  auto model = compile(*spec, 1000);
  EXPECT_TRUE(model);
  RememberingLesson lesson{std::make_shared<const SceneModel>(*model), {}, {}, {}};
  const auto state = std::make_unique<SimState>();
  for (int pass = 0; pass < 3; ++pass)
    for (const GestureSample& sample : once.samples) {
      const std::uint64_t tick = lesson.samples.size();
      StepReport report;
      step(*lesson.model, tipOf(sample), *state, report);
      lesson.samples.push_back(storedSample(tick, tipOf(sample), report));
      lesson.reports.push_back(report);
      lesson.cuts.push_back({tick, state->cuts, state->insertions});
    }
  return lesson;
}

CutSnapshot overTheWire(const CutSnapshot& cuts) {
  const auto received = decodeCuts(encodeCuts(cuts));
  EXPECT_TRUE(received.ok());
  return *received;
}

TEST(ReplicaOfCuts, fromTheFirstSampleOnNothingIsApproximate) {
  const RememberingLesson lesson = rememberingLesson();
  GestureReplica replica(lesson.model);
  for (std::size_t i = 0; i < lesson.samples.size(); ++i) {
    ASSERT_FALSE(replica.feed(lesson.samples[i]).approximate) << i;
    ASSERT_EQ(bitsOf(replica.report()), bitsOf(lesson.reports[i])) << i;
  }
}

TEST(ReplicaOfCuts, whoComesLateIsApproximateInEveryInsertion) {
  const RememberingLesson lesson = rememberingLesson();
  const std::size_t once = lesson.samples.size() / 3;
  GestureReplica replica(lesson.model);
  bool differs = false;
  for (std::size_t i = once; i < lesson.samples.size(); ++i) {
    const Moment& now = replica.feed(lesson.samples[i]);
    ASSERT_EQ(now.approximate, now.inside) << i;
    differs = differs || bitsOf(replica.report()) != bitsOf(lesson.reports[i]);
  }
  EXPECT_TRUE(differs) << "and rightly so: the first insertion's cut is not known";
}

TEST(ReplicaOfCuts, fromAnyChunkItMatchesOnceTheMemoryHasArrived) {
  const RememberingLesson lesson = rememberingLesson();
  int entries = 0;
  for (std::size_t begin = 1000; begin < lesson.samples.size(); begin += 1000) {
    GestureReplica replica(lesson.model);
    replica.feed(lesson.samples[begin - 1]);
    replica.takeCuts(overTheWire(lesson.cuts[begin - 1]));
    bool seen = lesson.reports[begin - 1].layer < 0;  // a memory arrived while the tip was outside
    for (std::size_t i = begin; i < lesson.samples.size(); ++i) {
      const Moment& now = replica.feed(lesson.samples[i]);
      if (seen) {
        ASSERT_FALSE(now.approximate) << begin << ", " << i;
        ASSERT_EQ(bitsOf(replica.report()), bitsOf(lesson.reports[i])) << begin << ", " << i;
        entries += (lesson.reports[i].flags & kFlagEntry) != 0 ? 1 : 0;
      } else if (now.inside) {
        ASSERT_TRUE(now.approximate) << begin << ", " << i;
      }
      if (i % 1000 != 999) continue;
      replica.takeCuts(overTheWire(lesson.cuts[i]));
      seen = seen || lesson.reports[i].layer < 0;
    }
  }
  EXPECT_GT(entries, 10);
}

TEST(ReplicaOfCuts, aGapEndsWithTheMemoryOfTheCurrentSampleOutside) {
  const RememberingLesson lesson = rememberingLesson();
  const std::size_t once = lesson.samples.size() / 3;
  GestureReplica replica(lesson.model);
  std::size_t i = 0;
  for (; i < once; ++i) replica.feed(lesson.samples[i]);
  replica.noteGap();                                  // outside: an insertion may have happened in the gap
  replica.takeCuts(overTheWire(lesson.cuts[i - 2]));  // belongs to another sample
  for (; i < 2 * once; ++i) {
    const Moment& now = replica.feed(lesson.samples[i]);
    ASSERT_EQ(now.approximate, now.inside) << i;
    if (now.inside) replica.takeCuts(overTheWire(lesson.cuts[i]));  // too late for this insertion
  }
  replica.takeCuts(overTheWire(lesson.cuts[i - 1]));
  for (; i < lesson.samples.size(); ++i) {
    ASSERT_FALSE(replica.feed(lesson.samples[i]).approximate) << i;
    ASSERT_EQ(bitsOf(replica.report()), bitsOf(lesson.reports[i])) << i;
  }
}

TEST(MomentsOf, keepsEveryNthAndTheLast) {
  const SampleLesson lesson = sampleLesson("shoulder-adult");
  const auto moments = momentsOf(lesson.model, lesson.samples, 100);
  ASSERT_EQ(moments.size(),
            (lesson.samples.size() - 1) / 100 + 1 + ((lesson.samples.size() - 1) % 100 != 0 ? 1 : 0));
  EXPECT_EQ(moments[3].tick, 300u);
  EXPECT_EQ(moments.back().tick, lesson.samples.back().tick);
}

}  // namespace
}  // namespace needlelab
