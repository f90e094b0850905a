#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "client/view/scene_renderer.h"
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
    frame_.camera = firstLook(*lesson_.scene);
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

TEST_F(SceneWidgetTest, showsTheRenderersPicturePixelByPixelWhereItStands) {
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

TEST_F(SceneWidgetTest, withoutASceneItIsEmpty) {
  renderer_->setScene(nullptr);
  const RgbaImage surface = drawn();
  EXPECT_EQ(test::pixelAt(surface, 300, 300), 0x14171Cu);
}

}  // namespace
}  // namespace needlelab
