/// Meshes of ten-node tetrahedra, made from structured grids of cells. Straight-sided: the middle nodes lie
/// in the middle of the edges.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <unordered_map>
#include <vector>

namespace needlelab {

/// Corners 0-3 with positive volume, then the middles of the edges 01 12 02 03 13 23.
using TetNodes = std::array<std::int32_t, 10>;

/// The corners at the ends of each edge, in the order of the middle nodes.
inline constexpr std::array<std::array<int, 2>, 6> kTetEdges = {
    {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};

struct TetMesh {
  std::vector<Eigen::Vector3d> node_m;
  std::vector<TetNodes> element;
  std::vector<std::int32_t> material;  ///< of each element: an index into the caller's list
};

/// A grid of cells, each cut into six tetrahedra along the diagonal from its least to its greatest corner
/// (Freudenthal), so that neighbours share whole faces. Corners at the same place may be one node: tetrahedra
/// that lose their volume by that are left out.
class GridMesh {
 public:
  /// Cells in each direction.
  struct Size {
    int i = 1, j = 1, k = 1;
  };
  using Place = std::function<Eigen::Vector3d(int i, int j, int k)>;
  using Material = std::function<int(int i, int j, int k)>;  ///< of the cell with that least corner

  /// With `axis`, all corners with i = 0 and the same k are one node: the grid goes around that line.
  GridMesh(Size cells, const Place& place, const Material& material, bool axis = false);

  [[nodiscard]] const TetMesh& mesh() const { return mesh_; }
  [[nodiscard]] Size cells() const { return cells_; }
  /// The node at a corner of the grid.
  [[nodiscard]] std::int32_t corner(int i, int j, int k) const;
  /// The node in the middle of an edge of the mesh; the edge must be there.
  [[nodiscard]] std::int32_t middle(std::int32_t a, std::int32_t b) const;

 private:
  void addCell(int i, int j, int k, int material);
  std::int32_t middleOrNew(std::int32_t a, std::int32_t b);

  Size cells_;
  TetMesh mesh_;
  std::vector<std::int32_t> corner_;  ///< node of each corner
  std::unordered_map<std::uint64_t, std::int32_t> middle_;
};

/// In m³; positive.
double volumeOf(const TetMesh& mesh, const TetNodes& element);

}  // namespace needlelab
