// The window shows the engine's own data of a lesson.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "client/station/run/io/options.h"
#include "client/station/run/lesson/memory_follower.h"
#include "client/station/window/screens/end_screen.h"
#include "client/station/window/screens/lesson_follow.h"
#include "client/station/window/screens/lesson_screen.h"
#include "common/haptics/body/body_engine.h"
#include "common/haptics/body/path_snapshot.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/support/scenes/stored_sample.h"

namespace needlelab {
namespace {

std::shared_ptr<const LessonBeginning> shoulder() {
  StationOptions options;
  options.profile_file = NEEDLELAB_SAMPLES "/shoulder-adult.json";
  auto beginning = std::make_shared<LessonBeginning>();
  beginning->lesson = *lessonOfFile(options);
  beginning->rate_hz = 1000;
  return beginning;
}

// The samples that a station records while going straight in at 20 mm/s, and their reports.
struct Recorded {
  std::vector<GestureSample> samples;
  std::vector<StepReport> reports;
};
Recorded goingIn(const SceneModel& model, std::uint64_t ticks) {
  Recorded recorded;
  SimState state{};
  for (std::uint64_t k = 0; k < ticks; ++k) {
    TipSample tip{{0, 0, 0.005 - 20e-6 * static_cast<double>(k)}, {1, 0, 0, 0}};
    StepReport report;
    step(model, tip, state, report);
    recorded.samples.push_back(test::storedSample(k, tip, report));
    recorded.reports.push_back(report);
  }
  return recorded;
}

TEST(LessonFollow, reproducesTheEnginesForces) {
  const auto beginning = shoulder();
  auto follow = LessonFollow::make(beginning);
  ASSERT_TRUE(follow.ok());
  EXPECT_FALSE((*follow)->begun());
  const Recorded recorded = goingIn(beginning->lesson.model, 800);
  (*follow)->feed(recorded.samples, 0);
  EXPECT_TRUE((*follow)->begun());
  const Moment& now = (*follow)->now();
  const StepReport& report = recorded.reports.back();
  EXPECT_TRUE(now.inside);
  EXPECT_NEAR(now.term(Effect::kCutting), report.cutting_N, 1e-9);
  EXPECT_NEAR(now.term(Effect::kShaftFriction), report.friction_N, 1e-9);
  EXPECT_NEAR(now.depth_m, report.depth_m, 1e-12);
  EXPECT_NEAR(now.time_s, 0.799, 1e-9);
  EXPECT_NEAR((*follow)->trace().lastTime_s(), 0.799, 1e-9);
  EXPECT_FALSE(now.approximate);
}

TEST(LessonFollow, aContactWithBoneIsMarkedWhereTheTipComesIntoIt) {
  const auto beginning = shoulder();
  auto follow = std::move(*LessonFollow::make(beginning));
  // 20 mm/s from 5 mm above: the bone, 35 mm deep, is reached after 2 s
  follow->feed(goingIn(beginning->lesson.model, 1950).samples, 0);
  const auto contacts = [&] {
    std::vector<double> found_s;
    for (const TraceEvent& event : follow->trace().events())
      if (event.kind == TraceEvent::Kind::kBoneContact) found_s.push_back(event.time_s);
    return found_s;
  };
  EXPECT_TRUE(contacts().empty());
  const Recorded recorded = goingIn(beginning->lesson.model, 2200);
  follow->feed({recorded.samples.begin() + 1950, recorded.samples.end()}, 0);
  ASSERT_EQ(contacts().size(), 1u);
  EXPECT_NEAR(contacts()[0], 2.0, 1.01e-3);
}

TEST(LessonFollow, aGapIsCountedAndShownUntilTheNeedleIsOutside) {
  const auto beginning = shoulder();
  auto follow = std::move(*LessonFollow::make(beginning));
  const Recorded recorded = goingIn(beginning->lesson.model, 800);
  const auto part = [&](std::size_t from, std::size_t to) {
    return std::vector<GestureSample>(recorded.samples.begin() + static_cast<std::ptrdiff_t>(from),
                                      recorded.samples.begin() + static_cast<std::ptrdiff_t>(to));
  };
  follow->feed(part(0, 500), 0);
  EXPECT_FALSE(follow->now().approximate);
  follow->feed(part(700, 800), 200);
  EXPECT_EQ(follow->dropped(), 200u);
  EXPECT_TRUE(follow->now().approximate);
  EXPECT_TRUE(std::any_of(
      follow->trace().events().begin(), follow->trace().events().end(),
      [](const TraceEvent& event) { return event.kind == TraceEvent::Kind::kGap && event.missing == 200; }));
}

TEST(LessonFollow, behindAGapTheStationsMemoryTellsTheOldCuts) {
  auto beginning = std::make_shared<LessonBeginning>(*shoulder());
  StationLesson& lesson = beginning->lesson;
  lesson.scene.effects |= bitOf(Effect::kCutMemory);
  useUsualNumbers(effectEntry(Effect::kCutMemory), lesson.scene);
  lesson.model = *compile(lesson.scene, 1000);
  // from 5 mm outside to 20 mm inside and out again, three times
  MemoryFollower follower(lesson.model);
  const auto engine = std::make_unique<SimState>();
  StepReport report;
  std::vector<GestureSample> samples;
  Bytes memory;
  for (std::uint64_t k = 0; k < 4801; ++k) {
    const auto way = static_cast<double>(std::min(k % 2000, 2000 - k % 2000));
    const TipSample tip{{0, 0, 0.005 - 25e-6 * way}, {1, 0, 0, 0}};
    step(lesson.model, tip, *engine, report);
    const GestureSample sample = test::storedSample(k, tip, report);
    follower.follow(sample);
    if (k == 4050) memory = follower.cuts();
    samples.push_back(sample);
  }
  ASSERT_FALSE(memory.empty());
  const auto part = [&](std::size_t from, std::size_t to) {
    return std::vector<GestureSample>(samples.begin() + static_cast<std::ptrdiff_t>(from),
                                      samples.begin() + static_cast<std::ptrdiff_t>(to));
  };
  for (const bool told : {false, true}) {
    SCOPED_TRACE(told);
    auto follow = std::move(*LessonFollow::make(beginning));
    follow->feed(part(0, 100), 0);
    follow->feed(part(3900, 4700), 3800, told ? ByteView(memory) : ByteView());
    follow->feed(part(4700, 4801), 0);
    const Moment& now = follow->now();
    ASSERT_TRUE(now.inside);
    EXPECT_EQ(now.approximate, !told);
    if (told) {
      EXPECT_NEAR(now.term(Effect::kCutting), report.cutting_N, 1e-9);
    }
  }
}

TEST(LessonFollow, thePlannedLineFollowsTheLimb) {
  const auto file = shoulder();
  EXPECT_FALSE((*LessonFollow::make(file))->plan_W()) << "a profile from a file has no exercise";
  auto beginning = std::make_shared<LessonBeginning>(*file);
  pb::Exercise exercise;
  exercise.set_profile_id("shoulder-adult");
  beginning->lesson.exercise = exercise;
  exercise.mutable_plan()->set_frame(pb::Exercise::Plan::LIMB);
  exercise.mutable_plan()->mutable_entry_m()->set_x(0.01);
  exercise.mutable_plan()->mutable_direction()->set_z(-2);
  beginning->lesson.exercise = exercise;
  // a quarter turn about y: the limb's z is W's x
  beginning->X_WL = {{0.1, 0.2, 0.3}, {0, std::sqrt(0.5), 0, std::sqrt(0.5)}};
  const auto line = (*LessonFollow::make(beginning))->plan_W();
  ASSERT_TRUE(line);
  EXPECT_NEAR(norm(line->entry_W_m - Vec3{0.1, 0.2, 0.29}), 0, 1e-12);
  EXPECT_NEAR(norm(normalized(line->to_W_m - line->entry_W_m) - Vec3{-1, 0, 0}), 0, 1e-12);
}

TEST(LayerLadder, reachesAFifthBeyondTheTarget) {
  const auto scene = LessonFollow::make(shoulder());
  ASSERT_TRUE(scene.ok());
  // the ball extends to 29 mm, the bursa to 27
  EXPECT_NEAR(ladderDepth_m(*(*scene)->scene()), 1.2 * 0.027, 1e-9);
}

TEST(CellColumns, giveEachCellItsWidthAndShareTheRest) {
  using Widths = std::vector<float>;
  // 40 + 60 + 20 + 50 and three gaps of 10: 200 just suffice
  const Widths needed = {40, 60, 20, 50};
  EXPECT_EQ(cellColumns(needed, 10, 200), needed);
  EXPECT_EQ(cellColumns(needed, 10, 240), (Widths{50, 70, 30, 60}));
  // larger letters: two rows of two; each column as wide as its wider cell
  EXPECT_EQ(cellColumns(needed, 10, 199), (Widths{84.5F, 104.5F}))
      << "max(40, 20) + max(60, 50) + 10 = 110, and half of the 89 that are left for each";
  EXPECT_EQ(cellColumns(needed, 10, 109), Widths{109}) << "one below the other";
  EXPECT_EQ(cellColumns({}, 10, 109), Widths{109});
}

// 32.3 mm of needle are 26 mm below the skin.
TEST(LayerLadder, runsAlongTheNeedleAndHasNoDepthWithTheCapOn) {
  Moment now;
  now.depth_m = -0.004;
  EXPECT_EQ(ladderMark_m(now), -0.004);
  now.depth_m = 0.026;
  now.insertion_m = 0.0323;
  now.inside = true;
  EXPECT_EQ(ladderMark_m(now), 0.0323);
  now.inside = false;
  now.flags = kFlagCapped;
  EXPECT_FALSE(ladderMark_m(now));
}

TEST(DepthPlot, holdsTheWholeGestureAndTheTarget) {
  const auto follow = LessonFollow::make(shoulder());
  const TissuesOnLine way = wayOf({}, *(*follow)->scene());
  const DepthPlotRange shallow = depthPlotRange({{0, 0.004F, 2, 0}}, way);
  EXPECT_GT(shallow.to_m, 0.029) << "the target, where no one came near it";
  EXPECT_NEAR(shallow.force_N, 2.2, 1e-6);
  constexpr float kCapped = std::numeric_limits<float>::quiet_NaN();
  const DepthPlotRange deep = depthPlotRange({{0, 0.05F, 2, 0}, {0, kCapped, 9, 0}}, way);
  EXPECT_NEAR(deep.to_m, 0.054, 1e-6);
  EXPECT_NEAR(deep.force_N, 2.2, 1e-6);
  EXPECT_LT(deep.from_m, 0);
  EXPECT_GT(depthPlotRange({}, way).force_N, 0);
}

// The needle goes straight in; the shoulder's plan goes in at some 36 degrees from the normal.
TEST(DepthPlot, inABodyHasTheTissuesOfTheDeepestInsertion) {
  const auto profile = loadProfile(NEEDLELAB_SAMPLES "/volumes/shoulder-median.json");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  const auto scene = sceneViewOf(*profile, {});
  const auto model = compile(*sceneSpecOf(*profile), 1000);
  ASSERT_TRUE(scene.ok() && model.ok());
  SceneEngine engine(*model);
  StepReport report;
  std::vector<GestureSample> samples;
  Bytes paths;
  for (std::uint64_t k = 0; k < 3000; ++k) {
    const double way_m = 0.03 * std::sin(3.14159265 * static_cast<double>(k) / 3000);
    const TipSample tip{{0, 0, 0.004 - way_m}, {1, 0, 0, 0}};
    engine.step(tip, report);
    samples.push_back(test::storedSample(k, tip, report));
    if (report.layer >= 0 && (report.flags & (kFlagEntry | kFlagNewPath)) != 0)
      ASSERT_TRUE(appendPath({k, engine.pathInUse()}, paths));
  }
  DeepestLine deepest;
  deepest.take(samples, paths);
  LessonOutcome outcome;
  outcome.curve = gestureCurve(samples, model->limb);
  outcome.deepest = deepest.line();
  ASSERT_TRUE(outcome.deepest && outcome.deepest->path);
  const auto offWay = [&](const TissuesOnLine& way) {
    return std::ranges::count_if(outcome.curve, [&](const CurvePoint& p) { return isOffWay(p, way); });
  };
  EXPECT_EQ(offWay(wayOf(outcome, *scene)), 0);
  EXPECT_GT(offWay(wayOf({}, *scene)), 20) << "the planned way has others";
  outcome.deepest->path = nullptr;
  EXPECT_EQ(offWay(wayOf(outcome, *scene)), 0) << "a recording without its paths: from the body";
}

TEST(DepthPlot, noiseDoesNotFillIt) {
  const DepthPlotRange range = depthPlotRange({{0, 3e-5F, 0.01F, 0}}, {});
  EXPECT_EQ(range.force_N, leastSpanOf(PlotQuantity::kForce));
  EXPECT_NEAR(range.to_m, 1e-3 * leastSpanOf(PlotQuantity::kDepth), 1e-12);
}

TEST(LateralPlot, hasTheExercisesLimit) {
  const std::vector<double> time_s = {0, 1}, lateral_mm = {0, 0.03};
  std::vector<Measure> measures(1);
  measures[0].name = "largest_lateral_error_m";
  measures[0].max = 0.004;
  const Plot plot = lateralPlot(time_s, lateral_mm, {}, measures);
  ASSERT_EQ(plot.limits.size(), 1u);
  EXPECT_EQ(plot.limits[0].text, "at most 4 mm");
  EXPECT_EQ(fittedSpan(plot, AxisSpan{0, 0.03}).high, leastSpanOf(PlotQuantity::kDistance));
  EXPECT_TRUE(lateralPlot({}, {}, {}, {}).limits.empty());
  ASSERT_EQ(plot.series.size(), 1u);
  EXPECT_EQ(plot.series[0].name, "from own line");
  EXPECT_EQ(plot.title, "distance from own line");
}

TEST(LateralPlot, showsThePathFromThePlanNextToItsOwnLine) {
  const std::vector<double> time_s = {0, 1}, lateral_mm = {0, 0.03}, planned_mm = {2, 3};
  std::vector<Measure> measures(2);
  measures[0].name = "largest_lateral_error_m";
  measures[0].max = 0.003;
  measures[1].name = "largest_planned_line_error_m";
  measures[1].min = 0.001;
  measures[1].max = 0.004;
  const Plot plot = lateralPlot(time_s, lateral_mm, planned_mm, measures);
  ASSERT_EQ(plot.series.size(), 2u);
  EXPECT_EQ(plot.series[0].name, "from planned line");
  EXPECT_EQ(plot.series[0].colour, kPlanColour) << "as in the scenes";
  EXPECT_EQ(plot.series[1].name, "from own line") << "it is drawn last: where they meet, it is seen";
  EXPECT_FALSE(plot.series[0].dashed) << "dashes are for limits";
  EXPECT_TRUE(plot.legend);
  ASSERT_EQ(plot.limits.size(), 3u);
  EXPECT_EQ(plot.limits[0].at, 3);
  EXPECT_EQ(plot.limits[0].text, "own line: at most 3 mm");
  EXPECT_EQ(plot.limits[1].at, 1);
  EXPECT_EQ(plot.limits[1].text, "planned line: at least 1 mm");
  EXPECT_EQ(plot.limits[2].at, 4);
  EXPECT_EQ(plot.limits[2].text, "planned line: at most 4 mm");
}

}  // namespace
}  // namespace needlelab
