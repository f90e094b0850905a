#include "client/view/model/mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

Vec3 placeOf(const MeshVertex& v) {
  return {static_cast<double>(v.p_m[0]), static_cast<double>(v.p_m[1]), static_cast<double>(v.p_m[2])};
}
Vec3 normalOf(const MeshVertex& v) {
  return {static_cast<double>(v.normal[0]), static_cast<double>(v.normal[1]),
          static_cast<double>(v.normal[2])};
}

// Gauss: positive when the triangles run counter-clockwise from outside
double volumeOf(const Mesh& mesh) {
  double volume = 0;
  for (std::size_t i = 0; i + 2 < mesh.triangles.size(); i += 3) {
    const Vec3 a = placeOf(mesh.vertices[mesh.triangles[i]]),
               b = placeOf(mesh.vertices[mesh.triangles[i + 1]]),
               c = placeOf(mesh.vertices[mesh.triangles[i + 2]]);
    volume += dot(a, cross(b, c)) / 6;
  }
  return volume;
}

void expectSound(const Mesh& mesh, const char* what) {
  ASSERT_FALSE(mesh.triangles.empty()) << what;
  ASSERT_EQ(mesh.triangles.size() % 3, 0u) << what;
  for (const std::uint32_t index : mesh.triangles) ASSERT_LT(index, mesh.vertices.size()) << what;
  for (const MeshVertex& vertex : mesh.vertices) {
    ASSERT_TRUE(isFinite(placeOf(vertex))) << what;
    ASSERT_NEAR(norm(normalOf(vertex)), 1, 1e-4) << what;
  }
  // normals point to the side from which a triangle runs counter-clockwise
  for (std::size_t i = 0; i + 2 < mesh.triangles.size(); i += 3) {
    const MeshVertex &a = mesh.vertices[mesh.triangles[i]], &b = mesh.vertices[mesh.triangles[i + 1]],
                     &c = mesh.vertices[mesh.triangles[i + 2]];
    const Vec3 out = cross(placeOf(b) - placeOf(a), placeOf(c) - placeOf(a));
    const Vec3 normal = normalOf(a) + normalOf(b) + normalOf(c);
    if (norm(out) > 1e-12) {
      ASSERT_GT(dot(normalized(out), normal), 0) << what << ", triangle " << i / 3;
    }
  }
}

TEST(Mesh, hasTheVolumeOfItsShape) {
  const double ball = 4.0 / 3.0 * std::numbers::pi;
  expectSound(ballMesh(0.02, 24), "ball");
  EXPECT_NEAR(volumeOf(ballMesh(0.02, 24)) / (ball * 8e-6), 1, 0.02);
  const Vec3 a{0.01, -0.02, 0.03}, b{0.05, 0.01, -0.02};
  const double length_m = norm(b - a), disc = std::numbers::pi * 1e-4;
  expectSound(tubeMesh(a, b, 0.01, 12, 48), "tube");
  EXPECT_NEAR(volumeOf(tubeMesh(a, b, 0.01, 12, 48)) / (disc * length_m + ball * 1e-6), 1, 0.02);
  expectSound(coneMesh(a, b, 0.01, 0, 48), "cone");
  EXPECT_NEAR(volumeOf(coneMesh(a, b, 0.01, 0, 48)) / (disc * length_m / 3), 1, 0.02);
  expectSound(tubeMesh(a, a, 0.01), "a tube without length is a ball");
  EXPECT_NEAR(volumeOf(tubeMesh(a, a, 0.01, 12, 48)) / (ball * 1e-6), 1, 0.03);
  expectSound(arrowMesh(), "arrow");
  EXPECT_TRUE(coneMesh(a, a, 0.01, 0).triangles.empty());
}

TEST(LayerSurface, liesAtItsDepthForEveryShapeOfLimb) {
  for (const char* name : {"shoulder-adult", "knee-adult", "lumbar-adult", "finger-adult", "deltoid-adult"}) {
    const test::SampleLesson lesson = test::sampleLesson(name);
    for (const double depth_m : {0.0, 0.002, lesson.scene->layers[1].bottom_m}) {
      const Mesh mesh = layerSurface(*lesson.scene, depth_m);
      expectSound(mesh, name);
      for (const MeshVertex& vertex : mesh.vertices) {
        ASSERT_NEAR(depthAt(*lesson.scene, placeOf(vertex)), depth_m, 1e-6) << name;
        // out of the tissue: a step along the normal is less deep
        ASSERT_LT(depthAt(*lesson.scene, placeOf(vertex) + normalOf(vertex) * 1e-4), depth_m) << name;
      }
    }
  }
  const test::SampleLesson ball = test::sampleLesson("phantom-ball");
  EXPECT_TRUE(layerSurface(*ball.scene, 0.03).triangles.empty());
}

TEST(NeedleMesh, isAsLongAsTheNeedleAndEndsAtItsTip) {
  for (const NeedleTip tip :
       {NeedleTip::kUnknown, NeedleTip::kHypodermic, NeedleTip::kTuohy, NeedleTip::kPencilPoint}) {
    const NeedleSpec needle{0.05, 0.0008, tip, 0};
    const Mesh mesh = needleMesh(needle, 0.0008);
    expectSound(mesh, "needle");
    double least = 1, greatest = -1, widest = 0;
    for (const MeshVertex& vertex : mesh.vertices) {
      const Vec3 p = placeOf(vertex);
      least = std::min(least, p.z);
      greatest = std::max(greatest, p.z);
      widest = std::max(widest, std::hypot(p.x, p.y));
    }
    EXPECT_NEAR(least, -0.05, 1e-7);
    EXPECT_NEAR(greatest, 0, 1e-7);
    EXPECT_NEAR(widest, 0.0004, 1e-7);
  }
}

TEST(SyringeMesh, liesBehindItsNeedleWithThePlungerInTheBarrel) {
  for (const double length_m : {0.016, 0.05, 0.09}) {
    const SyringeMesh syringe = syringeMesh(length_m);
    expectSound(syringe.hub, "hub");
    expectSound(syringe.barrel, "barrel");
    expectSound(syringe.plunger, "plunger");
    for (const Mesh* mesh : {&syringe.hub, &syringe.barrel, &syringe.plunger})
      for (const MeshVertex& vertex : mesh->vertices) {
        EXPECT_LE(placeOf(vertex).z, -length_m + 1e-7);
        EXPECT_GE(placeOf(vertex).z, syringe.end_z_m - 1e-7);
      }
    EXPECT_DOUBLE_EQ(plungerShift_m(syringe, 0), 0);
    EXPECT_LT(plungerShift_m(syringe, 0.4), plungerShift_m(syringe, 0.6));
    EXPECT_DOUBLE_EQ(plungerShift_m(syringe, 7), syringe.stroke_m);
    EXPECT_DOUBLE_EQ(plungerShift_m(syringe, std::nan("")), 0);
    EXPECT_LE(syringe.stopper_z_m + syringe.stroke_m, syringe.outlet_z_m + 0.002);
  }
}

TEST(Moved, takesPlacesAndNormalsAlong) {
  const Pose X{{1, 2, 3}, normalized(Quat{0.3, -0.2, 0.5, 0.8})};
  const Mesh before = ballMesh(0.5, 6), after = moved(before, X);
  for (std::size_t i = 0; i < before.vertices.size(); ++i) {
    EXPECT_NEAR(norm(placeOf(after.vertices[i]) - X * placeOf(before.vertices[i])), 0, 1e-5);
    EXPECT_NEAR(norm(normalOf(after.vertices[i]) - rotate(X.q, normalOf(before.vertices[i]))), 0, 1e-5);
  }
}

}  // namespace
}  // namespace needlelab
