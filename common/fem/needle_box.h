/// Meshes the tissue around a needle's path: a quarter of a box (the needle's load is the same in all four
/// quarters), layer on layer, fine at the needle and coarse far away.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "common/fem/elasticity.h"

namespace needlelab {

/// The meshed box. z is the depth along the path, x and y are perpendicular to it; the skin is z = 0 and
/// free.
struct NeedleBoxSpec {
  double length_m = 0;                     ///< length of the path
  double radius_m = 0;                     ///< r₀ of the needle: a surface of the mesh
  double half_width_m = 0;                 ///< half-width of the box; its sides are held
  double depth_m = 0;                      ///< depth of the box; its bottom is held
  std::vector<double> top_m;               ///< top of each layer, from 0; the last layer has no end
  std::vector<ElasticMaterial> materials;  ///< one for each layer
};

/// Rings of the mesh around the needle are circles near it (polygons with the circle's circumference) and
/// pass to the box's square far from it. The needle is not a hole: its load enters at r = r₀, and the tissue
/// within moves with it. One mesh and one factorisation therefore serve every depth of the needle.
class NeedleBox {
 public:
  /// Builds a mesh of about `nodes` nodes; every layer has at least one cell, so thin layers can add nodes.
  NeedleBox(const NeedleBoxSpec& spec, int nodes);

  [[nodiscard]] const TetMesh& mesh() const { return grid_.mesh(); }
  [[nodiscard]] const std::vector<ElasticMaterial>& materials() const { return spec_.materials; }
  /// Held unknowns, by 3·node + axis: sides and bottom in all directions, the planes of symmetry in their
  /// normal direction.
  [[nodiscard]] std::vector<bool> held() const;
  /// Weights that spread a force of 1 N along z evenly over the surface r = r₀ between two adjacent depths of
  /// `edges_m`; column = station, row = unknown. Their transposes give the mean displacement of that surface.
  [[nodiscard]] Eigen::SparseMatrix<double> surfaceLoads(const std::vector<double>& edges_m) const;

 private:
  struct Lines {
    std::vector<double> radius_m, depth_m;
  };
  static Lines linesFor(const NeedleBoxSpec& spec, int nodes);
  NeedleBox(const NeedleBoxSpec& spec, Lines lines);

  NeedleBoxSpec spec_;
  Lines lines_;
  GridMesh grid_;
};

}  // namespace needlelab
