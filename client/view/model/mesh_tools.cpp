#include "client/view/model/mesh_tools.h"

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
      // beside a pole, where one of the two differences has no length
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

}  // namespace needlelab
