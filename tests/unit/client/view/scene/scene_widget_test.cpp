#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>

#include "client/view/scene/scene_renderer.h"
#include "client/view/theme.h"
#include "tests/support/pictures/picture_check.h"
#include "tests/support/pictures/view_stage.h"
#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

class SceneWidgetTest : public test::ViewStage {
 protected:
  SceneWidgetTest() {
    options_.width_px = 760;
    options_.height_px = 560;
  }
  void SetUp() override {
    ViewStage::SetUp();
    if (!surface_) return;
    auto made = SceneRenderer::make();
    ASSERT_TRUE(made) << made.error().message;
    renderer_ = std::move(made).value();
    renderer_->setScene(lesson_.scene);
    frame_.camera = initialView(*lesson_.scene);
    frame_.aids = allAidSet();
    GestureReplica replica(lesson_.model);
    for (std::size_t i = 0; i < 2700; ++i) replica.feed(lesson_.samples[i]);
    frame_.moment = replica.now();
  }
  void TearDown() override {
    renderer_.reset();
    ViewStage::TearDown();
  }
  void screen() {
    beginScreen("s");
    ImGui::SetCursorScreenPos({30, 20});
    result_ = sceneWidget("scene", *renderer_, frame_, {700, 500}, widget_);
    endScreen();
  }
  RgbaImage drawn(int frames = 2) {
    return draw([this] { screen(); }, frames);
  }

  test::SampleLesson lesson_ = test::sampleLesson("shoulder-adult");
  std::unique_ptr<SceneRenderer> renderer_;
  SceneFrame frame_;
  SceneWidgetOptions widget_;
  SceneWidgetResult result_;
};

TEST_F(SceneWidgetTest, showsTheRenderersPicturePixelByPixel) {
  widget_.labels = widget_.legend = false;
  frame_.aids.set(pb::Exercise::GUIDES, false);
  const RgbaImage surface = drawn();
  const RgbaImage scene = renderer_->picture();
  ASSERT_EQ(scene.width, 700);
  ASSERT_EQ(scene.height, 500);
  EXPECT_FLOAT_EQ(result_.corner_px.x, 30);
  int wrong = 0;
  for (int y = 0; y < 500; y += 3)
    for (int x = 0; x < 700; x += 3)
      wrong += test::pixelAt(surface, 30 + x, 20 + y) != test::pixelAt(scene, x, y) ? 1 : 0;
  EXPECT_EQ(wrong, 0);
  // and nothing else
  EXPECT_EQ(test::pixelAt(surface, 15, 300), 0x14171Cu);
  EXPECT_EQ(test::pixelAt(surface, 745, 300), 0x14171Cu);
}

TEST_F(SceneWidgetTest, theMouseTurnsShiftsAndZoomsTheCamera) {
  drawn();
  const OrbitCamera first = frame_.camera;
  surface_->moveMouse(300, 300);
  drawn(1);
  surface_->setMouseButton(0, true);
  drawn(1);
  surface_->moveMouse(340, 310);
  drawn(1);
  EXPECT_TRUE(result_.camera_moved);
  surface_->setMouseButton(0, false);
  drawn(1);
  EXPECT_NE(frame_.camera.azimuth_rad, first.azimuth_rad);
  EXPECT_EQ(frame_.camera.focus_W_m, first.focus_W_m);
  surface_->setMouseButton(1, true);
  drawn(1);
  surface_->moveMouse(320, 280);
  drawn(1);
  surface_->setMouseButton(1, false);
  drawn(1);
  EXPECT_NE(frame_.camera.focus_W_m, first.focus_W_m);
  const double before_m = frame_.camera.distance_m;
  surface_->scroll(2);
  drawn(1);
  EXPECT_LT(frame_.camera.distance_m, before_m);
  // A double click restores the initial camera.
  for (int i = 0; i < 2; ++i) {
    surface_->setMouseButton(0, true);
    drawn(1);
    surface_->setMouseButton(0, false);
    drawn(1);
  }
  EXPECT_EQ(frame_.camera, first);
  drawn(2);
  EXPECT_FALSE(result_.camera_moved);
}

TEST_F(SceneWidgetTest, aMouseElsewhereOrACameraThatIsHeldDoesNothing) {
  widget_.mouse_moves_camera = false;
  const OrbitCamera first = frame_.camera;
  drawn();
  surface_->moveMouse(300, 300);
  surface_->setMouseButton(0, true);
  drawn(1);
  surface_->moveMouse(350, 300);
  surface_->scroll(3);
  drawn(1);
  surface_->setMouseButton(0, false);
  drawn(1);
  EXPECT_EQ(frame_.camera, first);
  EXPECT_TRUE(result_.hovered);
}

TEST_F(SceneWidgetTest, looksAsItsReference) {
  frame_.trails.push_back({{}, kSkyBlue});
  for (const Moment& moment : momentsOf(lesson_.model, lesson_.samples, 40))
    if (moment.tick < 2700) frame_.trails.back().points_W_m.push_back(moment.p_WT_m);
  EXPECT_TRUE(test::looksLike(drawn(3), std::string(NEEDLELAB_REFERENCE) + "/widget-shoulder.png"));
}

TEST_F(SceneWidgetTest, thePlannedLineIsDashedWithAnEntryRing) {
  widget_.labels = widget_.legend = false;
  frame_.aids.set(pb::Exercise::GUIDES, false);
  frame_.show_needle = false;
  const SceneView& scene = *lesson_.scene;
  // beside everything in the middle
  const PlanView plan = planViewOf(
      scene,
      PlannedLine{scene.focus_W_m + frame_.camera.right_W() * (0.3 * scene.extent_m), -scene.focus_normal_W});
  frame_.plan_W = plan;
  const RgbaImage with = drawn();
  frame_.aids.set(pb::Exercise::PLANNED_LINE, false);
  const RgbaImage without = drawn();
  frame_.aids.set(pb::Exercise::PLANNED_LINE, true);
  frame_.plan_W.reset();
  EXPECT_EQ(drawn().pixels, without.pixels) << "an exercise without a plan";
  EXPECT_GT(test::shareThatDiffers(with, without, 24), 0);

  const auto differsAt = [&](Vec3 p_W_m) {
    const auto at = frame_.camera.project(p_W_m, 700, 500);
    EXPECT_TRUE(at);
    const test::MeanColour a = test::meanAround(with, 30 + at->x_px, 20 + at->y_px, 0),
                           b = test::meanAround(without, 30 + at->x_px, 20 + at->y_px, 0);
    return std::fabs(a.red - b.red) + std::fabs(a.green - b.green) + std::fabs(a.blue - b.blue) > 24;
  };
  for (const Vec3 corner_W_m : plan.ring_W_m) EXPECT_TRUE(differsAt(corner_W_m));
  int dashes = 0, gaps = 0;
  for (int i = 0; i <= 400; ++i)
    (differsAt(plan.from_W_m + (plan.to_W_m - plan.from_W_m) * (i / 400.0)) ? dashes : gaps) += 1;
  EXPECT_GT(dashes, 100);
  EXPECT_GT(gaps, 40) << "a whole line is the needle's own";
}

TEST_F(SceneWidgetTest, theLegendNamesThePlannedLineAlsoBeforeTheNeedleIsInside) {
  widget_.labels = false;
  frame_.show_needle = false;
  frame_.plan_W =
      planViewOf(*lesson_.scene, PlannedLine{lesson_.scene->focus_W_m, -lesson_.scene->focus_normal_W});
  const RgbaImage with = drawn();
  widget_.legend = false;
  const RgbaImage without = drawn();
  // in the picture's lower right corner and nowhere else
  int at_corner = 0, elsewhere = 0;
  for (int y = 20; y < 520; ++y)
    for (int x = 30; x < 730; ++x)
      if (test::pixelAt(with, x, y) != test::pixelAt(without, x, y))
        (x > 730 - 260 && y > 520 - 80 ? at_corner : elsewhere) += 1;
  EXPECT_GT(at_corner, 500);
  EXPECT_EQ(elsewhere, 0);
}

TEST_F(SceneWidgetTest, withoutASceneItIsEmpty) {
  renderer_->setScene(nullptr);
  const RgbaImage surface = drawn();
  EXPECT_EQ(test::pixelAt(surface, 300, 300), 0x14171Cu);
}

}  // namespace
}  // namespace needlelab
