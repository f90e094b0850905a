#include "client/view/model/body_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/anatomy/field_body.h"
#include "common/anatomy/surface_nets.h"
#include "common/haptics/surface.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/volume.h"

namespace needlelab {
namespace {

constexpr double kAtOrigin_m = 2e-3;  // a skin this near to L's origin is the entry that the author meant
constexpr double kLeastExtent_m = 0.04, kWholeExtent_m = 0.065;  // enough of the body to recognise it
constexpr double kCoarse_m = 4e-3;                               // the cell of a first mesh, for its area
constexpr double kSheetCells = 0.55, kTubeCells = 0.7;           // candidateOf
constexpr double kThinnest_m = 2e-3, kMostGrown_m = 0.5e-3;
constexpr double kFirstCell_m = 1.2e-3, kPiece_m = 0.04;  // of a structure: half of its first mesh's box
constexpr double kMinCell_m = 0.6e-3, kMaxPartCell_m = 2.2e-3, kMaxCell_m = 4.5e-3;
constexpr double kFarCoarse_m = 20e-3, kMinFarCell_m = 2.5e-3, kMaxFarCell_m = 9e-3;

/// Half of the way through the body, straight in from the skin at the focus: half a limb's breadth.
double halfBreadth_m(const SceneView& view) {
  double in_m = kAtOrigin_m;
  for (double depth_m = in_m; depth_m > 0 && in_m < 2 * kWholeExtent_m; in_m += std::max(depth_m, 1e-3))
    depth_m = depthAt(view, view.focus_W_m - view.focus_normal_W * in_m);
  return 0.5 * in_m;
}

Vec3 outwardAt(const SceneView& scene, Vec3 p_W_m) {
  return surfaceNormal(scene.limb_W, p_W_m, -zAxis(scene.X_WL.q));
}

FieldBox boxNearFocus(const SceneView& scene) {
  const Vec3 focus_L_m = inverse(scene.X_WL) * scene.focus_W_m;
  const double reach_m = bodyReach_m(scene);
  const Vec3 half{reach_m, reach_m, reach_m};
  return {focus_L_m - half, focus_L_m + half};
}

Mesh meshOf(const SurfaceMesh& surface) {
  Mesh mesh;
  mesh.vertices.reserve(surface.vertices.size());
  mesh.triangles.reserve(3 * surface.triangles.size());
  for (const SurfaceMesh::Vertex& vertex : surface.vertices) addVertex(mesh, vertex.p_m, vertex.normal);
  for (const auto& [a, b, c] : surface.triangles) addTriangle(mesh, a, b, c);
  return mesh;
}

/// Shortens the normals where the same surface is near: distances a few steps out along the normal, compared
/// with the way there.
void darkenHollows(Mesh& mesh, const Field& field, StructureMask mask) {
  constexpr std::array<double, 3> kSteps_m = {2e-3, 6e-3, 14e-3};
  constexpr double kShared_m = 12e-3;  // vertices this near to one share its ball of parts
  Field::InBall near;
  std::optional<Vec3> middle_m;
  for (MeshVertex& vertex : mesh.vertices) {
    const Vec3 p_m{static_cast<double>(vertex.p_m[0]), static_cast<double>(vertex.p_m[1]),
                   static_cast<double>(vertex.p_m[2])};
    const Vec3 out{static_cast<double>(vertex.normal[0]), static_cast<double>(vertex.normal[1]),
                   static_cast<double>(vertex.normal[2])};
    if (!middle_m || normSquared(p_m - *middle_m) > kShared_m * kShared_m) {
      // what lies beyond may be nearest to the last step's place
      near = field.inBall(p_m, kShared_m + 2 * kSteps_m.back(), mask);
      middle_m = p_m;
    }
    double open = 1;
    for (const double step_m : kSteps_m) {
      const double free = near.structuresDistance(mask, p_m + out * step_m) / step_m;
      open -= 0.3 * (1 - std::clamp(free, 0.0, 1.0));
    }
    const auto length = static_cast<float>(std::clamp(open, 0.15, 1.0));
    for (float& part : vertex.normal) part *= length;
  }
}

double areaOf(const Field& field, StructureMask mask, const FieldBox& within) {
  const double cell_m = mask == kWholeBody ? kFarCoarse_m : kCoarse_m;
  return areaOf(surfaceNet(field, mask, {.cell_m = cell_m, .rough = true, .within = within}));
}

/// A structure that may have a surface of its own, and what that takes.
struct Candidate {
  StructureIndex structure = kOutside;
  double cell_m = 0, grown_m = 0, triangles = 0;
};

/// Twice the volume over the area is a sheet's thickness, or a tube's radius; a cell is this share of it. A
/// thinner one is thickened.
Candidate candidateOf(const Field& field, StructureIndex structure, const FieldBox& within, double share,
                      double thinnest_m) {
  const StructureMask mask = maskOf(structure);
  const FieldBox whole = common(field.boxAround(mask), within);
  // a piece in the middle tells how thick it is, and by its length how much there is of it
  const Vec3 size_m = whole.high_m - whole.low_m, middle_m = (whole.low_m + whole.high_m) * 0.5;
  const double long_m = std::max({size_m.x, size_m.y, size_m.z}), half_m = std::min(kPiece_m, 0.5 * long_m);
  const FieldBox piece =
      common(whole, {middle_m - Vec3{half_m, half_m, half_m}, middle_m + Vec3{half_m, half_m, half_m}});
  double pieces = 0.5 * long_m / half_m;
  SurfaceMesh coarse = surfaceNet(field, mask, {.cell_m = kFirstCell_m, .rough = true, .within = piece});
  if (coarse.triangles.empty()) {
    coarse = surfaceNet(field, mask, {.cell_m = kFirstCell_m, .rough = true, .within = whole});
    pieces = 1;
  }
  // Gauss, without the direction along which the piece is cut: its open ends add nothing
  double twice_m3 = 0;
  for (const auto& [a, b, c] : coarse.triangles) {
    const Vec3 p = coarse.vertices[a].p_m, q = coarse.vertices[b].p_m, r = coarse.vertices[c].p_m;
    const Vec3 at = (p + q + r) / 3 - middle_m;
    twice_m3 += 0.5 * dot(cross(q - p, r - p), {size_m.x < long_m ? at.x : 0, size_m.y < long_m ? at.y : 0,
                                                size_m.z < long_m ? at.z : 0});
  }
  const double area_m2 = areaOf(coarse);
  const double thick_m = area_m2 > 0 ? std::fabs(twice_m3) / area_m2 : 0;
  Candidate one;
  one.structure = structure;
  one.grown_m = std::clamp(0.5 * (thinnest_m - thick_m), 0.0, kMostGrown_m);
  one.cell_m = std::clamp(share * (thick_m + 2 * one.grown_m), kMinCell_m, kMaxPartCell_m);
  one.triangles = 3 * pieces * area_m2 / (one.cell_m * one.cell_m);
  return one;
}

/// Draws the sharp rim of a sheet as a line: a net's vertices there lie on either side of it by turns, up to
/// a cell apart. Moves each to the mean of its neighbours on the rim, by at most some tenths of a millimetre.
void smoothRims(SurfaceMesh& mesh) {
  constexpr double kSharp = 0.6;  // cosine between the normals at both ends of an edge
  constexpr int kPasses = 3;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;  // of the rims; each from both of its sides
  std::vector<bool> rim(mesh.vertices.size());
  const auto eachEdge = [&mesh](auto&& take) {
    for (const auto& [a, b, c] : mesh.triangles)
      for (const auto& [from, to] : {std::pair{a, b}, std::pair{b, c}, std::pair{c, a}}) take(from, to);
  };
  eachEdge([&](std::uint32_t a, std::uint32_t b) {
    if (dot(mesh.vertices[a].normal, mesh.vertices[b].normal) < kSharp) rim[a] = rim[b] = true;
  });
  eachEdge([&](std::uint32_t a, std::uint32_t b) {
    if (rim[a] && rim[b]) edges.emplace_back(a, b);
  });
  for (int pass = 0; pass < kPasses; ++pass) {
    std::vector<std::pair<Vec3, int>> sums(mesh.vertices.size());
    for (const auto& [a, b] : edges)
      for (const auto& [to, from] : {std::pair{a, b}, std::pair{b, a}}) {
        sums[to].first = sums[to].first + mesh.vertices[from].p_m;
        ++sums[to].second;
      }
    for (std::size_t i = 0; i < sums.size(); ++i)
      if (sums[i].second > 0)
        mesh.vertices[i].p_m = (mesh.vertices[i].p_m + sums[i].first / sums[i].second) * 0.5;
  }
}

/// The skin beyond the ball, in which the fine one is.
Mesh farSkinOf(const SceneView& scene, std::size_t triangles) {
  const Field& field = scene.body->field();
  const FieldBox all = field.boxAround(kWholeBody);
  const double cell_m = cellFor_m(areaOf(field, kWholeBody, all), triangles);
  const SurfaceMesh whole = surfaceNet(
      field, kWholeBody, {.cell_m = std::clamp(cell_m, kMinFarCell_m, kMaxFarCell_m), .within = all});
  const Vec3 focus_L_m = inverse(scene.X_WL) * scene.focus_W_m;
  const double ball_m = bodyBall_m(scene);
  SurfaceMesh beyond;
  std::vector<std::uint32_t> place(whole.vertices.size(), 0);  // in `beyond`, plus 1
  for (SurfaceMesh::Triangle one : whole.triangles) {
    if (std::ranges::all_of(
            one, [&](std::uint32_t at) { return norm(whole.vertices[at].p_m - focus_L_m) < ball_m; }))
      continue;
    for (std::uint32_t& at : one) {
      if (place[at] == 0) {
        beyond.vertices.push_back(whole.vertices[at]);
        place[at] = static_cast<std::uint32_t>(beyond.vertices.size());
      }
      at = place[at] - 1;
    }
    beyond.triangles.push_back(one);
  }
  Mesh mesh = meshOf(beyond);
  darkenHollows(mesh, field, kWholeBody);
  return mesh;
}

double cellOf(double area_m2, std::size_t triangles) {
  return std::clamp(cellFor_m(area_m2, triangles), kMinCell_m, kMaxCell_m);
}

}  // namespace

void frameBody(SceneView& view) {
  const bool is_entry = std::fabs(signedDepth(view.limb_W, view.X_WL.p)) <= kAtOrigin_m;
  const Vec3 over_W_m = is_entry || view.targets.empty() ? view.X_WL.p : view.targets.front().center_W_m;
  view.focus_W_m = nearestSkin(view.limb_W, over_W_m, -zAxis(view.X_WL.q));
  view.focus_normal_W = outwardAt(view, view.focus_W_m);
  double deepest_m = 0;
  for (const TargetView& target : view.targets)
    deepest_m = std::max(deepest_m, norm(target.center_W_m - view.focus_W_m));
  const double body_m = std::clamp(halfBreadth_m(view), kLeastExtent_m, kWholeExtent_m);
  view.extent_m = std::clamp(std::max({0.9 * view.needle.length_m, 1.5 * deepest_m, body_m}), 0.01, 0.5);
}

std::size_t BodyMeshes::triangles() const {
  std::size_t indices = skin.triangles.size() + far_skin.triangles.size() + bones.triangles.size();
  for (const Part& part : parts) indices += part.mesh.triangles.size();
  return indices / 3;
}

double bodyReach_m(const SceneView& scene) {
  return std::clamp(2.4 * scene.extent_m, 0.12, 0.16);
}

double bodyBall_m(const SceneView& scene) {
  return bodyReach_m(scene) - kMaxCell_m;
}

BodyMeshes bodyMeshesOf(const SceneView& scene, const BodyMeshBudget& budget) {
  const Field& field = scene.body->field();
  const FieldBox within = boxNearFocus(scene);
  BodyMeshes meshes;
  const auto net = [&](StructureMask mask, double cell_m) {
    return meshOf(surfaceNet(field, mask, {.cell_m = cell_m, .within = within}));
  };
  meshes.skin = net(kWholeBody, cellOf(areaOf(field, kWholeBody, within), budget.skin));
  darkenHollows(meshes.skin, field, kWholeBody);
  meshes.far_skin = farSkinOf(scene, budget.far_skin);

  StructureMask bones = 0;
  std::vector<Candidate> solids, lines;
  for (std::size_t i = 0; i < scene.layers.size(); ++i) {
    const auto index = static_cast<StructureIndex>(i);
    const StructureShape shape = structureKind(scene.layers[i].kind).shape;
    if (shape == StructureShape::kBone) bones |= maskOf(index);
    if (shape == StructureShape::kSolid)
      solids.push_back(candidateOf(field, index, within, kSheetCells, kThinnest_m));
    if (shape == StructureShape::kLine) lines.push_back(candidateOf(field, index, within, kTubeCells, 0));
  }
  if (bones != 0) {
    meshes.bones = net(bones, cellOf(areaOf(field, bones, within), budget.bones));
    darkenHollows(meshes.bones, field, bones);
  }
  const auto add = [&](const Candidate& one, double coarser) {
    SurfaceMesh surface =
        surfaceNet(field, maskOf(one.structure),
                   {.cell_m = one.cell_m * coarser, .grown_m = one.grown_m, .within = within});
    if (structureKind(scene.layers[one.structure].kind).shape == StructureShape::kSolid) smoothRims(surface);
    meshes.parts.push_back({one.structure, meshOf(surface)});
  };
  // bursae, which are often aimed at, then those with few triangles
  std::sort(solids.begin(), solids.end(), [&](const Candidate& a, const Candidate& b) {
    const auto rank = [&](const Candidate& one) {
      return std::pair{scene.layers[one.structure].kind != pb::Volume::Structure::BURSA, one.triangles};
    };
    return rank(a) < rank(b);
  });
  double left = static_cast<double>(budget.solids);
  for (const Candidate& one : solids) {
    if (one.triangles > left) continue;
    left -= one.triangles;
    add(one, 1);
  }
  double wanted = 0;
  for (const Candidate& one : lines) wanted += one.triangles;
  for (const Candidate& one : lines)
    add(one, std::clamp(std::sqrt(wanted / static_cast<double>(budget.lines)), 1.0, 1.4));
  return meshes;
}

PicturePlane bodyCutOf(const SceneView& scene, const OrbitCamera& camera, const Moment* inside,
                       const PlanView* plan) {
  Vec3 place_W_m = scene.focus_W_m, line_W = scene.focus_normal_W;
  if (inside != nullptr && inside->inside) {
    place_W_m = inside->p_entry_W_m;
    line_W = -inside->u_W;
  } else if (plan != nullptr) {
    place_W_m = plan->entry_W_m;
    line_W = normalized(plan->from_W_m - plan->to_W_m);
  }
  const Vec3 to_eye = camera.eye_W_m() - place_W_m;
  Vec3 level = to_eye - line_W * dot(line_W, to_eye);
  if (!(normSquared(level) > 1e-12)) level = camera.upward_W() * -1.0;
  const Vec3 to_viewer_W = normalized(level);
  return {place_W_m - to_viewer_W * (0.5 * drawnDiameter_m(scene)), to_viewer_W};
}

/// How wide a capped tip presses the skin in, besides half of its depth.
constexpr double kCapDimple_m = 5e-3;

std::optional<Dimple> dimpleOf(const SceneView& scene, const Moment& moment) {
  if (isCapped(moment)) {
    const double depth_m = depthAt(scene, moment.p_WT_m), pressed_m = depth_m + scene.cap_radius_m;
    if (!(pressed_m > 0)) return std::nullopt;
    const Vec3 out_W = outwardAt(scene, moment.p_WT_m);
    return Dimple{moment.p_WT_m + out_W * depth_m, out_W, pressed_m, kCapDimple_m + 0.5 * pressed_m};
  }
  if (!moment.inside) return std::nullopt;
  return Dimple{moment.p_entry_W_m, outwardAt(scene, moment.p_entry_W_m), 1.2e-3, 3.5e-3};
}

}  // namespace needlelab
