// The insertion that the End screen shows again, against formulas of a made gesture.
#include <gtest/gtest.h>

#include <cmath>

#include "client/station/window/screens/insertion_replay.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/measures/syringe_events.h"
#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

constexpr double kRate_hz = 1000;

// Two insertions straight down, from 1 to 3 s and from 5 to 9 s, each deepest in its middle: to 20 mm, to 30
// mm. `bone`: the layer of the second between 6.5 and 7 s.
double depthAt_m(double t) {
  const auto way = [t](double from, double to, double deepest) {
    return deepest * (1 - std::fabs(2 * (t - from) / (to - from) - 1));
  };
  return t < 4 ? way(1, 3, 0.020) : way(5, 9, 0.030);
}
Moment momentAt(std::uint64_t tick, int bone = 2) {
  Moment moment;
  moment.tick = tick;
  moment.time_s = static_cast<double>(tick) / kRate_hz;
  moment.q_WT = {0, 1, 0, 0};  // the needle's axis points down
  const double depth_m = depthAt_m(moment.time_s);
  moment.p_WT_m = {0.001 * moment.time_s, 0, -depth_m};
  if (depth_m <= 0) return moment;
  moment.layer = moment.time_s >= 6.5 && moment.time_s < 7 ? bone : 2;
  moment.insertion_m = depth_m;
  moment.force_W_N = {0, 0, 1.5};
  return moment;
}

struct Made {
  test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  GestureTrace trace;
  explicit Made(int bone = 2, const char* profile = "shoulder-adult")
      : lesson(test::sampleLesson(profile)),
        trace(180, BoneContacts(lesson.profile, anatomyOf(lesson.profile, {}))) {
    for (std::uint64_t tick = 0; tick < 10'000; ++tick) trace.push(momentAt(tick, bone));
  }
  [[nodiscard]] std::optional<InsertionReplay> replay(std::span<const TickSpan> injections = {}) const {
    return insertionReplay(trace, *lesson.scene, injections, kRate_hz);
  }
};

TEST(InsertionReplay, isTheLastInsertionAtItsFurthestPoint) {
  const auto replay = Made().replay();
  ASSERT_TRUE(replay);
  EXPECT_NEAR(replay->from_s, 5, 0.011);
  EXPECT_NEAR(replay->to_s, 9, 0.011);
  EXPECT_NEAR(replay->at_s, 7, 0.011);
  ASSERT_GT(replay->path_W_m.size(), 390u) << "100 a second";
  for (const Vec3 p_W_m : replay->path_W_m)
    EXPECT_NEAR(p_W_m.z, -depthAt_m(p_W_m.x / 0.001), 1e-9) << "the tip's places, in this insertion";
  EXPECT_NEAR(replay->path_W_m.front().x, 0.001 * replay->from_s, 1e-9);
  EXPECT_NEAR(replay->path_W_m.back().x, 0.001 * replay->to_s, 1e-9);
  EXPECT_TRUE(replay->bone_W_m.empty());
  EXPECT_TRUE(replay->opening_W_m.empty());
}

TEST(InsertionReplay, isThatOfTheLastInjectionAtItsBegin) {
  const Made made;
  const TickSpan injections[] = {{1200, 1300}, {1500, 2000}};
  const auto replay = made.replay(injections);
  ASSERT_TRUE(replay);
  EXPECT_NEAR(replay->from_s, 1, 0.011);
  EXPECT_NEAR(replay->to_s, 3, 0.011);
  EXPECT_NEAR(replay->at_s, 1.5, 1e-9);
  ASSERT_NEAR(static_cast<double>(replay->opening_W_m.size()), 51, 1) << "half a second";
  const double behind_m = openingBehindTip_m(made.lesson.scene->needle);
  for (const Vec3 p_W_m : replay->opening_W_m)
    EXPECT_NEAR(p_W_m.z, behind_m - depthAt_m(p_W_m.x / 0.001), 1e-9);
}

TEST(InsertionReplay, marksWhereTheTipMetBone) {
  int bone = 0;
  const auto scene = test::sampleLesson("shoulder-adult").scene;
  while (layerName(*scene, bone) != "bone") ++bone;
  const auto replay = Made(bone).replay();
  ASSERT_TRUE(replay);
  ASSERT_EQ(replay->bone_W_m.size(), 1u);
  EXPECT_NEAR(replay->bone_W_m[0].z, -depthAt_m(6.5), 1e-9);
}

TEST(InsertionReplay, theTipStaysOnTheBoneThatTheHandPushesAgainst) {
  // the hand goes on to 30 mm, the needle rests on bone at 22 mm from where it came in
  constexpr double kBone_m = 0.022;
  const auto made = test::sampleLesson("shoulder-adult");
  GestureTrace trace;
  for (std::uint64_t tick = 5000; tick < 10'000; ++tick) {
    Moment moment = momentAt(tick);
    moment.inside = moment.layer >= 0;
    moment.p_entry_W_m = {moment.p_WT_m.x, 0, 0};
    moment.u_W = {0, 0, -1};
    moment.insertion_m = std::min(moment.insertion_m, kBone_m);
    trace.push(moment);
  }
  const auto replay = insertionReplay(trace, *made.scene, {}, kRate_hz);
  ASSERT_TRUE(replay);
  ASSERT_GT(replay->path_W_m.size(), 390u);
  for (const Vec3 p_W_m : replay->path_W_m)  // 0.2 mm: isHeldBack
    EXPECT_NEAR(p_W_m.z, -std::min(depthAt_m(p_W_m.x / 0.001), kBone_m), 2e-4 + 1e-9);
}

TEST(InsertionReplay, namesTheLayersThatTheTipWasIn) {
  EXPECT_EQ(Made(4).replay()->met, (std::vector<int>{2, 4}));
}

TEST(InsertionReplay, aStepIsAQuarterOfASecondAndStaysWithinTheInsertion) {
  const Made made;
  auto replay = *made.replay();
  const double at_s = replay.at_s;
  replay.step(1);
  EXPECT_NEAR(replay.at_s, at_s + 0.25, 1e-9);
  replay.step(-3);
  EXPECT_NEAR(replay.at_s, at_s - 0.5, 1e-9);
  // its first and last moments are 10 ms apart from those outside
  EXPECT_EQ(replayText(replay, made.trace.at(replay.at_s), *made.lesson.scene),
            "Last insertion, 1.50 s of 3.99 s: 1.50 N, in muscle");
  for (int i = 0; i < 99; ++i) replay.step(1);
  EXPECT_EQ(replay.at_s, replay.to_s);
  for (int i = 0; i < 99; ++i) replay.step(-1);
  EXPECT_EQ(replay.at_s, replay.from_s);
}

TEST(InsertionReplay, withoutAnInsertionThereIsNone) {
  const Made made;
  GestureTrace outside;
  for (std::uint64_t tick = 0; tick < 900; ++tick) outside.push(momentAt(tick));
  EXPECT_FALSE(insertionReplay(outside, *made.lesson.scene, {}, kRate_hz));
}

TEST(InsertionReplay, theViewShowsTheWholeWayInTheMiddle) {
  const Made made;
  const auto replay = *made.replay();
  const OrbitCamera camera = viewOfInsertion(*made.lesson.scene, replay);
  constexpr double kWidth_px = 600, kHeight_px = 300;
  const auto entry = camera.project(replay.path_W_m.front(), kWidth_px, kHeight_px);
  const auto furthest = camera.project({0.007, 0, -0.030}, kWidth_px, kHeight_px);
  ASSERT_TRUE(entry && furthest);
  EXPECT_NEAR(0.5 * (entry->y_px + furthest->y_px), kHeight_px / 2, 6);
  EXPECT_NEAR(0.5 * (entry->x_px + furthest->x_px), kWidth_px / 2, 6);
  // a third of the height, shortened by the camera's elevation
  EXPECT_NEAR(furthest->y_px - entry->y_px, kHeight_px / 3 * std::cos(camera.elevation_rad), 8);
}

TEST(InsertionReplay, injectionsAreThoseThatBeganInTissue) {
  std::vector<pb::SyringeEvent> events(3);
  for (std::size_t i = 0; i < events.size(); ++i) {
    events[i].set_kind(i == 0 ? pb::SyringeEvent::ASPIRATION : pb::SyringeEvent::INJECTION);
    events[i].set_begin_tick(100 * i);
    events[i].set_end_tick(100 * i + 50);
    events[i].mutable_begin()->set_in_tissue(i != 1);
  }
  const auto found = injectionsIn(eventsJson(events));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].begin, 200u);
  EXPECT_EQ(found[0].end, 250u);
  EXPECT_TRUE(injectionsIn("").empty());
}

}  // namespace
}  // namespace needlelab
