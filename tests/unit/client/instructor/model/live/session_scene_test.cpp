#include "client/instructor/model/live/session_scene.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/unit/client/instructor/model/lesson_gestures.h"

namespace needlelab {
namespace {

TEST(SessionScene, aSampleProfileCanBeDrawnAndStepped) {
  const auto info = test::lessonInfo(test::sampleProfile("shoulder-adult"));
  const SessionScene scene = sceneOfSession(info.description());
  EXPECT_TRUE(scene.view);
  EXPECT_TRUE(scene.model);
  EXPECT_TRUE(scene.why.empty());
}

TEST(SessionScene, anUnreadableProfileIsExplained) {
  auto info = test::lessonInfo("{}");
  SessionScene scene = sceneOfSession(info.description());
  EXPECT_FALSE(scene.view);
  EXPECT_FALSE(scene.model);
  EXPECT_FALSE(scene.why.empty());

  info = test::lessonInfo(test::sampleProfile("shoulder-adult"));
  info.mutable_description()->set_rate_hz(3);  // drawn, but not stepped
  scene = sceneOfSession(info.description());
  EXPECT_TRUE(scene.view);
  EXPECT_FALSE(scene.model);
  EXPECT_FALSE(scene.why.empty());
}

TEST(SessionScene, placementsFromTheNetworkAreChecked) {
  pb::SessionDescription d;
  EXPECT_EQ(*placementOf(d), Pose{});
  for (const double v : {1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 2.0}) d.add_placement(v);
  EXPECT_EQ(*placementOf(d), (Pose{{1, 2, 3}, {0, 0, 0, 1}}));
  d.set_placement(6, 0);
  EXPECT_FALSE(placementOf(d).ok());
  d.set_placement(6, std::numeric_limits<double>::infinity());
  EXPECT_FALSE(placementOf(d).ok());
  d.add_placement(1);
  EXPECT_FALSE(placementOf(d).ok());
}

TEST(SessionScene, isAsStiffAsItWasRendered) {
  auto info = test::lessonInfo(test::sampleProfile("shoulder-adult"));
  EXPECT_EQ(sceneOfSession(info.description()).model->fixture.max_stiffness_N_per_m, 300);
  info.mutable_description()->set_stiffness_share(0.55);
  const SessionScene scene = sceneOfSession(info.description());
  EXPECT_NEAR(scene.model->fixture.max_stiffness_N_per_m, 165, 1e-9);
  EXPECT_NEAR(scene.model->orientation.stiffness_Nm_per_rad, 0.275, 1e-12);
  info.mutable_description()->set_delay_stiffness_share(0.8);
  EXPECT_NEAR(sceneOfSession(info.description()).model->fixture.max_stiffness_N_per_m, 165, 1e-9);
  EXPECT_NEAR(sceneOfSession(info.description()).model->wall.stiffness_N_per_m,
              0.8 * scene.model->wall.stiffness_N_per_m, 1e-9);
  // values from the network
  for (const double share : {0.0, -1.0, 2.0, std::numeric_limits<double>::quiet_NaN()}) {
    info.mutable_description()->set_stiffness_share(share);
    EXPECT_EQ(stiffnessSharesOf(info.description()).lever, 1);
  }
}

TEST(SessionScene, hasBoneWhereItWasRendered) {
  const auto info = test::lessonInfo(test::sampleProfile("wrist-adult"));
  pb::SessionDescription d = info.description();
  EXPECT_TRUE(sceneOfSession(d).model->isLive(Effect::kBone)) << "a session without a list is as its profile";
  d.add_live_effects("CUTTING");
  EXPECT_FALSE(sceneOfSession(d).model->isLive(Effect::kBone));
  EXPECT_EQ(leftOut(d, sceneOfSession(d).profile), bitOf(Effect::kBone));
  EXPECT_EQ(leftOut(d, pb::Profile()), 0U) << "which lists no bone";
  d.add_live_effects("BONE");
  EXPECT_TRUE(sceneOfSession(d).model->isLive(Effect::kBone));
}

TEST(SessionScene, idsAsText) {
  EXPECT_EQ(sessionIdText("short"), "?");
  EXPECT_EQ(sessionIdText(std::string(16, '\x11')), "11111111-1111-1111-1111-111111111111");
}

}  // namespace
}  // namespace needlelab
