#include "common/fem/tet_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace needlelab {
namespace {

/// The orders in which a path goes along i, j, k from the least corner of a cell to the greatest.
constexpr std::array<std::array<int, 3>, 6> kPaths = {
    {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}}};

std::uint64_t edgeKey(std::int32_t a, std::int32_t b) {
  const auto [low, high] = std::minmax(a, b);
  return static_cast<std::uint64_t>(low) << 32 | static_cast<std::uint32_t>(high);
}

}  // namespace

double volumeOf(const TetMesh& mesh, const TetNodes& e) {
  const auto at = [&](std::size_t n) -> const Eigen::Vector3d& {
    return mesh.node_m[static_cast<std::size_t>(e[n])];
  };
  return (at(1) - at(0)).cross(at(2) - at(0)).dot(at(3) - at(0)) / 6.0;
}

GridMesh::GridMesh(Size cells, const Place& place, const Material& material, bool axis) : cells_(cells) {
  corner_.reserve(static_cast<std::size_t>(cells.i + 1) * static_cast<std::size_t>(cells.j + 1) *
                  static_cast<std::size_t>(cells.k + 1));
  for (int k = 0; k <= cells.k; ++k)
    for (int j = 0; j <= cells.j; ++j)
      for (int i = 0; i <= cells.i; ++i) {
        if (axis && i == 0 && j > 0) {
          corner_.push_back(corner(0, 0, k));
          continue;
        }
        corner_.push_back(static_cast<std::int32_t>(mesh_.node_m.size()));
        mesh_.node_m.push_back(place(i, j, k));
      }
  for (int k = 0; k < cells.k; ++k)
    for (int j = 0; j < cells.j; ++j)
      for (int i = 0; i < cells.i; ++i) addCell(i, j, k, material(i, j, k));
}

std::int32_t GridMesh::corner(int i, int j, int k) const {
  return corner_[static_cast<std::size_t>((k * (cells_.j + 1) + j) * (cells_.i + 1) + i)];
}

std::int32_t GridMesh::middle(std::int32_t a, std::int32_t b) const {
  return middle_.at(edgeKey(a, b));
}

std::int32_t GridMesh::middleOrNew(std::int32_t a, std::int32_t b) {
  const auto [at, is_new] =
      middle_.try_emplace(edgeKey(a, b), static_cast<std::int32_t>(mesh_.node_m.size()));
  if (is_new)
    mesh_.node_m.push_back(
        0.5 * (mesh_.node_m[static_cast<std::size_t>(a)] + mesh_.node_m[static_cast<std::size_t>(b)]));
  return at->second;
}

void GridMesh::addCell(int i, int j, int k, int material) {
  for (const auto& path : kPaths) {
    TetNodes e{};
    std::array<int, 3> at = {i, j, k};
    e[0] = corner(i, j, k);
    for (std::size_t step = 0; step < 3; ++step) {
      ++at[static_cast<std::size_t>(path[step])];
      e[step + 1] = corner(at[0], at[1], at[2]);
    }
    // a path along j on the axis stays where it is
    if (e[0] == e[1] || e[1] == e[2] || e[2] == e[3]) continue;
    if (volumeOf(mesh_, e) < 0) std::swap(e[1], e[2]);
    for (std::size_t n = 0; n < kTetEdges.size(); ++n)
      e[4 + n] = middleOrNew(e[static_cast<std::size_t>(kTetEdges[n][0])],
                             e[static_cast<std::size_t>(kTetEdges[n][1])]);
    mesh_.element.push_back(e);
    mesh_.material.push_back(material);
  }
}

}  // namespace needlelab
