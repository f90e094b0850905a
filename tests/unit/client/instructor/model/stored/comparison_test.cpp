#include "client/instructor/model/stored/comparison.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/unit/client/instructor/model/lesson_gestures.h"

namespace needlelab {
namespace {

using test::lesson;
using test::LessonHand;

TEST(Comparison, aGestureComparedWithItselfHasNoDifference) {
  const auto gesture = lesson();
  for (const auto alignment : {Alignment::kDepth, Alignment::kDtw, Alignment::kTime}) {
    const auto both = compareGestures(*gesture, *gesture, alignment);
    ASSERT_TRUE(both.ok()) << both.error().message;
    ASSERT_GT(both->points.size(), 10u);
    for (const ComparedPoint& point : both->points) {
      EXPECT_EQ(point.force_a_N, point.force_b_N);
      EXPECT_EQ(point.time_a_s, point.time_b_s);
      EXPECT_EQ(point.apart_m, 0);
    }
    EXPECT_EQ(both->dtw_distance_m, 0);
    EXPECT_FALSE(both->sentences.empty());
  }
}

TEST(Comparison, twoDifferentExercisesAreNamed) {
  const auto one = lesson(), same = lesson();
  auto info = one->info;
  info.mutable_description()->set_exercise_id("another-one");
  const auto other = gestureOf(info, one->samples);
  const auto alike = compareGestures(*one, *same, Alignment::kDepth);
  const auto unlike = compareGestures(*one, *other, Alignment::kDepth);
  ASSERT_TRUE(alike.ok() && unlike.ok());
  EXPECT_EQ(unlike->sentences.size(), alike->sentences.size() + 1);
  EXPECT_NE(unlike->sentences.front().find("another-one"), std::string::npos) << unlike->sentences.front();
}

TEST(Comparison, byDepthTheSlowerHandIsMetAtTheSamePlace) {
  const auto fast = lesson({.depth_m = 0.02, .seconds = 2});
  const auto slow = lesson({.depth_m = 0.015, .seconds = 4});
  const auto both = compareGestures(*fast, *slow, Alignment::kDepth);
  ASSERT_TRUE(both.ok());
  // to the depth of the shallower one, in steps of 0.25 mm
  EXPECT_NEAR(both->points.back().at, 0.015, 0.0003);
  for (const ComparedPoint& point : both->points) {
    if (point.at < 0.001 || point.at > 0.0145) continue;
    // a tick of 1 ms at up to 20 mm/s
    EXPECT_NEAR(point.insertion_a_m, point.at, 5e-5);
    EXPECT_NEAR(point.insertion_b_m, point.at, 5e-5);
    EXPECT_GT(point.time_b_s, point.time_a_s);
  }
}

TEST(Comparison, warpingFindsAShiftOfThePaths) {
  const auto straight = lesson({.depth_m = 0.02, .seconds = 2});
  auto info = test::lessonInfo(test::sampleProfile("shoulder-adult"));
  auto samples = straight->samples;
  // all of it 3 mm to the side; limb and device unchanged
  for (GestureSample& s : samples) s.p_WT_m[0] += 0.003;
  const auto aside = gestureOf(info, samples);
  const auto both = compareGestures(*straight, *aside, Alignment::kDtw);
  ASSERT_TRUE(both.ok());
  EXPECT_GT(both->dtw_distance_m, 0.0005);
  EXPECT_LE(both->dtw_distance_m, 0.003 + 1e-9);
  // the limb moved too: no difference in its own frame
  for (const double v : {0.003, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0}) info.mutable_description()->add_placement(v);
  const auto moved = compareGestures(*straight, *gestureOf(info, samples), Alignment::kDtw);
  ASSERT_TRUE(moved.ok());
  EXPECT_NEAR(moved->dtw_distance_m, 0, 1e-9);
}

TEST(Comparison, theAxisAscendsAndTimesDoNotGoBack) {
  const auto a = lesson({.seconds = 2}), b = lesson({.seconds = 3, .aside_m = 0.002});
  for (const auto alignment : {Alignment::kDepth, Alignment::kDtw, Alignment::kTime}) {
    const auto both = compareGestures(*a, *b, alignment);
    ASSERT_TRUE(both.ok());
    for (std::size_t i = 1; i < both->points.size(); ++i) {
      EXPECT_GT(both->points[i].at, both->points[i - 1].at);
      EXPECT_GE(both->points[i].time_a_s, both->points[i - 1].time_a_s);
      EXPECT_GE(both->points[i].time_b_s, both->points[i - 1].time_b_s);
    }
  }
}

TEST(Comparison, aNeedleThatStayedOutsideIsReported) {
  const auto in = lesson(), out = lesson({.depth_m = -0.001});
  for (const auto alignment : {Alignment::kDepth, Alignment::kDtw, Alignment::kTime}) {
    const auto both = compareGestures(*in, *out, alignment);
    ASSERT_FALSE(both.ok());
    EXPECT_NE(both.error().message.find("never in tissue"), std::string::npos);
  }
  pb::SessionInfo info = in->info;
  EXPECT_FALSE(compareGestures(*gestureOf(info, {}), *in, Alignment::kDepth).ok());
}

/// Goes straight in for 20 mm at 10 mm/s, 1 kHz. The force is `force_N`, and `peak_N` between 0.995 and 1.005
/// s.
std::shared_ptr<const StoredGesture> straightIn(double force_N, double peak_N, double speed_mps,
                                                double lateral_m) {
  std::vector<GestureSample> samples(2001);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    GestureSample& s = samples[i];
    s.tick = i;
    s.layer = 0;
    s.insertion_m = 1e-5 * static_cast<double>(i);
    s.force_W_N[1] = i >= 995 && i <= 1005 ? peak_N : force_N;
    s.speed_mps = speed_mps;
    s.lateral_error_m = lateral_m;
  }
  return gestureOf(test::lessonInfo("{}"), std::move(samples));
}

TEST(Comparison, theCurvesHaveTheLimitsOfTheExerciseOfBoth) {
  auto a = std::make_shared<StoredGesture>(), b = std::make_shared<StoredGesture>();
  a->info.mutable_description()->set_exercise_id("knee");
  b->info.mutable_description()->set_exercise_id("knee");
  a->requirements = {{"peak_force_n", {}, 5},
                     {"largest_lateral_error_m", {}, 0.002},
                     {"largest_planned_line_error_m", {}, 0.004},
                     {"mean_planned_line_error_m", {}, 0.003},
                     {"peak_speed_m_s", {}, 0.1}};
  const auto limitsOf = [&](ComparedSeries series) {
    Plot plot;
    addLimits(plot, series, *a, *b);
    std::vector<double> at;
    for (const PlotLimit& limit : plot.limits) at.push_back(limit.at);
    return at;
  };
  EXPECT_EQ(limitsOf(ComparedSeries::kTotalForce), std::vector<double>{5});
  EXPECT_EQ(limitsOf(ComparedSeries::kLateral), std::vector<double>{2});
  EXPECT_EQ(limitsOf(ComparedSeries::kPlanned), std::vector<double>{4}) << "the mean's limit is not a line";
  EXPECT_EQ(limitsOf(ComparedSeries::kSpeed), (std::vector<double>{100, -100}));
  EXPECT_TRUE(limitsOf(ComparedSeries::kTilt).empty());
  b->info.mutable_description()->set_exercise_id("hip");
  EXPECT_TRUE(limitsOf(ComparedSeries::kTotalForce).empty()) << "whose limit would it be?";
}

TEST(Comparison, aDifferenceThatRoundsToZeroHasNoSign) {
  const auto first = straightIn(1, 1, 0.010, 0.001);
  auto lighter = first->samples;
  // 1 mN less, below the two decimals shown
  for (GestureSample& sample : lighter) sample.force_W_N[1] -= 0.001;
  const auto both = compareGestures(*first, *gestureOf(first->info, lighter), Alignment::kDepth);
  ASSERT_TRUE(both.ok()) << both.error().message;
  EXPECT_EQ(both->sentences.at(0).find("force: the second differs by 0.00 N on average, by 0.00 N at most"),
            0u)
      << both->sentences.at(0);
}

TEST(Comparison, theSentencesSayTheMeanAndTheGreatestDifferenceAndWhere) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto first = straightIn(1, 1, 0.010, 0.001), second = straightIn(1.5, 4, 0.008, nan);
  struct Row {
    Alignment alignment;
    bool exchanged;
    const char *force, *speed;
  };
  // by depth 81 points (one per 0.25 mm), by time 201 (one per 10 ms); one of them is in the peak: (80·0.5 +
  // 3)/81 = 0.53, (200·0.5 + 3)/201 = 0.51
  const std::vector<Row> rows = {
      {Alignment::kDepth, false,
       "force: the second differs by +0.53 N on average, by +3.00 N at most, at 10.0 mm",
       "speed: the second differs by -2.0 mm/s on average, by -2.0 mm/s at most, at 0.0 mm"},
      {Alignment::kDepth, true,
       "force: the second differs by -0.53 N on average, by -3.00 N at most, at 10.0 mm",
       "speed: the second differs by +2.0 mm/s on average, by +2.0 mm/s at most, at 0.0 mm"},
      {Alignment::kTime, false,
       "force: the second differs by +0.51 N on average, by +3.00 N at most, 1.0 s after the entry",
       "speed: the second differs by -2.0 mm/s on average, by -2.0 mm/s at most, 0.0 s after the entry"}};
  for (const Row& row : rows) {
    const auto both = row.exchanged ? compareGestures(*second, *first, row.alignment)
                                    : compareGestures(*first, *second, row.alignment);
    ASSERT_TRUE(both.ok()) << both.error().message;
    // no sentence about the distance from the own line, which the second lacks, nor about a plan
    EXPECT_EQ(both->sentences, (std::vector<std::string>{row.force, row.speed}));
  }
}

/// The sample shoulder's exercise with a line straight down through its top, `aside_m` towards +x.
pb::Exercise plannedAside(double aside_m) {
  pb::Exercise exercise;
  exercise.set_profile_id("shoulder-adult");
  auto& plan = *exercise.mutable_plan();
  plan.set_frame(pb::Exercise::Plan::LIMB);
  plan.mutable_entry_m()->set_x(aside_m);
  plan.mutable_direction()->set_z(-1);
  return exercise;
}

TEST(Comparison, deviationsFromPlanAndOwnLineAreShownTogether) {
  const auto info = test::lessonInfo(test::sampleProfile("shoulder-adult"));
  auto samples = test::lessonSamples(test::sampleProfile("shoulder-adult"), {});
  // the first goes down the middle, the second the same way 3 mm to the side: each straight along its own
  // line
  const auto exercise = plannedAside(0.001);
  const auto first = gestureOf(info, samples, {}, &exercise);
  for (GestureSample& s : samples) s.p_WT_m[0] += 0.003;
  const auto second = gestureOf(info, samples, {}, &exercise);
  for (const auto alignment : {Alignment::kDepth, Alignment::kTime}) {
    const auto both = compareGestures(*first, *second, alignment);
    ASSERT_TRUE(both.ok()) << both.error().message;
    std::size_t inside = 0;
    for (const ComparedPoint& point : both->points) {
      if (std::isnan(point.planned_a_m)) continue;
      ++inside;
      EXPECT_NEAR(point.planned_a_m, 0.001, 1e-9);
      EXPECT_NEAR(point.planned_b_m, 0.002, 1e-9);
      EXPECT_NEAR(point.lateral_a_m, 0, 1e-9);
      EXPECT_NEAR(point.lateral_b_m, 0, 1e-9);
    }
    EXPECT_GT(inside, both->points.size() / 2) << "in tissue";
    EXPECT_EQ(plottedSeries(*both),
              (std::vector<ComparedSeries>{ComparedSeries::kTotalForce, ComparedSeries::kSpeed,
                                           ComparedSeries::kLateral, ComparedSeries::kPlanned,
                                           ComparedSeries::kTilt}));
    const std::string said = "distance from planned line: the second differs by +1.00 mm on average";
    EXPECT_TRUE(std::any_of(both->sentences.begin(), both->sentences.end(),
                            [&](const std::string& line) { return line.starts_with(said); }));
  }
  EXPECT_EQ(nameOf(ComparedSeries::kLateral), "distance from own line");
  EXPECT_EQ(unitOf(ComparedSeries::kPlanned), "mm");
  EXPECT_EQ(shownPerSi(ComparedSeries::kPlanned), 1000);
}

TEST(Comparison, aPictureOfBothShowsAPlanOnlyIfShared) {
  const auto json = test::sampleProfile("shoulder-adult");
  auto here = test::lessonInfo(json), moved = test::lessonInfo(json);
  for (const double v : {0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0}) moved.mutable_description()->add_placement(v);
  const auto one = plannedAside(0), other = plannedAside(0.002);
  const auto none = gestureOf(here, {}), a = gestureOf(here, {}, {}, &one), b = gestureOf(here, {}, {}, &one),
             c = gestureOf(here, {}, {}, &other), d = gestureOf(moved, {}, {}, &one);
  const SharedPlan same = sharedPlanOf(*a, *b);
  ASSERT_TRUE(same.plan_W);
  EXPECT_NEAR(norm(same.plan_W->entry_W_m), 0, 1e-12);
  EXPECT_EQ(same.omission_reason, "");
  EXPECT_FALSE(sharedPlanOf(*none, *none).plan_W);
  EXPECT_EQ(sharedPlanOf(*none, *none).omission_reason, "") << "there is nothing to draw";
  const std::string differ = "The two have different planned lines; neither is drawn here.";
  struct Row {
    const StoredGesture *first, *second;
    std::string why;
  };
  for (const Row& row :
       {Row{a.get(), none.get(), "Only the first has a planned line; it is not drawn here."},
        Row{none.get(), a.get(), "Only the second has a planned line; it is not drawn here."},
        Row{a.get(), c.get(), differ}, Row{a.get(), d.get(), differ}}) {
    const SharedPlan shared = sharedPlanOf(*row.first, *row.second);
    EXPECT_FALSE(shared.plan_W) << row.why;
    EXPECT_EQ(shared.omission_reason, row.why);
  }
}

TEST(Comparison, withoutAPlanNoneIsMentioned) {
  const auto plain = lesson();
  const auto without = compareGestures(*plain, *plain, Alignment::kDepth);
  ASSERT_TRUE(without.ok());
  for (const ComparedPoint& point : without->points) EXPECT_TRUE(std::isnan(point.planned_a_m));
  EXPECT_EQ(plottedSeries(*without),
            (std::vector<ComparedSeries>{ComparedSeries::kTotalForce, ComparedSeries::kSpeed,
                                         ComparedSeries::kLateral, ComparedSeries::kTilt}));
  for (const std::string& line : without->sentences) EXPECT_EQ(line.find("plan"), std::string::npos) << line;
  // only one has a plan: its curve is shown, without a difference
  const auto exercise = plannedAside(0);
  const auto planned = gestureOf(plain->info, plain->samples, {}, &exercise);
  const auto one = compareGestures(*planned, *plain, Alignment::kDepth);
  ASSERT_TRUE(one.ok());
  const auto series = plottedSeries(*one);
  EXPECT_EQ(std::count(series.begin(), series.end(), ComparedSeries::kPlanned), 1);
  for (const std::string& line : one->sentences) EXPECT_EQ(line.find("plan"), std::string::npos) << line;
}

}  // namespace
}  // namespace needlelab
