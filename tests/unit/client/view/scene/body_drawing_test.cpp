/// A body in the scene renderer: its cut, glass and closed skin, shadow, cap; kept parts leave nothing
/// behind.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "client/view/model/body_view.h"
#include "client/view/scene/scene_renderer.h"
#include "common/profile/profile.h"
#include "tests/support/pictures/picture_check.h"
#include "tests/support/pictures/view_stage.h"

namespace needlelab {
namespace {

constexpr int kWide = 640, kHigh = 400;

class BodyDrawingTest : public test::ViewStage {
 protected:
  void SetUp() override {
    ViewStage::SetUp();
    if (!surface_) return;
    static const pb::Profile profile = *loadProfile(NEEDLELAB_VOLUME);
    scene_ = std::make_shared<const SceneView>(*sceneViewOf(profile));
    renderer_ = fresh();
  }
  void TearDown() override {
    renderer_.reset();
    ViewStage::TearDown();
  }
  std::unique_ptr<SceneRenderer> fresh() const {
    auto made = SceneRenderer::make(4);
    EXPECT_TRUE(made) << (made ? "" : made.error().message);
    if (!made) return nullptr;
    (*made)->setScene(scene_);
    return std::move(made).value();
  }
  /// Straight down to a depth; negative: above the skin.
  SceneFrame frameAt(double depth_m) const {
    SceneFrame frame;
    frame.camera = initialView(*scene_);
    frame.aids = allAidSet();
    frame.aids.set(pb::Exercise::ARROWS, false);
    Moment& moment = frame.moment;
    const Vec3 in = -scene_->focus_normal_W;
    moment.q_WT = normalized(Quat{-in.y, in.x, 0, 1 + in.z + 1e-6});
    moment.u_W = zAxis(moment.q_WT);
    moment.p_entry_W_m = scene_->focus_W_m;
    moment.p_WT_m = scene_->focus_W_m + moment.u_W * depth_m;
    moment.inside = depth_m > 0;
    moment.alpha_rad = 0.3;
    const double none = std::numeric_limits<double>::quiet_NaN();
    moment.wall_W_m = {none, none, none};
    return frame;
  }
  /// At rest: the second drawing has all samples.
  static RgbaImage pictureOf(SceneRenderer& renderer, const SceneFrame& frame) {
    for (int i = 0; i < 3; ++i) renderer.draw(frame, kWide, kHigh);
    return renderer.picture();
  }
  std::shared_ptr<const SceneView> scene_;
  std::unique_ptr<SceneRenderer> renderer_;
};

double hueErrorOf(const RgbaImage& picture, PicturePoint at, Rgb expected) {
  const test::MeanColour seen = test::meanAround(picture, at.x_px, at.y_px, 1);
  const Vec3 a{seen.red, seen.green, seen.blue};
  const Vec3 b{static_cast<double>(expected.red), static_cast<double>(expected.green),
               static_cast<double>(expected.blue)};
  return norm(a) > 1 ? std::atan2(norm(cross(a, b)), dot(a, b)) : 9;
}

TEST_F(BodyDrawingTest, theCutShowsEachStructureInItsColourWhereItsNameIs) {
  SceneFrame frame = frameAt(0.02);
  frame.show_needle = false;
  frame.aids.set(pb::Exercise::ANATOMY, false);
  const RgbaImage picture = pictureOf(*renderer_, frame);
  int checked = 0;
  for (const BodySection::Name& name : renderer_->cutNames()) {
    const LayerView& structure = scene_->layers[name.structure];
    // bones before the cut are glass over what is behind; a bone's inside has a colour of its own
    if (structure.kind != pb::Volume::Structure::FAT && structure.kind != pb::Volume::Structure::MUSCLE &&
        structure.kind != pb::Volume::Structure::BURSA)
      continue;
    const auto at = frame.camera.project(name.place_W_m, kWide, kHigh);
    ASSERT_TRUE(at);
    if (at->y_px > kHigh - 4) continue;
    EXPECT_LT(hueErrorOf(picture, *at, structure.colour), 0.12) << structure.name;
    ++checked;
  }
  EXPECT_GE(checked, 3);
}

TEST_F(BodyDrawingTest, bonesShineThroughGlassAndAreHiddenByTheClosedSkin) {
  SceneFrame frame = frameAt(-0.01);
  frame.show_needle = false;
  frame.cut_open = false;
  frame.aids.set(pb::Exercise::ANATOMY, false);
  const RgbaImage glass = pictureOf(*renderer_, frame);
  frame.aids.set(pb::Exercise::TISSUES, false);
  const RgbaImage closed = pictureOf(*renderer_, frame);
  // where the humerus' head is, 45 mm below the skin
  const auto at = frame.camera.project(scene_->X_WL * Vec3{0, 0.026, -0.044}, kWide, kHigh);
  ASSERT_TRUE(at);
  const Rgb skin = kindColour(pb::Volume::Structure::SKIN), bone = kindColour(pb::Volume::Structure::BONE);
  EXPECT_LT(hueErrorOf(glass, *at, bone), hueErrorOf(glass, *at, skin));
  EXPECT_LT(hueErrorOf(closed, *at, skin), hueErrorOf(closed, *at, bone));
}

TEST_F(BodyDrawingTest, aNeedleAboveTheSkinCastsAShadowBesideItself) {
  SceneFrame frame = frameAt(-0.002);
  frame.aids = AidSet{};
  frame.camera.elevation_rad = 0.9;
  frame.show_hand = false;
  const RgbaImage with = pictureOf(*renderer_, frame);
  frame.show_needle = false;
  const RgbaImage without = pictureOf(*renderer_, frame);
  // skin that has become darker and kept its hue: no steel, plastic or ink
  int shadowed = 0;
  for (int y = 0; y < kHigh; ++y)
    for (int x = 0; x < kWide; ++x) {
      const test::MeanColour a = test::meanAround(with, x, y, 0), b = test::meanAround(without, x, y, 0);
      const double share = a.red / std::max(b.red, 1.0);
      shadowed += b.red > 90 && share < 0.96 && share > 0.4 &&
                  std::fabs(a.green / std::max(b.green, 1.0) - share) < 0.06 &&
                  std::fabs(a.blue / std::max(b.blue, 1.0) - share) < 0.09;
    }
  EXPECT_GT(shadowed, 60);
}

TEST_F(BodyDrawingTest, aMovedNeedleLeavesNothingBehind) {
  for (const double depth_m : {-0.02, 0.004, 0.015, -0.005}) (void)pictureOf(*renderer_, frameAt(depth_m));
  const RgbaImage kept = pictureOf(*renderer_, frameAt(0.01)),
                  fresh_picture = pictureOf(*fresh(), frameAt(0.01));
  EXPECT_LT(test::shareThatDiffers(kept, fresh_picture, 2), 1e-4);
}

TEST_F(BodyDrawingTest, aRestAfterTurningGivesTheFinePictureAgain) {
  SceneFrame frame = frameAt(0.01);
  const RgbaImage before = pictureOf(*renderer_, frame);
  for (int i = 0; i < 6; ++i) {
    frame.camera.azimuth_rad += 0.1;
    renderer_->draw(frame, kWide, kHigh);
  }
  frame.camera = initialView(*scene_);
  EXPECT_LT(test::shareThatDiffers(pictureOf(*renderer_, frame), before, 2), 1e-4);
}

TEST_F(BodyDrawingTest, aCapIsYellowAndComesOffWithoutAMove) {
  SceneView palpable = *scene_;
  palpable.cap_radius_m = 0.003;
  renderer_->setScene(std::make_shared<const SceneView>(palpable));
  SceneFrame frame = frameAt(-0.01);
  frame.show_hand = false;
  const RgbaImage bare = pictureOf(*renderer_, frame);
  frame.moment.flags |= kFlagCapped;
  const RgbaImage capped = pictureOf(*renderer_, frame);
  const Vec3 axis_W = zAxis(frame.moment.q_WT);
  const auto at = frame.camera.project(frame.moment.p_WT_m - axis_W * 0.008, kWide, kHigh);
  ASSERT_TRUE(at);
  const auto yellowness = [&](const RgbaImage& picture) {
    const test::MeanColour seen = test::meanAround(picture, at->x_px, at->y_px, 1);
    return 0.5 * (seen.red + seen.green) - seen.blue;
  };
  EXPECT_GT(yellowness(capped), yellowness(bare) + 30);
  frame.moment.flags &= ~std::uint32_t{kFlagCapped};
  EXPECT_LT(test::shareThatDiffers(pictureOf(*renderer_, frame), bare, 2), 1e-4);
}

TEST_F(BodyDrawingTest, looksAsItsReferences) {
  const std::filesystem::path references = NEEDLELAB_REFERENCE;
  EXPECT_TRUE(test::looksLike(pictureOf(*renderer_, frameAt(0.018)), references / "body-cut.png"));
  SceneFrame glass = frameAt(-0.006);
  glass.cut_open = false;
  EXPECT_TRUE(test::looksLike(pictureOf(*renderer_, glass), references / "body-glass.png"));
  glass.aids = AidSet{};
  glass.camera.elevation_rad = 0.7;
  EXPECT_TRUE(test::looksLike(pictureOf(*renderer_, glass), references / "body-closed.png"));
}

}  // namespace
}  // namespace needlelab
