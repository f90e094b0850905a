#include "client/instructor/model/stored/rerun.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "common/haptics/body/body_engine.h"
#include "tests/unit/client/instructor/model/lesson_gestures.h"

namespace needlelab {
namespace {

using test::lesson;
using test::sampleProfile;

TEST(Rerun, withItsOwnProfileTheForceIsAsRecorded) {
  const auto gesture = lesson();
  const auto run = rerunGesture(*gesture, {});
  ASSERT_TRUE(run.ok()) << run.error().message;
  // the samples carry the engine's own unrounded forces
  EXPECT_EQ(run->peak_force_N, run->felt_peak_N);
  EXPECT_EQ(run->mean_difference_N, 0);
  EXPECT_GT(run->peak_force_N, 0.5);
  EXPECT_EQ(run->ticks, gesture->samples.size());
  EXPECT_EQ(run->trace.lastTime_s(), gesture->last_s());
}

// A cap that is pressed on a patient's body and slid along: the re-run finds its own pieces of the body.
TEST(Rerun, withTheCapOnTheForceIsAsRecordedAndAnOlderOneSaysThatItIsNot) {
  const std::string json = sampleProfile("volumes/wrist-median");
  const auto spec = sceneSpecOf(*parseProfile(json, "sample"));
  const auto model = compile(*spec, 1000);
  SceneEngine engine(*model);
  engine.wantCap(true);
  std::vector<GestureSample> samples(3000);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double t_s = 1e-3 * static_cast<double>(i);
    const Vec3 tip{0.01 * std::sin(2 * t_s), 0.005 * std::sin(3 * t_s), 0.01 - 0.016 * std::sin(t_s)};
    StepReport report;
    engine.step({tip, {1, 0, 0, 0}}, report);
    GestureSample& sample = samples[i];
    sample.tick = i;
    sample.q_WT[0] = 1;
    const Vec3 force = report.wrench_W.force_N;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sample.p_WT_m[axis] = std::array{tip.x, tip.y, tip.z}[axis];
      sample.force_W_N[axis] = std::array{force.x, force.y, force.z}[axis];
    }
    sample.layer = static_cast<std::int8_t>(report.layer);
    sample.flags = report.flags;
  }
  auto info = test::lessonInfo(json);
  info.mutable_description()->set_capped_on_pieces(true);
  const std::string inexact = "recorded before 1.0: forces with the cap on are not exact";
  for (const bool older : {false, true}) {
    info.mutable_description()->set_capped_on_pieces(!older);
    std::size_t at = 0;
    double most_N = 0;
    const auto run = rerunGesture(*gestureOf(info, samples), {}, {}, {}, [&](const StepReport& report) {
      const Vec3 force = report.wrench_W.force_N;
      const double(&stored)[3] = samples[at].force_W_N;
      EXPECT_EQ(force, (Vec3{stored[0], stored[1], stored[2]})) << at;
      most_N = std::max(most_N, norm(force));
      ++at;
    });
    ASSERT_TRUE(run.ok()) << run.error().message;
    EXPECT_EQ(std::ranges::count(run->sentences, inexact), older ? 1 : 0);
    EXPECT_GT(most_N, 1);
  }
}

TEST(Rerun, anotherPatientFeelsOtherwise) {
  const auto gesture = lesson();
  const auto run =
      rerunGesture(*gesture, {.profile_json = sampleProfile("shoulder-muscular"), .axial_model = {}});
  ASSERT_TRUE(run.ok()) << run.error().message;
  EXPECT_NE(run->peak_force_N, run->felt_peak_N);
  EXPECT_NE(run->what.find("shoulder-muscular"), std::string::npos);
  const auto direct = rerunGesture(*gesture, {.profile_json = {}, .axial_model = "DIRECT"});
  ASSERT_TRUE(direct.ok()) << direct.error().message;
  EXPECT_NE(direct->what.find("DIRECT"), std::string::npos);
  EXPECT_NE(direct->peak_force_N, run->peak_force_N);
}

// the effects held by device and tool were determined for the session's own profile
TEST(Rerun, anotherPatientHasItsOwnStiffness) {
  const std::string json = sampleProfile("shoulder-adult");
  auto info = test::lessonInfo(json);
  info.mutable_description()->set_stiffness_share(0.5);
  info.mutable_description()->set_delay_stiffness_share(0.9);
  info.mutable_description()->add_live_effects("CUTTING");
  const auto gesture = gestureOf(info, test::lessonSamples(json, {}));
  const auto own = rerunGesture(*gesture, {});
  ASSERT_TRUE(own.ok()) << own.error().message;
  EXPECT_EQ(own->scene.model->fixture.max_stiffness_N_per_m, 150);
  const auto other =
      rerunGesture(*gesture, {.profile_json = sampleProfile("wrist-adult"), .axial_model = {}});
  ASSERT_TRUE(other.ok()) << other.error().message;
  EXPECT_EQ(other->scene.model->fixture.max_stiffness_N_per_m, 300);
  EXPECT_NEAR(own->scene.model->wall.stiffness_N_per_m, 0.9 * other->scene.model->wall.stiffness_N_per_m,
              1e-9);
  EXPECT_TRUE(other->scene.model->isLive(Effect::kBone));
}

TEST(Rerun, impossibleRunsAreExplained) {
  const auto gesture = lesson();
  EXPECT_EQ(rerunGesture(*gesture, {.profile_json = "{", .axial_model = {}}).error().code,
            ErrorCode::kInvalidInput);
  EXPECT_EQ(rerunGesture(*gesture, {.profile_json = {}, .axial_model = "MAGIC"}).error().code,
            ErrorCode::kInvalidInput);
  EXPECT_FALSE(rerunGesture(*gesture, {}, {}, [] { return true; }).ok()) << "stopped";
}

}  // namespace
}  // namespace needlelab
