/// Private to this folder: how meshes are put together.
#pragma once

#include <functional>

#include "client/view/model/mesh.h"

namespace needlelab {

/// Adds a vertex; its index.
std::uint32_t addVertex(Mesh& mesh, Vec3 p_m, Vec3 normal);
void addTriangle(Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c);
/// Appends `part` to `mesh`.
void append(Mesh& mesh, const Mesh& part);
/// Every vertex moved by the pose.
Mesh moved(Mesh mesh, const Pose& X);

/// A grid of (rows + 1)·(columns + 1) vertices over the unit square, its normals taken from the neighbours'
/// places; outward is row × column.
Mesh gridMesh(int rows, int columns, const std::function<Vec3(double row, double column)>& place);

/// A surface of revolution about the z axis: `profile` are (radius, z) from one end to the other, in
/// ascending z; each piece has a normal of its own, so that edges stay sharp.
struct LathePoint {
  double radius_m = 0, z_m = 0;
};
Mesh latheMesh(const std::vector<LathePoint>& profile, int sides);

/// Two unit vectors that make a right-handed frame with the unit vector `axis`.
struct SideAxes {
  Vec3 a, b;
};
SideAxes sideAxes(Vec3 axis);

}  // namespace needlelab
