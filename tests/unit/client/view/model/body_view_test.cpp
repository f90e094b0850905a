/// A body for display: its scene, meshes, cut and section, against its field.
#include "client/view/model/body_view.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <set>

#include "client/view/model/body/body_section.h"
#include "client/view/model/body/hand_mesh.h"
#include "common/anatomy/field_body.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

const pb::Profile& shoulderProfile() {
  static const pb::Profile profile = *loadProfile(NEEDLELAB_VOLUME);
  return profile;
}
const Pose kTurned{{0.1, -0.2, 0.3}, normalized(Quat{0.2, -0.3, 0.4, 0.8})};
const SceneView& shoulder() {
  static const SceneView scene = *sceneViewOf(shoulderProfile(), kTurned);
  return scene;
}
Vec3 vertexPlace(const MeshVertex& vertex) {
  return {static_cast<double>(vertex.p_m[0]), static_cast<double>(vertex.p_m[1]),
          static_cast<double>(vertex.p_m[2])};
}
Vec3 vertexNormal(const MeshVertex& vertex) {
  return {static_cast<double>(vertex.normal[0]), static_cast<double>(vertex.normal[1]),
          static_cast<double>(vertex.normal[2])};
}

TEST(BodyView, hasTheVolumesStructuresAndItsEntryAtTheOrigin) {
  const SceneView& scene = shoulder();
  ASSERT_EQ(scene.layers.size(), static_cast<std::size_t>(shoulderProfile().volume().structures_size()));
  EXPECT_EQ(scene.layers[3].name, "deltoid");
  EXPECT_LT(norm(scene.focus_W_m - kTurned.p), 2e-3);
  EXPECT_NEAR(depthAt(scene, scene.focus_W_m), 0, 1e-5);
  EXPECT_GT(dot(scene.focus_normal_W, zAxis(kTurned.q)), 0.9) << "the skin faces L's z there";
  EXPECT_LT(norm(scene.targets.front().center_W_m - kTurned * Vec3{-0.002, -0.005, -0.025}), 1e-12);
}

TEST(BodyMeshes, lieOnTheirSurfacesAndKeepTheirBudget) {
  const SceneView& scene = shoulder();
  const Field& field = scene.body->field();
  BodyMeshBudget budget;
  budget.skin = 16'000;
  budget.bones = 12'000;
  const BodyMeshes meshes = bodyMeshesOf(scene, budget);
  EXPECT_NEAR(static_cast<double>(meshes.skin.triangles.size()) / 3, 16'000, 2'000);
  EXPECT_NEAR(static_cast<double>(meshes.bones.triangles.size()) / 3, 12'000, 2'000);
  for (const MeshVertex& vertex : meshes.skin.vertices) {
    ASSERT_NEAR(field.skinDistance(vertexPlace(vertex)), 0, 3e-5);
    ASSERT_LE(norm(vertexNormal(vertex)), 1 + 1e-6);
    ASSERT_GE(norm(vertexNormal(vertex)), 0.149);
  }
  std::set<std::string> named;
  for (const BodyMeshes::Part& part : meshes.parts) {
    named.insert(scene.layers[part.structure].name);
    EXPECT_FALSE(part.mesh.triangles.empty()) << scene.layers[part.structure].name;
  }
  EXPECT_TRUE(named.contains("axillary nerve"));
  EXPECT_TRUE(named.contains("rotator cuff"));
  EXPECT_FALSE(named.contains("deltoid")) << "soft: in the section only";
}

TEST(BodyCut, holdsTheNeedlesLineAndFacesTheEye) {
  const SceneView& scene = shoulder();
  OrbitCamera camera = initialView(scene);
  Moment moment;
  moment.inside = true;
  moment.p_entry_W_m = scene.focus_W_m;
  moment.u_W = normalized(Vec3{} - scene.focus_normal_W + camera.right_W() * 0.3 + camera.front_W * 0.2);
  for (const double azimuth_rad : {-1.0, 0.0, 0.6, 2.5}) {
    camera.azimuth_rad = azimuth_rad;
    const PicturePlane plane = bodyCutOf(scene, camera, &moment, nullptr);
    EXPECT_NEAR(norm(plane.to_viewer_W), 1, 1e-12);
    EXPECT_NEAR(dot(plane.to_viewer_W, moment.u_W), 0, 1e-12);
    // half a needle behind its axis
    for (const double t_m : {0.0, 0.03})
      EXPECT_NEAR(dot(moment.p_entry_W_m + moment.u_W * t_m - plane.place_W_m, plane.to_viewer_W),
                  0.5 * drawnDiameter_m(scene), 1e-12);
    EXPECT_GT(dot(camera.eye_W_m() - plane.place_W_m, plane.to_viewer_W), 0);
  }
}

TEST(BodySection, showsEachNamedStructureInItsColour) {
  const SceneView& scene = shoulder();
  const OrbitCamera camera = initialView(scene);
  const BodySection section =
      bodySectionOf(scene, bodyCutOf(scene, camera, nullptr, nullptr), camera, 16.0 / 9, 700, {});
  const Pose X_LW = inverse(scene.X_WL);
  std::set<std::string> seen;
  for (const BodySection::Name& name : section.names) {
    EXPECT_EQ(scene.body->field().at(X_LW * name.place_W_m).structure, name.structure);
    seen.insert(scene.layers[name.structure].name);
  }
  for (const char* wanted : {"skin", "subcutaneous fat", "deltoid", "rotator cuff", "humerus"})
    EXPECT_TRUE(seen.contains(wanted)) << wanted;
  for (int y = 1; y < section.picture.height; y += 37)
    for (int x = 1; x < section.picture.width; x += 41) {
      const FieldPoint here = scene.body->field().at(X_LW * section.frame_W.at(x + 0.5, y + 0.5));
      if (here.clearance_m < 2e-3) continue;  // the picture covers the skin's edge by a point
      const std::uint8_t* const pixel =
          &section.picture.pixels[4 * static_cast<std::size_t>(y * section.picture.width + x)];
      EXPECT_EQ(pixel[3], here.structure == kOutside ? 0 : 255);
    }
}

TEST(BodySection, isPressedInAtTheNeedlesEntryAsDeepAsTheDimple) {
  const SceneView& scene = shoulder();
  const OrbitCamera camera = initialView(scene);
  Moment moment;
  moment.inside = true;
  moment.p_entry_W_m = scene.focus_W_m;
  moment.u_W = -scene.focus_normal_W;
  const std::optional<Dimple> dimple = dimpleOf(scene, moment);
  ASSERT_TRUE(dimple);
  const PicturePlane plane = bodyCutOf(scene, camera, &moment, nullptr);
  const auto top_m = [&](const std::optional<Dimple>& pressed) {
    const BodySection section = bodySectionOf(scene, plane, camera, 16.0 / 9, 1'400, pressed);
    // the highest row with tissue under the entry
    const SectionFrame& frame = section.frame_W;
    const Vec3 off = scene.focus_W_m - frame.corner_m;
    const int x = static_cast<int>(dot(off, frame.across_m) / normSquared(frame.across_m) * frame.width);
    int y = frame.height - 1;
    while (y > 0 && section.picture.pixels[4 * static_cast<std::size_t>(y * frame.width + x) + 3] == 0) --y;
    return y * norm(frame.upward_m) / frame.height;
  };
  EXPECT_NEAR(top_m({}) - top_m(dimple), dimple->depth_m, 3e-4);
}

TEST(HandMesh, isAClosedHandWhoseFingersTouchTheBarrel) {
  const SyringeMesh syringe = syringeMesh(0.05);
  const Mesh hand = handMesh(syringe);
  double sixfold_m3 = 0, nearest_m = 1;
  Vec3 low{1, 1, 1}, high{-1, -1, -1};
  for (std::size_t i = 0; i < hand.triangles.size(); i += 3)
    sixfold_m3 += dot(vertexPlace(hand.vertices[hand.triangles[i]]),
                      cross(vertexPlace(hand.vertices[hand.triangles[i + 1]]),
                            vertexPlace(hand.vertices[hand.triangles[i + 2]])));
  for (const MeshVertex& vertex : hand.vertices) {
    const Vec3 p = vertexPlace(vertex);
    nearest_m = std::min(nearest_m, std::hypot(p.x, p.y));
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  // an adult's hand has 0.25 to 0.55 l (Hand volumetry; women, men); here with a piece of the forearm
  EXPECT_GT(sixfold_m3 / 6, 0.25e-3);
  EXPECT_LT(sixfold_m3 / 6, 0.9e-3);
  EXPECT_LT(nearest_m, syringe.radius_m + 2e-3);
  EXPECT_GT(nearest_m, syringe.radius_m - 4e-3) << "not through the barrel";
  EXPECT_LT(high.z, syringe.outlet_z_m) << "behind the needle";
}

}  // namespace
}  // namespace needlelab
