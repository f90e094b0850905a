#include "client/view/model/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "common/profile/profile.h"
#include "tests/support/random.h"
#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

constexpr double kWidth = 800, kHeight = 600;

OrbitCamera someCamera(test::Random& draw) {
  OrbitCamera camera;
  camera.focus_W_m = {draw.in(-1, 1), draw.in(-1, 1), draw.in(-1, 1)};
  camera.azimuth_rad = draw.in(-3, 3);
  camera.elevation_rad = draw.in(-1.4, 1.4);
  camera.distance_m = draw.in(0.05, 1);
  return camera;
}

// as in OpenGL: clip coordinates, division, then the viewport
PicturePoint byMatrices(const OrbitCamera& camera, Vec3 p) {
  const Matrix4 view = camera.view(), projection = camera.projection(kWidth, kHeight);
  const auto apply = [](const Matrix4& m, const std::array<double, 4>& v) {
    std::array<double, 4> out{};
    for (std::size_t row = 0; row < 4; ++row)
      for (std::size_t k = 0; k < 4; ++k) out[row] += static_cast<double>(m[4 * k + row]) * v[k];
    return out;
  };
  const auto clip = apply(projection, apply(view, {p.x, p.y, p.z, 1}));
  return {(clip[0] / clip[3] + 1) / 2 * kWidth, (1 - clip[1] / clip[3]) / 2 * kHeight,
          (clip[2] / clip[3] + 1) / 2};
}

TEST(InsertionPlane, isUprightThroughTheFocusAndFacesTheEye) {
  test::Random draw(4);
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  const SceneView& scene = *lesson.scene;
  for (int i = 0; i < 50; ++i) {
    OrbitCamera camera = initialView(scene);
    camera.azimuth_rad = draw.in(-3, 3);
    camera.elevation_rad = draw.in(-1.4, 1.4);
    const PicturePlane plane = insertionPlaneOf(scene, camera);
    EXPECT_EQ(plane.place_W_m, scene.focus_W_m);
    EXPECT_NEAR(norm(plane.to_viewer_W), 1, 1e-12);
    EXPECT_NEAR(dot(plane.to_viewer_W, scene.focus_normal_W), 0, 1e-12);
    EXPECT_GT(dot(plane.to_viewer_W, camera.eye_W_m() - scene.focus_W_m), 0);
  }
}

TEST(Camera, projectsAsTheMatricesThatOpenGlGets) {
  test::Random draw(1);
  for (int i = 0; i < 200; ++i) {
    const OrbitCamera camera = someCamera(draw);
    const Vec3 p = camera.focus_W_m +
                   Vec3{draw.in(-0.3, 0.3), draw.in(-0.3, 0.3), draw.in(-0.3, 0.3)} * camera.distance_m;
    const auto point = camera.project(p, kWidth, kHeight);
    ASSERT_TRUE(point);
    const PicturePoint expected = byMatrices(camera, p);
    EXPECT_NEAR(point->x_px, expected.x_px, 0.05);
    EXPECT_NEAR(point->y_px, expected.y_px, 0.05);
    EXPECT_NEAR(point->depth, expected.depth, 1e-4);
  }
}

TEST(Camera, theFocusIsCentredAndPointsBehindTheEyeAreHidden) {
  test::Random draw(2);
  for (int i = 0; i < 50; ++i) {
    const OrbitCamera camera = someCamera(draw);
    const auto middle = camera.project(camera.focus_W_m, kWidth, kHeight);
    ASSERT_TRUE(middle);
    EXPECT_NEAR(middle->x_px, kWidth / 2, 1e-6);
    EXPECT_NEAR(middle->y_px, kHeight / 2, 1e-6);
    const Vec3 back = camera.eye_W_m() + (camera.eye_W_m() - camera.focus_W_m);
    EXPECT_FALSE(camera.project(back, kWidth, kHeight));
    EXPECT_NEAR(norm(camera.eye_W_m() - camera.focus_W_m), camera.distance_m, 1e-12);
  }
}

TEST(Camera, aRayThroughAPixelMeetsThePointThatIsThere) {
  test::Random draw(3);
  for (int i = 0; i < 100; ++i) {
    const OrbitCamera camera = someCamera(draw);
    const Vec3 p = camera.focus_W_m +
                   Vec3{draw.in(-0.3, 0.3), draw.in(-0.3, 0.3), draw.in(-0.3, 0.3)} * camera.distance_m;
    const auto point = camera.project(p, kWidth, kHeight);
    ASSERT_TRUE(point);
    const Vec3 ray = camera.ray_W(point->x_px, point->y_px, kWidth, kHeight);
    EXPECT_NEAR(norm(cross(ray, normalized(p - camera.eye_W_m()))), 0, 1e-9);
  }
}

TEST(Camera, upStaysUpInThePicture) {
  test::Random draw(4);
  for (int i = 0; i < 50; ++i) {
    const OrbitCamera camera = someCamera(draw);
    const auto low = camera.project(camera.focus_W_m, kWidth, kHeight);
    const auto high =
        camera.project(camera.focus_W_m + camera.up_W * (0.1 * camera.distance_m), kWidth, kHeight);
    ASSERT_TRUE(low && high);
    EXPECT_LT(high->y_px, low->y_px);
    EXPECT_NEAR(high->x_px, low->x_px, 1e-6);
  }
}

TEST(Camera, aDragTurnsTheSceneWithThePointerAndHoldsItsElevation) {
  OrbitCamera camera;
  // A point nearer than the focus moves with the pointer, to the right and down.
  const Vec3 front = camera.focus_W_m + (camera.eye_W_m() - camera.focus_W_m) * 0.3;
  const auto before = camera.project(front, kWidth, kHeight);
  camera.orbit(30, 20, kHeight);
  const auto after = camera.project(front, kWidth, kHeight);
  ASSERT_TRUE(before && after);
  EXPECT_GT(after->x_px, before->x_px + 1);
  EXPECT_GT(after->y_px, before->y_px + 1);
  camera.orbit(0, 1e6, kHeight);
  EXPECT_NEAR(camera.elevation_rad, 85 * std::numbers::pi / 180, 1e-12);
  camera.zoom(1e3);
  EXPECT_DOUBLE_EQ(camera.distance_m, 0.02);
  camera.zoom(-1e3);
  EXPECT_DOUBLE_EQ(camera.distance_m, 2);
}

TEST(Camera, aShiftKeepsThePointUnderThePointer) {
  OrbitCamera camera;
  const auto before = camera.project(camera.focus_W_m, kWidth, kHeight);
  const Vec3 held = camera.focus_W_m;
  camera.pan(40, -25, kHeight);
  const auto after = camera.project(held, kWidth, kHeight);
  ASSERT_TRUE(before && after);
  EXPECT_NEAR(after->x_px - before->x_px, 40, 1e-6);
  EXPECT_NEAR(after->y_px - before->y_px, -25, 1e-6);
}

TEST(Camera, aSegmentIsClippedToThePictureAndTheNearPlane) {
  OrbitCamera camera;  // looks from x = 0.3 at the origin, z up
  camera.distance_m = 0.3;
  const double px_per_m = kHeight / 2 / std::tan(camera.field_of_view_rad / 2) / camera.distance_m;
  const auto clipped = [&](Vec3 a, Vec3 b) { return camera.projectSegment(a, b, kWidth, kHeight); };
  // across the focus, within the picture: unchanged ends
  const Vec3 right = camera.right_W();
  const auto inner = clipped(right * -0.01, right * 0.02);
  ASSERT_TRUE(inner);
  EXPECT_NEAR(inner->from.x_px, kWidth / 2.0 - 0.01 * px_per_m, 1e-6);
  EXPECT_NEAR(inner->to.x_px, kWidth / 2.0 + 0.02 * px_per_m, 1e-6);
  EXPECT_NEAR(inner->to.y_px, kHeight / 2.0, 1e-6);
  // far beyond both sides: from edge to edge, in the same direction
  const auto across = clipped(right * 5, right * -5);
  ASSERT_TRUE(across);
  EXPECT_NEAR(across->from.x_px, kWidth, 1e-6);
  EXPECT_NEAR(across->to.x_px, 0, 1e-6);
  // upwards from the focus to above the picture: up to its upper edge
  const auto up = clipped({0, 0, 0}, {0, 0, 1});
  ASSERT_TRUE(up);
  EXPECT_NEAR(up->to.y_px, 0, 1e-6);
  EXPECT_NEAR(up->from.y_px, kHeight / 2.0, 1e-6);
  // from 10 cm behind the eye to a point in the picture: the part beyond the near plane, on the same line
  const Vec3 eye = camera.eye_W_m(), behind = eye + normalized(eye) * 0.1, seen = right * 0.01;
  const auto from_behind = clipped(behind, seen);
  ASSERT_TRUE(from_behind);
  EXPECT_NEAR(from_behind->to.x_px, kWidth / 2.0 + 0.01 * px_per_m, 1e-6);
  EXPECT_NEAR(from_behind->from.y_px, kHeight / 2.0, 1e-6);
  EXPECT_GE(from_behind->from.depth, 0);
  // invisible: beside the picture, across one of its corners, and behind the eye
  EXPECT_FALSE(clipped(right * 5, right * 6));
  const double half_width_m = kWidth / 2.0 / px_per_m, half_height_m = kHeight / 2.0 / px_per_m;
  EXPECT_FALSE(clipped(right * (3 * half_width_m), camera.upward_W() * (3 * half_height_m)));
  EXPECT_FALSE(clipped(behind, behind + right * 0.01));
}

TEST(FirstLook, holdsTargetEntryAndNeedleOfEverySampleScene) {
  for (const char* name :
       {"shoulder-adult", "knee-adult", "lumbar-adult", "wrist-adult", "finger-adult", "paper-clamping"}) {
    const test::SampleLesson lesson = test::sampleLesson(name);
    const OrbitCamera camera = initialView(*lesson.scene);
    const Vec3 out = lesson.scene->focus_normal_W;
    for (const Vec3 p : {lesson.scene->targets.front().center_W_m, lesson.scene->focus_W_m,
                         lesson.scene->focus_W_m + out * (0.8 * lesson.scene->needle.length_m)}) {
      const auto point = camera.project(p, 780, 700);
      ASSERT_TRUE(point) << name;
      EXPECT_TRUE(point->x_px > 0 && point->x_px < 780 && point->y_px > 0 && point->y_px < 700) << name;
    }
  }
}

TEST(Looks, fromAboveAndFromTheSideSeeTheSameFocus) {
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  const OrbitCamera above = viewFromAbove(*lesson.scene), side = viewFromSide(*lesson.scene);
  EXPECT_GT(dot(normalized(above.eye_W_m() - above.focus_W_m), lesson.scene->focus_normal_W), 0.98);
  EXPECT_NEAR(dot(side.eye_W_m() - side.focus_W_m, lesson.scene->focus_normal_W), 0, 1e-9);
}

TEST(Looks, theWholeOfATrunkIsUprightAndALimbLies) {
  const Pose turned{{0.1, -0.2, 0.3}, normalized(Quat{0.2, -0.3, 0.4, 0.8})};
  const auto sceneOf = [&](const char* name) {
    const auto profile = loadProfile(std::string(NEEDLELAB_SAMPLES) + "/volumes/" + name + ".json");
    return sceneViewOf(profile.value(), turned).value();
  };
  struct Trunk {
    const char* name;
    Vec3 head_L_m, low_L_m, face_L_m;  // middle of the head; hip or elbow; where the eye is, roughly
  };
  for (const Trunk& one : {Trunk{"shoulder-median", {0.014, 0.23, -0.21}, {0.03, -0.3, -0.04}, {0.5, 0, 1}},
                           Trunk{"lumbar-median", {-0.605, 0, -0.11}, {0.4, 0.08, -0.1}, {0, 0, 1}}}) {
    const SceneView scene = sceneOf(one.name);
    const OrbitCamera camera = viewOfWhole(scene);
    const auto head = camera.project(turned * one.head_L_m, kWidth, kHeight),
               low = camera.project(turned * one.low_L_m, kWidth, kHeight);
    ASSERT_TRUE(head && low) << one.name;
    EXPECT_GT(low->y_px - head->y_px, 3 * std::fabs(low->x_px - head->x_px)) << one.name;
    EXPECT_TRUE(head->y_px > 0 && low->y_px < kHeight) << one.name;
    const Vec3 to_eye_W = normalized(camera.eye_W_m() - camera.focus_W_m);
    EXPECT_GT(dot(to_eye_W, normalized(rotate(turned.q, one.face_L_m))), 0.7) << one.name;
  }
  for (const char* name : {"knee-median", "wrist-median"}) {
    const SceneView scene = sceneOf(name);
    EXPECT_EQ(viewOfWhole(scene).up_W, scene.focus_normal_W) << name;
  }
}

}  // namespace
}  // namespace needlelab
