/// Triangle meshes of a field's surfaces, for drawing: naive surface nets (Gibson 1998, "Constrained elastic
/// surface nets"). Each cell that the surface passes has one vertex, the mean of the crossings of its edges,
/// moved onto the surface along the field's gradient; each edge of the grid that the surface crosses has a
/// square between the vertices of its four cells.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/anatomy/field.h"

namespace needlelab {

struct SurfaceMesh {
  struct Vertex {
    Vec3 p_m;
    Vec3 normal;  ///< unit, outwards: from the field's gradient, whatever the triangles
  };
  using Triangle = std::array<std::uint32_t, 3>;  ///< counter-clockwise from outside
  std::vector<Vertex> vertices;
  std::vector<Triangle> triangles;
};

struct NetOptions {
  /// Edge of a cell, > 0. Shapes thinner than this are lost or torn.
  double cell_m = 1.5e-3;
  /// The surface at this distance outside of the structures, [0, 0.01]: thickens sheets for a picture.
  double grown_m = 0;
  /// Vertices stay at the crossings' means, without normals: for an area or a volume, in less time.
  bool rough = false;
  /// The mesh ends here, open, to one cell; finite where the structures are not. If the structures' box
  /// within it has more than kMaxNetCells cells, the cells grow.
  FieldBox within{{-1, -1, -1}, {1, 1, 1}};
};
inline constexpr std::size_t kMaxNetCells = std::size_t{1} << 24;

/// The surface of the points of some structures together, without the boundaries between them; kWholeBody:
/// the skin. Closed where `within` does not cut it. Empty if there is none. Thread: any; allocates.
SurfaceMesh surfaceNet(const Field& field, StructureMask mask, const NetOptions& options);

/// The triangles' area.
double areaOf(const SurfaceMesh& mesh);

/// The cell with which a surface of this area has about this many triangles: a plane with the unit normal n
/// crosses |n.x| + |n.y| + |n.z| edges a cell's face, 3/2 in the mean over all directions, each with two
/// triangles.
double cellFor_m(double area_m2, std::size_t triangles);

}  // namespace needlelab
