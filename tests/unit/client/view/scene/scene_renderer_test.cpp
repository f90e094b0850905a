#include "client/view/scene/scene_renderer.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include <cmath>

#include "tests/support/pictures/picture_check.h"
#include "tests/support/pictures/view_stage.h"
#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

using test::meanAround;
using test::MeanColour;
using test::SampleLesson;

constexpr int kWidth = 640, kHeight = 480;

class SceneRendererTest : public test::ViewStage {
 protected:
  void SetUp() override {
    ViewStage::SetUp();
    if (surface_) renderer_ = fresh();
  }
  void TearDown() override {
    renderer_.reset();
    ViewStage::TearDown();
  }
  std::unique_ptr<SceneRenderer> fresh(int samples = 4) {
    auto made = SceneRenderer::make(samples);
    EXPECT_TRUE(made) << (made ? "" : made.error().message);
    return made ? std::move(made).value() : nullptr;
  }
  // The lesson at a given time, with the initial camera.
  SceneFrame frameAt(const SampleLesson& lesson, double time_s) {
    GestureReplica replica(lesson.model);
    for (const GestureSample& sample : lesson.samples) {
      if (static_cast<double>(sample.tick) / 1000 > time_s) break;
      replica.feed(sample);
    }
    SceneFrame frame;
    frame.moment = replica.now();
    frame.camera = initialView(*lesson.scene);
    frame.aids = allAidSet();
    return frame;
  }
  /// At rest: a first picture is one in haste.
  RgbaImage pictureOf(SceneRenderer& renderer, const SceneFrame& frame) {
    while (renderer.draw(frame, kWidth, kHeight)) {
    }
    return renderer.picture();
  }
  std::unique_ptr<SceneRenderer> renderer_;
};

PicturePoint placeIn(const SceneFrame& frame, Vec3 p_W_m) {
  const auto point = frame.camera.project(p_W_m, kWidth, kHeight);
  EXPECT_TRUE(point);
  return point.value_or(PicturePoint{});
}

// Returns how far a colour's direction is from the palette's: shading changes only the length.
double hueError(MeanColour seen, Rgb expected) {
  const Vec3 a{seen.red, seen.green, seen.blue};
  const Vec3 b{static_cast<double>(expected.red), static_cast<double>(expected.green),
               static_cast<double>(expected.blue)};
  return norm(a) > 1 ? std::atan2(norm(cross(a, b)), dot(a, b)) : 9;
}

TEST_F(SceneRendererTest, theTargetIsDrawnWhereTheCameraProjectsIt) {
  for (const char* name : {"shoulder-adult", "knee-adult", "lumbar-adult", "wrist-adult"}) {
    const SampleLesson lesson = test::sampleLesson(name);
    // with no other structure in front of it
    SceneView alone = *lesson.scene;
    alone.hazards.clear();
    renderer_->setScene(std::make_shared<const SceneView>(alone));
    SceneFrame frame = frameAt(lesson, 0);
    frame.show_needle = false;
    for (const double azimuth_rad : {0.3, -0.8, 2.4}) {
      frame.camera.azimuth_rad = azimuth_rad;
      const RgbaImage picture = pictureOf(*renderer_, frame);
      const TargetView& target = lesson.scene->targets.front();
      const PicturePoint at = placeIn(frame, target.center_W_m);
      EXPECT_LT(hueError(meanAround(picture, at.x_px, at.y_px, 2), kTargetColour), 0.25)
          << name << ", " << azimuth_rad;
      frame.aids.set(pb::Exercise::ANATOMY, false);
      const RgbaImage without = pictureOf(*renderer_, frame);
      EXPECT_GT(hueError(meanAround(without, at.x_px, at.y_px, 2), kTargetColour), 0.25) << name;
      frame.aids.set(pb::Exercise::ANATOMY, true);
    }
  }
}

TEST_F(SceneRendererTest, theCutShowsEachLayerInItsTissuesColour) {
  for (const char* name : {"shoulder-adult", "lumbar-adult", "deltoid-adult"}) {
    const SampleLesson lesson = test::sampleLesson(name);
    const SceneView& scene = *lesson.scene;
    renderer_->setScene(lesson.scene);
    SceneFrame frame = frameAt(lesson, 0);
    frame.show_needle = false;
    frame.aids.set(pb::Exercise::ANATOMY, false);
    const RgbaImage picture = pictureOf(*renderer_, frame);
    // in the plane of the cut: upright, facing the eye, a tenth of the extent behind the focus
    const Vec3 up = scene.focus_normal_W, to_eye = frame.camera.eye_W_m() - scene.focus_W_m;
    const Vec3 toward = normalized(to_eye - up * dot(up, to_eye));
    int checked = 0;
    for (const LayerView& layer : scene.layers) {
      const double middle_m = 0.5 * (layer.top_m + std::min(layer.bottom_m, layer.top_m + 0.012));
      if (layer.bottom_m - layer.top_m < 0.0018) continue;
      // straight below the focus, at the same depth in the plane of the cut
      Vec3 p = scene.focus_W_m - toward * (0.1 * scene.extent_m);
      for (int i = 0; i < 40; ++i) p += up * (depthAt(scene, p) - middle_m);
      const PicturePoint at = placeIn(frame, p);
      if (at.y_px > kHeight - 8) continue;
      ++checked;
      EXPECT_LT(hueError(meanAround(picture, at.x_px, at.y_px, 1), layer.colour), 0.12)
          << name << ", " << layer.name;
    }
    EXPECT_GE(checked, 3) << name;
  }
}

TEST_F(SceneRendererTest, theNeedleIsSeenAlongItsShaftAndNothingElseChanges) {
  const SampleLesson lesson = test::sampleLesson("shoulder-adult");
  renderer_->setScene(lesson.scene);
  SceneFrame frame = frameAt(lesson, 2.6);
  frame.aids.set(pb::Exercise::GUIDES, false);
  frame.aids.set(pb::Exercise::ARROWS, false);
  const RgbaImage with = pictureOf(*renderer_, frame);
  SceneFrame bare = frame;
  bare.show_needle = false;
  const RgbaImage without = pictureOf(*renderer_, bare);
  const Vec3 axis = normalized(zAxis(frame.moment.q_WT));
  for (const double back_m : {0.002, 0.01, 0.03, 0.05}) {
    const PicturePoint at = placeIn(frame, frame.moment.p_WT_m - axis * back_m);
    const MeanColour a = meanAround(with, at.x_px, at.y_px, 0), b = meanAround(without, at.x_px, at.y_px, 0);
    EXPECT_GT(std::fabs(a.red - b.red) + std::fabs(a.green - b.green) + std::fabs(a.blue - b.blue), 24)
        << back_m;
  }
  // beyond the tip there is no needle
  const PicturePoint beyond = placeIn(frame, frame.moment.p_WT_m + axis * 0.004);
  EXPECT_EQ(test::pixelAt(with, beyond.x_px, beyond.y_px), test::pixelAt(without, beyond.x_px, beyond.y_px));
  EXPECT_LT(test::shareThatDiffers(with, without, 0), 0.12);
}

TEST_F(SceneRendererTest, drawingMovingPartsOverACacheEqualsAFullDrawing) {
  const SampleLesson lesson = test::sampleLesson("knee-adult");
  renderer_->setScene(lesson.scene);
  pictureOf(*renderer_, frameAt(lesson, 0.1));
  for (const double time_s : {0.2, 1.4, 2.2, 2.9, 4.1, 5.4}) {
    const SceneFrame frame = frameAt(lesson, time_s);
    EXPECT_TRUE(renderer_->draw(frame, kWidth, kHeight));
    auto other = fresh();
    other->setScene(lesson.scene);
    EXPECT_EQ(renderer_->picture().pixels, pictureOf(*other, frame).pixels) << time_s;
  }
}

TEST_F(SceneRendererTest, whatLooksTheSameIsNotDrawnAgain) {
  const SampleLesson lesson = test::sampleLesson("shoulder-adult");
  renderer_->setScene(lesson.scene);
  SceneFrame frame = frameAt(lesson, 2.6);
  EXPECT_TRUE(renderer_->draw(frame, kWidth, kHeight)) << "in haste";
  EXPECT_TRUE(renderer_->draw(frame, kWidth, kHeight)) << "fine";
  EXPECT_FALSE(renderer_->draw(frame, kWidth, kHeight));
  frame.moment.p_WT_m.x += 1e-7;  // too small to see
  frame.moment.time_s += 1;
  EXPECT_FALSE(renderer_->draw(frame, kWidth, kHeight));
  frame.moment.p_WT_m.x += 1e-3;
  EXPECT_TRUE(renderer_->draw(frame, kWidth, kHeight));
  EXPECT_TRUE(renderer_->draw(frame, kWidth + 1, kHeight));
}

TEST_F(SceneRendererTest, aCameraThatCameToRestGetsTheFinePicture) {
  const SampleLesson lesson = test::sampleLesson("shoulder-adult");
  renderer_->setScene(lesson.scene);
  SceneFrame frame = frameAt(lesson, 2.6);
  for (int i = 0; i < 4; ++i) {
    frame.camera.orbit(8, 2, kHeight);
    EXPECT_TRUE(renderer_->draw(frame, kWidth, kHeight));
  }
  const RgbaImage moving = renderer_->picture();
  EXPECT_TRUE(renderer_->draw(frame, kWidth, kHeight));
  EXPECT_FALSE(renderer_->draw(frame, kWidth, kHeight));
  auto other = fresh();
  other->setScene(lesson.scene);
  const RgbaImage fine = pictureOf(*other, frame);
  EXPECT_EQ(renderer_->picture().pixels, fine.pixels);
  // The fast rendering is the same except at edges.
  EXPECT_NE(moving.pixels, fine.pixels);
  EXPECT_LT(test::shareThatDiffers(moving, fine, 40), 0.03);
}

TEST_F(SceneRendererTest, closedSkinHidesTheTip) {
  const SampleLesson lesson = test::sampleLesson("shoulder-adult");
  renderer_->setScene(lesson.scene);
  SceneFrame frame = frameAt(lesson, 2.9);
  ASSERT_GT(frame.moment.insertion_m, 0.015);
  frame.aids = AidSet{};
  const RgbaImage with = pictureOf(*renderer_, frame);
  frame.show_needle = false;
  const RgbaImage without = pictureOf(*renderer_, frame);
  const PicturePoint tip = placeIn(frame, frame.moment.p_WT_m);
  EXPECT_EQ(test::pixelAt(with, tip.x_px, tip.y_px), test::pixelAt(without, tip.x_px, tip.y_px));
  // The part outside is visible.
  const PicturePoint hub = placeIn(frame, frame.moment.p_WT_m - normalized(zAxis(frame.moment.q_WT)) * 0.055);
  EXPECT_NE(test::pixelAt(with, hub.x_px, hub.y_px), test::pixelAt(without, hub.x_px, hub.y_px));
}

TEST_F(SceneRendererTest, arrowsHaveTheirEffectsColourAndLength) {
  const SampleLesson lesson = test::sampleLesson("shoulder-adult");
  renderer_->setScene(lesson.scene);
  SceneFrame frame = frameAt(lesson, 2.2);
  frame.aids.set(pb::Exercise::ANATOMY, false);
  frame.aids.set(pb::Exercise::GUIDES, false);
  frame.moment.term(Effect::kShaftFriction) = frame.moment.term(Effect::kPuncture) =
      frame.moment.term(Effect::kAttracted) = frame.moment.term(Effect::kClamping) = 0;
  const auto vermillionRows = [&](double cutting_N) {
    frame.moment.term(Effect::kCutting) = cutting_N;
    const RgbaImage picture = pictureOf(*renderer_, frame);
    int rows = 0;
    for (int y = 0; y < kHeight; ++y) {
      bool found = false;
      for (int x = 0; x < kWidth && !found; ++x) {
        const unsigned p = test::pixelAt(picture, x, y);
        const MeanColour c{static_cast<double>(p >> 16), static_cast<double>((p >> 8) & 255u),
                           static_cast<double>(p & 255u)};
        found = c.red > 90 && hueError(c, kVermillion) < 0.06;
      }
      rows += found ? 1 : 0;
    }
    return rows;
  };
  const int none = vermillionRows(0), one = vermillionRows(-1), two = vermillionRows(-2);
  EXPECT_LT(none, 6);
  EXPECT_GT(one, 12);
  EXPECT_NEAR(two, 2 * one, 0.35 * one);
}

TEST_F(SceneRendererTest, thePlungerGoesDown) {
  const SampleLesson lesson = test::sampleLesson("wrist-adult");
  renderer_->setScene(lesson.scene);
  SceneFrame frame = frameAt(lesson, 2.6);
  frame.camera.distance_m *= 2.2;
  frame.moment.plunger = 0;
  const RgbaImage out = pictureOf(*renderer_, frame);
  frame.moment.plunger = 1;
  const RgbaImage in = pictureOf(*renderer_, frame);
  const double share = test::shareThatDiffers(out, in, 20);
  EXPECT_GT(share, 0.001);
  EXPECT_LT(share, 0.06);
}

TEST_F(SceneRendererTest, aSecondGestureIsLaidOverInItsColour) {
  const SampleLesson lesson = test::sampleLesson("shoulder-adult");
  renderer_->setScene(lesson.scene);
  SceneFrame frame = frameAt(lesson, 1.0);
  frame.show_needle = false;
  frame.aids = AidSet{};
  frame.second = frame.moment;
  const RgbaImage picture = pictureOf(*renderer_, frame);
  const PicturePoint at = placeIn(frame, frame.second->p_WT_m - normalized(zAxis(frame.second->q_WT)) * 0.03);
  EXPECT_LT(hueError(meanAround(picture, at.x_px, at.y_px, 0), kSecondGesture), 0.3);
}

TEST_F(SceneRendererTest, oddCamerasAndMomentsAreDrawnOrLeftButNeverFail) {
  const SampleLesson lesson = test::sampleLesson("shoulder-adult");
  renderer_->setScene(lesson.scene);
  SceneFrame frame = frameAt(lesson, 2.6);
  frame.camera.focus_W_m = frame.moment.p_WT_m;
  frame.camera.distance_m = 0.02;  // within the syringe's reach
  EXPECT_TRUE(renderer_->draw(frame, kWidth, kHeight));
  frame.camera.elevation_rad = 1.48;
  EXPECT_TRUE(renderer_->draw(frame, 1, 1));
  EXPECT_FALSE(renderer_->draw(frame, 0, 50));
  frame.moment.wall_W_m = {std::nan(""), std::nan(""), std::nan("")};
  frame.moment.plunger = std::nan("");
  EXPECT_TRUE(renderer_->draw(frame, 50, 30));
  auto empty = fresh(1);
  EXPECT_FALSE(empty->draw(frame, 50, 30));
  EXPECT_TRUE(empty->picture().pixels.empty());
}

TEST_F(SceneRendererTest, looksAsItsReferences) {
  struct Case {
    const char *name, *profile;
    double time_s;
    bool tissues;
  };
  for (const Case& c :
       {Case{"shoulder", "shoulder-adult", 2.9, true}, Case{"knee", "knee-adult", 2.9, true},
        Case{"lumbar", "lumbar-adult", 3.0, true}, Case{"wrist-closed", "wrist-adult", 2.2, false}}) {
    const SampleLesson lesson = test::sampleLesson(c.profile);
    renderer_->setScene(lesson.scene);
    SceneFrame frame = frameAt(lesson, c.time_s);
    frame.aids.set(pb::Exercise::TISSUES, c.tissues);
    EXPECT_TRUE(test::looksLike(pictureOf(*renderer_, frame),
                                std::string(NEEDLELAB_REFERENCE) + "/scene-" + c.name + ".png"));
  }
}

}  // namespace
}  // namespace needlelab
