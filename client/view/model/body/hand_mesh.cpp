#include "client/view/model/body/hand_mesh.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <utility>

#include "common/anatomy/surface_nets.h"

namespace needlelab {
namespace {

/// Millimetres: x away from the barrel's axis towards the palm, y across, z back from the barrel's front end.
struct Joint {
  double x, y, z, radius;
};

// Finger tips touch a barrel of 6.5 mm; the others' places are those of an adult's hand (finger breadths
// 15 to 20 mm, palm 85 mm broad).
constexpr std::array<Joint, 4> kIndex = {
    {{-3, -13, -13, 7.0}, {11, -18, -27, 8.0}, {39, -3, -46, 9.2}, {66, 9, -82, 11}}};
constexpr std::array<Joint, 4> kMiddle = {
    {{-9, -11, -31, 7.2}, {2, -24, -42, 8.2}, {33, -25, -58, 9.4}, {64, -10, -85, 11.5}}};
constexpr std::array<Joint, 4> kRing = {
    {{11, -31, -41, 7.0}, {11, -42, -52, 7.8}, {37, -43, -64, 8.8}, {66, -28, -88, 11}}};
constexpr std::array<Joint, 4> kLittle = {
    {{24, -46, -47, 6.2}, {24, -57, -58, 6.8}, {43, -59, -70, 7.6}, {69, -44, -92, 9.5}}};
constexpr std::array<Joint, 4> kThumb = {
    {{4, 13.5, -27, 7.8}, {19, 27, -47, 9.0}, {44, 37, -78, 11}, {74, 24, -116, 16}}};
constexpr std::array<Joint, 4> kPalm = {
    {{66, 9, -88, 13}, {68, -14, -88, 13.5}, {73, -38, -95, 12}, {82, -12, -124, 19}}};
constexpr std::array<Joint, 3> kBall = {
    {{60, 30, -98, 12}, {72, 14, -108, 16}, {80, -2, -118, 18}}};  // of the thumb
constexpr std::array<Joint, 3> kWrist = {{{82, -9, -126, 21}, {100, -7, -158, 22}, {126, -5, -198, 26}}};

template <std::size_t N>
void addTube(FieldGroup& group, const std::array<Joint, N>& joints, double front_z_m, double blend_m) {
  TubePart tube;
  for (const Joint& joint : joints)
    tube.points.push_back(
        {Vec3{joint.x, joint.y, joint.z} * 1e-3 + Vec3{0, 0, front_z_m}, joint.radius * 1e-3});
  group.parts.push_back({std::move(tube), blend_m});
}

}  // namespace

Mesh handMesh(const SyringeMesh& syringe) {
  const double front_z_m = syringe.outlet_z_m;
  FieldSpec spec;
  FieldGroup group{"hand", {}};
  constexpr double kSoft_m = 12e-3, kFinger_m = 5e-3;
  addTube(group, kPalm, front_z_m, 0);
  addTube(group, kWrist, front_z_m, kSoft_m);
  addTube(group, kBall, front_z_m, 1.2 * kSoft_m);
  addTube(group, kThumb, front_z_m, 1.2 * kSoft_m);
  for (const auto* finger : {&kIndex, &kMiddle, &kRing, &kLittle})
    addTube(group, *finger, front_z_m, kFinger_m);
  spec.groups.push_back(std::move(group));
  spec.structures.push_back({"hand", "hand", {}});
  spec.skin = "hand";
  spec.rest = "hand";
  const Result<Field> field = Field::make(spec);
  assert(field.ok());
  if (!field.ok()) return {};
  const SurfaceMesh surface = surfaceNet(*field, kWholeBody, {.cell_m = 2.6e-3});
  Mesh mesh;
  for (const SurfaceMesh::Vertex& vertex : surface.vertices) {
    double open = 1;
    for (const double step_m : {4e-3, 10e-3, 20e-3}) {
      const double free = field->structuresDistance(kWholeBody, vertex.p_m + vertex.normal * step_m) / step_m;
      open -= 0.2 * (1 - std::clamp(free, 0.0, 1.0));
    }
    addVertex(mesh, vertex.p_m, vertex.normal * std::max(open, 0.6));
  }
  for (const auto& [a, b, c] : surface.triangles) addTriangle(mesh, a, b, c);
  return mesh;
}

}  // namespace needlelab
