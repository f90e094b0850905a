// What a score says of a recording with holes, of time before the needle is used, and of a target only
// grazed.
#include <gmock/gmock.h>

#include <cmath>
#include <string>
#include <vector>

#include "common/scoring/measures/measures.h"
#include "common/scoring/motion/part_of_gesture.h"
#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

/// 10 s: outside, in tissue from 2 to 8 s, at 15 mm, outside.
std::vector<GestureSample> sixSecondsIn() {
  return gesture(1000, 10, [](double t, GestureSample& s) { setDepth(s, t >= 2 && t < 8 ? 0.015 : -0.01); });
}

std::vector<GestureSample> without(std::vector<GestureSample> samples, double from_s, double to_s) {
  std::erase_if(samples, [&](const GestureSample& s) {
    const double t = static_cast<double>(s.tick - samples.front().tick) / 1000;
    return t > from_s && t < to_s;
  });
  return samples;
}

pb::Exercise asking(const std::string& measure, double max) {
  pb::Exercise exercise;
  auto& asked = *exercise.add_requirements();
  asked.set_measure(measure);
  asked.set_max(max);
  return exercise;
}

TEST(Holes, inTissueMakeAScoreIncompleteAndARequirementNotPassed) {
  const pb::Profile profile = halfSpace();
  const auto holed = without(sixSecondsIn(), 4, 7);
  for (const char* measure : {"time_in_tissue_s", "hazards_touched", "peak_force_n"}) {
    const pb::Exercise exercise = asking(measure, 100);
    const auto whole_rows = scoreGesture(sixSecondsIn(), 1000, profile, {}, &exercise);
    const auto rows = scoreGesture(holed, 1000, profile, {}, &exercise);
    EXPECT_EQ(find(whole_rows, "missing_s"), nullptr);
    EXPECT_TRUE(*find(whole_rows, measure)->passed);
    const Measure& row = *find(rows, measure);
    EXPECT_TRUE(row.incomplete);
    EXPECT_FALSE(*row.passed);
    EXPECT_THAT(row.words, testing::EndsWith(": not judged, because 3 s of the recording are missing"));
    EXPECT_NEAR(find(rows, "missing_s")->value, 3, 0.002);
    EXPECT_THAT(find(rows, "entries")->words, testing::EndsWith("(incomplete)"));
    EXPECT_FALSE(find(rows, "elapsed_s")->incomplete);
    const auto read = parseScore(scoreJson(rows));
    ASSERT_TRUE(read.ok());
    EXPECT_TRUE(find(*read, measure)->incomplete);
    EXPECT_FALSE(find(*read, "elapsed_s")->incomplete);
  }
}

TEST(Holes, hideAnInsertionOnlyIfTheyTouchTissueOrLastASecond) {
  const auto isIncomplete = [](double from_s, double to_s) {
    const auto rows = scoreGesture(without(sixSecondsIn(), from_s, to_s), 1000, halfSpace(), {});
    return find(rows, "entries")->incomplete;
  };
  EXPECT_FALSE(isIncomplete(5, 5.09)) << "bridged";
  EXPECT_TRUE(isIncomplete(5, 5.2));
  EXPECT_FALSE(isIncomplete(0.2, 1));
  EXPECT_TRUE(isIncomplete(0.2, 1.3));
  EXPECT_TRUE(isIncomplete(1, 2.5)) << "it ends in tissue";
  EXPECT_TRUE(isIncomplete(7.5, 8.2)) << "it begins in tissue";
}

TEST(Holes, atTheEndAreSeenByANeedleInTissue) {
  const auto value = [](const std::vector<GestureSample>& samples) {
    return valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "ends_in_tissue");
  };
  EXPECT_EQ(value(sixSecondsIn()), 0);
  EXPECT_EQ(value(without(sixSecondsIn(), 5, 11)), 1);
  const auto outside = without(sixSecondsIn(), 1, 11);
  EXPECT_EQ(find(scoreGesture(outside, 1000, halfSpace(), {}), "ends_in_tissue"), nullptr);
}

TEST(PartOfGesture, isSaidOfHolesOfAnEndInTissueAndOfASpreadsheetsLength) {
  std::vector<GestureSample> samples((1u << 20) - 1);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i].tick = i;
  for (GestureSample& s : samples) s.layer = -1;
  EXPECT_THAT(partOfGesture(samples, 1000),
              testing::ElementsAre(testing::HasSubstr("as many as a spreadsheet keeps")));
  samples.pop_back();
  EXPECT_THAT(partOfGesture(samples, 1000), testing::IsEmpty());
  samples.back().layer = 2;
  EXPECT_THAT(partOfGesture(samples, 1000), testing::ElementsAre(testing::HasSubstr("end in tissue")));
  samples.erase(samples.begin() + 5000, samples.begin() + 8000);
  samples.erase(samples.begin() + 9000, samples.begin() + 9050);
  EXPECT_THAT(partOfGesture(samples, 1000),
              testing::ElementsAre("3.0 s of the gesture are missing, in 1 hole: the station stood still",
                                   testing::HasSubstr("end in tissue")));
}

TEST(PartOfGesture, saysThatAnExportForASpreadsheetLeavesTicksOut) {
  std::vector<GestureSample> samples(1000);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].tick = 4 * i;
    samples[i].time_ns = static_cast<std::int64_t>(4 * i) * 1'000'000;
    samples[i].layer = -1;
  }
  EXPECT_THAT(partOfGesture(samples, 1000),
              testing::ElementsAre(testing::StartsWith("1000 of 3997 ticks are there")));
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i].tick = 2 * i;  // one of two is missing, not more
  EXPECT_THAT(partOfGesture(samples, 1000), testing::IsEmpty());
}

TEST(NeedleTime, beginsWhereTheUncappedNeedleFirstMeetsTissue) {
  const pb::Profile profile = halfSpace();
  std::vector<GestureSample> samples = sixSecondsIn();
  // palpated with the cap on for 3 s, the cap off in the air, in again for 2 s
  for (GestureSample& s : samples) {
    const double t = static_cast<double>(s.tick - samples.front().tick) / 1000;
    if (t < 5) s.flags |= kFlagCapped;
    if (t >= 5 && t < 6) setDepth(s, -0.01);
  }
  const auto rows = scoreGesture(samples, 1000, profile, {});
  EXPECT_NEAR(find(rows, "needle_time_s")->value, 10 - 6, 0.002);
  EXPECT_NEAR(find(rows, "elapsed_s")->value, 10, 0.002);
  pb::Exercise exercise;
  exercise.set_time_limit_s(4.5);
  EXPECT_TRUE(*find(scoreGesture(samples, 1000, profile, {}, &exercise), "needle_time_s")->passed);
  exercise.set_time_limit_s(3.5);
  EXPECT_FALSE(*find(scoreGesture(samples, 1000, profile, {}, &exercise), "needle_time_s")->passed);
  for (GestureSample& s : samples) s.flags |= kFlagCapped;
  EXPECT_EQ(find(scoreGesture(samples, 1000, profile, {}), "needle_time_s"), nullptr);
  const auto never = scoreGesture(samples, 1000, profile, {}, &exercise);
  EXPECT_FALSE(*find(never, "needle_time_s")->passed) << "a limit is not kept by doing nothing";
}

/// In tissue beside the target, and in it from 4 s on for so long.
std::vector<GestureSample> inTargetFor(double seconds) {
  return gesture(1000, 10, [=](double t, GestureSample& s) {
    setDepth(s, t < 1 || t > 9 ? -0.01 : t >= 4 && t < 4 + seconds ? 0.015 : 0.012);
  });
}

TEST(TargetReached, isAStay) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.015}, 0.002);
  const auto reached = [&](const std::vector<GestureSample>& samples,
                           const pb::Exercise* exercise = nullptr) {
    return find(scoreGesture(samples, 1000, profile, {}, exercise), "target_reached")->value;
  };
  EXPECT_EQ(reached(inTargetFor(0.002)), 0) << "grazed for 2 ms";
  EXPECT_EQ(reached(inTargetFor(0.49)), 0);
  EXPECT_EQ(reached(inTargetFor(0.51)), 1);
  pb::Exercise exercise;
  exercise.set_target_dwell_s(2);
  EXPECT_EQ(reached(inTargetFor(1.9), &exercise), 0);
  EXPECT_EQ(reached(inTargetFor(2.1), &exercise), 1);
  exercise.set_target_dwell_s(0);
  EXPECT_EQ(reached(inTargetFor(0.002), &exercise), 1);
  // five visits of 0.2 s, 0.3 s apart, are no stay; a tremor out of it for 50 ms does not end one
  const auto visits = [](double away_s) {
    return gesture(1000, 10, [=](double t, GestureSample& s) {
      const bool in = t >= 4 && t < 4 + 5 * (0.2 + away_s) && std::fmod(t - 4, 0.2 + away_s) < 0.2;
      setDepth(s, t < 1 || t > 9 ? -0.01 : in ? 0.015 : 0.012);
    });
  };
  EXPECT_EQ(reached(visits(0.3)), 0);
  EXPECT_EQ(reached(visits(0.05)), 1);
}

TEST(LayerForces, haveARowOnlyWhereTheTipWas) {
  const pb::Profile profile = halfSpace();
  const auto samples = gesture(1000, 4, [](double t, GestureSample& s) {
    setDepth(s, t >= 1 && t < 3 ? 0.005 : -0.01);
    s.force_W_N[2] = 1;
  });
  EXPECT_NE(find(scoreGesture(samples, 1000, profile, {}), "peak_force_layer_1_n"), nullptr);
  EXPECT_EQ(find(scoreGesture(samples, 1000, profile, {}), "peak_force_layer_2_n"), nullptr);
  const pb::Exercise exercise = asking("peak_force_layer_2_n", 2);
  const auto rows = scoreGesture(samples, 1000, profile, {}, &exercise);
  EXPECT_TRUE(*find(rows, "peak_force_layer_2_n")->passed) << "no force, as it was never there";
}

}  // namespace
}  // namespace needlelab
