#include "client/view/model/ultrasound_slice.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

Moment needleAt(const SceneView& scene, double depth_m, double slant_rad = 0.4) {
  Moment moment;
  const Vec3 in = -scene.focus_normal_W;
  const Vec3 side = normalized(cross(in, {1, 0, 0}));
  moment.u_W = normalized(in * std::cos(slant_rad) + side * std::sin(slant_rad));
  moment.inside = true;
  moment.p_entry_W_m = scene.focus_W_m;
  moment.p_WT_m = scene.focus_W_m + moment.u_W * depth_m;
  const Vec3 z = moment.u_W;
  moment.q_WT = 1 + z.z > 1e-9 ? normalized(Quat{-z.y, z.x, 0, 1 + z.z}) : Quat{1, 0, 0, 0};
  return moment;
}

double meanAround(const GreyImage& image, double x, double y, int half) {
  double sum = 0;
  int count = 0;
  for (int dy = -half; dy <= half; ++dy)
    for (int dx = -half; dx <= half; ++dx) {
      const int px = static_cast<int>(x) + dx, py = static_cast<int>(y) + dy;
      if (px < 0 || py < 0 || px >= image.width || py >= image.height) continue;
      sum += image.pixels[static_cast<std::size_t>(py * image.width + px)];
      ++count;
    }
  return sum / count;
}

struct Slice {
  GreyImage image;
  SlicePlane plane;
  double m_per_px = 0;
  [[nodiscard]] double x(Vec3 p) const {
    return dot(p - plane.origin_W_m, plane.right_W) / m_per_px + image.width * 0.5;
  }
  [[nodiscard]] double y(Vec3 p) const { return dot(p - plane.origin_W_m, plane.down_W) / m_per_px; }
};

Slice sliceOf(const SceneView& scene, const Moment& moment, const SliceSettings& settings = {}) {
  Slice slice;
  slice.plane = slicePlaneOf(scene, moment);
  drawSlice(scene, slice.plane, moment, settings, slice.image);
  slice.m_per_px = sliceDepth_m(scene, settings) / slice.image.height;
  return slice;
}

TEST(UltrasoundSlice, sameInSameOut) {
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  const Moment moment = needleAt(*lesson.scene, 0.02);
  EXPECT_EQ(sliceOf(*lesson.scene, moment).image.pixels, sliceOf(*lesson.scene, moment).image.pixels);
}

TEST(UltrasoundSlice, theNeedleIsBrightAlongItsShaftAndEndsAtItsTip) {
  const test::SampleLesson lesson = test::sampleLesson("hip-adult");
  const Moment moment = needleAt(*lesson.scene, 0.035);
  const Slice slice = sliceOf(*lesson.scene, moment);
  for (const double share : {0.3, 0.6, 0.95}) {
    const Vec3 p = moment.p_entry_W_m + moment.u_W * (0.035 * share);
    EXPECT_GT(meanAround(slice.image, slice.x(p), slice.y(p), 0), 140) << share;
    EXPECT_GT(meanAround(slice.image, slice.x(p), slice.y(p), 0),
              1.6 * meanAround(slice.image, slice.x(p) + 12, slice.y(p) - 4, 2))
        << share;
  }
  const Vec3 beyond = moment.p_entry_W_m + moment.u_W * 0.038;
  EXPECT_LT(meanAround(slice.image, slice.x(beyond), slice.y(beyond), 1), 150);
}

TEST(UltrasoundSlice, belowBoneItIsDark) {
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  const SceneView& scene = *lesson.scene;
  SliceSettings settings;
  settings.depth_m = 0.055;
  const Slice slice = sliceOf(scene, needleAt(scene, 0.005), settings);
  const double bone_m = scene.layers.back().top_m;
  const Vec3 down = -scene.focus_normal_W;
  const Vec3 top = scene.focus_W_m + down * bone_m, below = scene.focus_W_m + down * (bone_m + 0.008);
  const Vec3 muscle = scene.focus_W_m + down * 0.018;
  EXPECT_GT(meanAround(slice.image, slice.x(top) + 20, slice.y(top) + 2, 2), 70);
  EXPECT_LT(meanAround(slice.image, slice.x(below) + 20, slice.y(below), 3), 12);
  EXPECT_GT(meanAround(slice.image, slice.x(muscle) + 20, slice.y(muscle), 4), 40);
}

TEST(UltrasoundSlice, tissuesDifferAndHaveSpeckle) {
  const test::SampleLesson lesson = test::sampleLesson("lumbar-adult");
  const SceneView& scene = *lesson.scene;
  const Slice slice = sliceOf(scene, needleAt(scene, 0.002));
  const auto at = [&](double depth_m) {
    const Vec3 p = scene.focus_W_m - scene.focus_normal_W * depth_m + slice.plane.right_W * 0.02;
    return meanAround(slice.image, slice.x(p), slice.y(p), 4);
  };
  EXPECT_GT(at(0.03), 1.5 * at(0.012));  // ligament reflects more than fat
  // Within one tissue the pixels vary, and not only by rows or columns.
  double sum = 0, squares = 0;
  int count = 0;
  for (int y = 120; y < 160; ++y)
    for (int x = 200; x < 240; ++x) {
      const double v = slice.image.pixels[static_cast<std::size_t>(y * slice.image.width + x)];
      sum += v;
      squares += v * v;
      ++count;
    }
  const double mean = sum / count, deviation = std::sqrt(squares / count - mean * mean);
  EXPECT_GT(deviation / mean, 0.08);
}

TEST(UltrasoundSlice, thePlaneHoldsTheNeedleAndDoesNotFlip) {
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  const SceneView& scene = *lesson.scene;
  SlicePlane before;
  bool any = false;
  int pictures_inside = 0;
  GestureReplica replica(lesson.model);
  for (const GestureSample& sample : lesson.samples) {
    const Moment& now = replica.feed(sample);
    if (sample.tick % 66 != 0) continue;
    const SlicePlane plane = slicePlaneOf(scene, now, any ? &before : nullptr);
    ASSERT_NEAR(norm(plane.right_W), 1, 1e-9);
    ASSERT_NEAR(norm(plane.down_W), 1, 1e-9);
    ASSERT_NEAR(dot(plane.right_W, plane.down_W), 0, 1e-9);
    pictures_inside = now.inside ? pictures_inside + 1 : 0;
    if (any) {
      ASSERT_GT(dot(plane.right_W, before.right_W), std::cos(0.25)) << sample.tick;
    }
    // Within a quarter turn it has found the needle: the tip lies in the plane within the visible thickness.
    if (pictures_inside > 8) {
      const Vec3 out = cross(plane.right_W, plane.down_W);
      ASSERT_LT(std::fabs(dot(now.p_WT_m - plane.origin_W_m, out)), 0.0015) << sample.tick;
    }
    before = plane;
    any = true;
  }
}

TEST(UltrasoundSlice, anySettingsAreHeldToWhatCanBeDrawn) {
  const test::SampleLesson lesson = test::sampleLesson("finger-adult");
  SliceSettings settings;
  settings.width = -5;
  settings.height = 100000;
  settings.depth_m = 1e9;
  const Slice slice = sliceOf(*lesson.scene, needleAt(*lesson.scene, 0.004), settings);
  EXPECT_EQ(slice.image.width, 16);
  EXPECT_EQ(slice.image.height, 1024);
  EXPECT_EQ(slice.image.pixels.size(), 16u * 1024u);
}

TEST(UltrasoundSlice, aBloodVesselIsBlackWithABrightWall) {
  const test::SampleLesson lesson = test::sampleLesson("hip-adult");
  const SceneView& scene = *lesson.scene;
  // a plane across the femoral artery
  const HazardView* artery = nullptr;
  for (const HazardView& hazard : scene.hazards)
    if (hazard.name == "femoral artery") artery = &hazard;
  ASSERT_NE(artery, nullptr);
  const Vec3 middle = (artery->a_W_m + artery->b_W_m) * 0.5;
  Slice slice;
  slice.plane.down_W = -scene.focus_normal_W;
  slice.plane.right_W = normalized(cross(slice.plane.down_W, artery->b_W_m - artery->a_W_m));
  slice.plane.origin_W_m = middle + scene.focus_normal_W * depthAt(scene, middle);
  Moment away;
  away.p_WT_m = scene.focus_W_m + scene.focus_normal_W * 0.2;
  away.q_WT = {1, 0, 0, 0};
  drawSlice(scene, slice.plane, away, {}, slice.image);
  slice.m_per_px = sliceDepth_m(scene, {}) / slice.image.height;
  const double inside = meanAround(slice.image, slice.x(middle), slice.y(middle), 2);
  const Vec3 wall = middle + scene.focus_normal_W * artery->radius_m;
  EXPECT_LT(inside, 20);
  EXPECT_GT(meanAround(slice.image, slice.x(wall), slice.y(wall), 1), 3 * inside);
}

}  // namespace
}  // namespace needlelab
