#include "client/instructor/model/stored/rerun.h"

#include <gtest/gtest.h>

#include <cstring>

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

TEST(Rerun, isTheSameToTheBitEachTime) {
  const auto gesture = lesson({.depth_m = 0.02, .seconds = 1, .aside_m = 0.003});
  const auto bits = [&] {
    std::vector<double> forces;
    const auto run =
        rerunGesture(*gesture, {.profile_json = sampleProfile("shoulder-frail"), .axial_model = {}}, {}, {},
                     [&](const StepReport& report) {
                       forces.push_back(report.wrench_W.force_N.x);
                       forces.push_back(report.wrench_W.force_N.z);
                       forces.push_back(report.clamping_N);
                     });
    EXPECT_TRUE(run.ok());
    return forces;
  };
  const auto first = bits(), again = bits();
  ASSERT_EQ(first.size(), again.size());
  EXPECT_EQ(std::memcmp(first.data(), again.data(), first.size() * sizeof(double)), 0);
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
