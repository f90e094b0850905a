#include "client/view/model/mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace needlelab {

std::uint32_t addVertex(Mesh& mesh, Vec3 p, Vec3 n) {
  const auto f = [](double v) { return static_cast<float>(v); };
  mesh.vertices.push_back({{f(p.x), f(p.y), f(p.z)}, {f(n.x), f(n.y), f(n.z)}});
  return static_cast<std::uint32_t>(mesh.vertices.size() - 1);
}

void addTriangle(Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  mesh.triangles.insert(mesh.triangles.end(), {a, b, c});
}

void append(Mesh& mesh, const Mesh& part) {
  const auto offset = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), part.vertices.begin(), part.vertices.end());
  for (const std::uint32_t index : part.triangles) mesh.triangles.push_back(index + offset);
}

Mesh moved(Mesh mesh, const Pose& X) {
  for (MeshVertex& vertex : mesh.vertices) {
    const Vec3 p = X * Vec3{static_cast<double>(vertex.p_m[0]), static_cast<double>(vertex.p_m[1]),
                            static_cast<double>(vertex.p_m[2])};
    const Vec3 n = rotate(X.q, {static_cast<double>(vertex.normal[0]), static_cast<double>(vertex.normal[1]),
                                static_cast<double>(vertex.normal[2])});
    Mesh one;
    addVertex(one, p, n);
    vertex = one.vertices.front();
  }
  return mesh;
}

SideAxes sideAxes(Vec3 axis) {
  const Vec3 other = std::fabs(axis.x) < 0.7 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  const Vec3 a = normalized(other - axis * dot(axis, other));
  return {a, cross(axis, a)};
}

Mesh gridMesh(int rows, int columns, const std::function<Vec3(double, double)>& place) {
  Mesh mesh;
  constexpr double kStep = 1e-4;
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      const double r = static_cast<double>(row) / rows, c = static_cast<double>(column) / columns;
      // at a pole one of the two differences is zero, so step aside
      const double beside = std::clamp(r, 2 * kStep, 1 - 2 * kStep);
      const Vec3 along_row = place(beside + kStep, c) - place(beside - kStep, c);
      const Vec3 along_column = place(beside, c + kStep) - place(beside, c - kStep);
      addVertex(mesh, place(r, c), normalized(cross(along_row, along_column)));
    }
  }
  const auto at = [&](int row, int column) {
    return static_cast<std::uint32_t>(row * (columns + 1) + column);
  };
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      addTriangle(mesh, at(row, column), at(row + 1, column), at(row + 1, column + 1));
      addTriangle(mesh, at(row, column), at(row + 1, column + 1), at(row, column + 1));
    }
  }
  return mesh;
}

Mesh latheMesh(const std::vector<LathePoint>& profile, int sides) {
  Mesh mesh;
  for (std::size_t i = 0; i + 1 < profile.size(); ++i) {
    const LathePoint low = profile[i], high = profile[i + 1];
    const double run_m = high.z_m - low.z_m, rise_m = high.radius_m - low.radius_m;
    const double length_m = std::hypot(run_m, rise_m);
    if (!(length_m > 0)) continue;
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (int side = 0; side <= sides; ++side) {
      const double angle = 2 * std::numbers::pi * side / sides;
      const Vec3 out{std::cos(angle), std::sin(angle), 0};
      const Vec3 normal = out * (run_m / length_m) + Vec3{0, 0, -rise_m / length_m};
      addVertex(mesh, out * low.radius_m + Vec3{0, 0, low.z_m}, normal);
      addVertex(mesh, out * high.radius_m + Vec3{0, 0, high.z_m}, normal);
    }
    for (int side = 0; side < sides; ++side) {
      const auto a = first + static_cast<std::uint32_t>(2 * side);
      if (low.radius_m > 0) addTriangle(mesh, a, a + 2, a + 1);
      if (high.radius_m > 0) addTriangle(mesh, a + 1, a + 2, a + 3);
    }
  }
  return mesh;
}

namespace {

constexpr double kTurn = 2 * std::numbers::pi;

// Returns the pose that maps z to `axis` and the origin to `p`.
Pose poseAlong(Vec3 p, Vec3 axis) {
  const double w = 1 + axis.z;
  if (w < 1e-9) return {p, {1, 0, 0, 0}};
  return {p, normalized(Quat{-axis.y, axis.x, 0, w})};
}

// A ball's profile from its lower to its upper pole.
std::vector<LathePoint> roundProfile(double radius_m, double from_rad, double to_rad, double z_m, int rings) {
  std::vector<LathePoint> profile;
  for (int ring = 0; ring <= rings; ++ring) {
    const double angle = from_rad + (to_rad - from_rad) * ring / rings;
    profile.push_back({std::max(0.0, radius_m * std::cos(angle)), z_m + radius_m * std::sin(angle)});
  }
  return profile;
}

// smooth normals for round meshes: away from the nearest point of the axis
void smoothAboutAxis(Mesh& mesh, double low_m, double high_m) {
  for (MeshVertex& vertex : mesh.vertices) {
    const double z = static_cast<double>(vertex.p_m[2]);
    const Vec3 out{static_cast<double>(vertex.p_m[0]), static_cast<double>(vertex.p_m[1]),
                   z - std::clamp(z, low_m, high_m)};
    if (!(normSquared(out) > 0)) continue;
    const Vec3 n = normalized(out);
    vertex.normal[0] = static_cast<float>(n.x);
    vertex.normal[1] = static_cast<float>(n.y);
    vertex.normal[2] = static_cast<float>(n.z);
  }
}

}  // namespace

Mesh ballMesh(double radius_m, int rings) {
  Mesh mesh = latheMesh(roundProfile(radius_m, -kTurn / 4, kTurn / 4, 0, rings), 2 * rings);
  smoothAboutAxis(mesh, 0, 0);
  return mesh;
}

Mesh coneMesh(Vec3 a_m, Vec3 b_m, double radius_a_m, double radius_b_m, int sides, bool closed) {
  const Vec3 along = b_m - a_m;
  const double length_m = norm(along);
  if (!(length_m > 0)) return {};
  std::vector<LathePoint> profile;
  if (closed && radius_a_m > 0) profile.push_back({0, 0});
  profile.push_back({radius_a_m, 0});
  profile.push_back({radius_b_m, length_m});
  if (closed && radius_b_m > 0) profile.push_back({0, length_m});
  return moved(latheMesh(profile, sides), poseAlong(a_m, along / length_m));
}

Mesh tubeMesh(Vec3 a_m, Vec3 b_m, double radius_m, int rings, int sides) {
  const Vec3 along = b_m - a_m;
  const double length_m = norm(along);
  std::vector<LathePoint> profile = roundProfile(radius_m, -kTurn / 4, 0, 0, rings);
  const std::vector<LathePoint> top = roundProfile(radius_m, 0, kTurn / 4, length_m, rings);
  profile.insert(profile.end(), top.begin() + (length_m > 0 ? 0 : 1), top.end());
  Mesh mesh = latheMesh(profile, sides);
  smoothAboutAxis(mesh, 0, length_m);
  return moved(std::move(mesh), length_m > 0 ? poseAlong(a_m, along / length_m) : Pose{a_m, {}});
}

Mesh arrowMesh(int sides) {
  return latheMesh({{0, 0}, {0.035, 0}, {0.035, 0.7}, {0.09, 0.7}, {0, 1}}, sides);
}

Mesh layerSurface(const SceneView& scene, double depth_m) {
  const double reach_m = 1.35 * scene.extent_m;
  if (const auto* plane = std::get_if<PlaneLimb>(&scene.limb_W)) {
    // rings about the focus
    const SideAxes side = sideAxes(plane->normal);
    const Vec3 middle = scene.focus_W_m - plane->normal * depth_m;
    return gridMesh(10, 48, [&](double row, double column) {
      const double angle = kTurn * column;
      return middle + (side.a * std::cos(angle) + side.b * std::sin(angle)) * (reach_m * std::max(row, 0.0));
    });
  }
  if (const auto* sphere = std::get_if<SphereLimb>(&scene.limb_W)) {
    if (!(depth_m < sphere->radius_m)) return {};
    return moved(ballMesh(sphere->radius_m - depth_m, 28), poseAlong(sphere->center_m, scene.focus_normal_W));
  }
  const auto& capsule = std::get<CapsuleLimb>(scene.limb_W);
  if (!(depth_m < capsule.radius_m)) return {};
  // long limbs are only shown near the focus
  const Vec3 along = capsule.b_m - capsule.a_m;
  const double length_m = norm(along);
  const Vec3 axis = along / length_m;
  const double focus_at_m = dot(axis, scene.focus_W_m - capsule.a_m);
  const double from_m = std::clamp(focus_at_m - 1.6 * reach_m, 0.0, length_m);
  const double to_m = std::clamp(focus_at_m + 1.6 * reach_m, from_m, length_m);
  const double radius_m = capsule.radius_m - depth_m;
  const Vec3 a_m = capsule.a_m + axis * from_m, b_m = capsule.a_m + axis * to_m;
  const bool whole_a = from_m <= 0, whole_b = to_m >= length_m;
  if (whole_a && whole_b) return tubeMesh(a_m, b_m, radius_m, 12, 56);
  // open ends where the limb continues
  std::vector<LathePoint> profile;
  if (whole_a) profile = roundProfile(radius_m, -kTurn / 4, 0, 0, 12);
  constexpr int kRings = 12;
  for (int ring = whole_a ? 1 : 0; ring <= kRings; ++ring)
    profile.push_back({radius_m, (to_m - from_m) * ring / kRings});
  if (whole_b) {
    const auto top = roundProfile(radius_m, 0, kTurn / 4, to_m - from_m, 12);
    profile.insert(profile.end(), top.begin() + 1, top.end());
  }
  Mesh mesh = latheMesh(profile, 56);
  smoothAboutAxis(mesh, 0, to_m - from_m);
  return moved(std::move(mesh), poseAlong(a_m, axis));
}

Mesh needleMesh(const NeedleSpec& needle, double drawn_diameter_m) {
  const double radius_m = drawn_diameter_m / 2;
  NeedleSpec drawn = needle;
  drawn.outer_diameter_m = drawn_diameter_m;
  double bevel_m = bevelLength_m(drawn);
  if (!(bevel_m > 0)) bevel_m = 2.5 * drawn_diameter_m;
  bevel_m = std::min(bevel_m, 0.5 * needle.length_m);
  constexpr int kSides = 20;
  if (needle.tip == NeedleTip::kPencilPoint)
    return latheMesh({{0, -needle.length_m}, {radius_m, -needle.length_m}, {radius_m, -bevel_m}, {0, 0}},
                     kSides);
  // The shaft, about T's axis, is cut by a plane that starts at the sharp point (at −y) and rises to the
  // opposite side.
  Mesh mesh;
  const auto cut = [&](double angle) { return -bevel_m * 0.5 * (1 + std::sin(angle)); };
  for (int side = 0; side <= kSides; ++side) {
    const double angle = kTurn * side / kSides;
    const Vec3 out{std::cos(angle), std::sin(angle), 0};
    addVertex(mesh, out * radius_m + Vec3{0, 0, -needle.length_m}, out);
    addVertex(mesh, out * radius_m + Vec3{0, 0, cut(angle)}, out);
  }
  for (std::uint32_t side = 0; side < kSides; ++side) {
    addTriangle(mesh, 2 * side, 2 * side + 2, 2 * side + 1);
    addTriangle(mesh, 2 * side + 1, 2 * side + 2, 2 * side + 3);
  }
  const Vec3 slope = normalized(Vec3{0, bevel_m, 2 * radius_m});
  const std::uint32_t middle = addVertex(mesh, {0, 0, -bevel_m * 0.5}, slope);
  std::uint32_t before = 0;
  for (int side = 0; side <= kSides; ++side) {
    const double angle = kTurn * side / kSides;
    const std::uint32_t here =
        addVertex(mesh, {radius_m * std::cos(angle), radius_m * std::sin(angle), cut(angle)}, slope);
    if (side > 0) addTriangle(mesh, middle, before, here);
    before = here;
  }
  return mesh;
}

SyringeMesh syringeMesh(double needle_length_m) {
  // the syringe's size follows the needle's length
  const double size = std::clamp(needle_length_m / 0.05, 0.55, 1.15);
  const double hub_m = 0.012 * size, barrel_m = 0.05 * size, radius_m = 0.0062 * size;
  const double hub_z = -needle_length_m, barrel_z = hub_z - hub_m, end_z = barrel_z - barrel_m;
  constexpr int kSides = 32;
  SyringeMesh syringe;
  syringe.hub = latheMesh({{0, barrel_z},
                           {0.6 * radius_m, barrel_z},
                           {0.52 * radius_m, hub_z - 0.7 * hub_m},
                           {0.3 * radius_m, hub_z - 0.6 * hub_m},
                           {0.2 * radius_m, hub_z}},
                          kSides);
  // glass: a closed tube with flanges for two fingers
  syringe.barrel = latheMesh({{0, end_z - 0.0015 * size},
                              {1.9 * radius_m, end_z - 0.0015 * size},
                              {1.9 * radius_m, end_z},
                              {radius_m, end_z},
                              {radius_m, barrel_z - 0.003 * size},
                              {0.35 * radius_m, barrel_z},
                              {0, barrel_z}},
                             kSides);
  for (int mark = 0; mark <= 10; ++mark) {
    const double z = barrel_z - 0.006 * size - (barrel_m - 0.012 * size) * mark / 10;
    const double width = (mark % 5 == 0 ? 1.9 : 1.1);
    Mesh line = gridMesh(1, 8, [&](double row, double column) {
      const double angle = width * (column - 0.5) + kTurn / 4;
      return Vec3{1.01 * radius_m * std::cos(angle), 1.01 * radius_m * std::sin(angle),
                  z - 0.0006 * size * (0.5 - row)};
    });
    append(syringe.scale, line);
  }
  // drawn out: the stopper is near the barrel's rear end, followed by rod and thumb plate
  syringe.stroke_m = barrel_m - 0.012 * size;
  const double stopper_z = end_z + 0.004 * size;
  syringe.stopper_z_m = stopper_z + 0.004 * size;
  syringe.outlet_z_m = barrel_z - 0.003 * size;
  syringe.radius_m = radius_m;
  syringe.end_z_m = stopper_z - barrel_m - 0.004 * size;
  syringe.plunger = latheMesh({{0, stopper_z - barrel_m - 0.004 * size},
                               {1.35 * radius_m, stopper_z - barrel_m - 0.004 * size},
                               {1.35 * radius_m, stopper_z - barrel_m - 0.002 * size},
                               {0.34 * radius_m, stopper_z - barrel_m - 0.002 * size},
                               {0.34 * radius_m, stopper_z},
                               {0.94 * radius_m, stopper_z},
                               {0.94 * radius_m, stopper_z + 0.004 * size},
                               {0, stopper_z + 0.0055 * size}},
                              kSides);
  return syringe;
}

double plungerShift_m(const SyringeMesh& syringe, double plunger) {
  return syringe.stroke_m * std::clamp(std::isfinite(plunger) ? plunger : 0.0, 0.0, 1.0);
}

}  // namespace needlelab
