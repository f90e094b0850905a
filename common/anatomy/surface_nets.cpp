#include "common/anatomy/surface_nets.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace needlelab {
namespace {

constexpr int kBlock = 8;  // cells along the edge of a block, which has its own list of parts; a power of 2
constexpr int kLeaf = 2;   // cells along the edge of the smallest cube that a distance may skip
constexpr double kRoot3 = 1.7320508075688772;
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
constexpr std::uint32_t kNoVertex = 0xFFFFFFFFu, kNoCorners = kNoVertex;
/// A first step longer than this part of a cell has a second one.
constexpr double kLongStep = 0.1;

/// A cell's place in the grid, and that of its lowest corner.
struct CellPlace {
  int x = 0, y = 0, z = 0;
};

class Net {
 public:
  Net(const Field& field, StructureMask mask, const FieldBox& box, const NetOptions& options)
      : field_(field),
        mask_(mask),
        grown_m_(options.grown_m),
        rough_(options.rough),
        cell_m_(options.cell_m) {
    const double cell_m = cell_m_;
    const Vec3 size_m = box.high_m - box.low_m;
    const double cells = (size_m.x / cell_m + 2) * (size_m.y / cell_m + 2) * (size_m.z / cell_m + 2);
    if (cells > static_cast<double>(kMaxNetCells)) cell_m_ *= std::cbrt(cells / kMaxNetCells);
    const auto count = [&](double length_m) { return static_cast<int>(std::ceil(length_m / cell_m_)) + 1; };
    nx_ = count(size_m.x);
    ny_ = count(size_m.y);
    nz_ = count(size_m.z);
    // off the box by half a cell all around: flat sides that lie on it are crossed
    low_m_ = (box.low_m + box.high_m) * 0.5 - Vec3{nx_ * 0.5, ny_ * 0.5, nz_ * 0.5} * cell_m_;
    const auto blocks = [](int along) { return static_cast<std::size_t>(along / kBlock + 1); };
    blocks_y_ = blocks(ny_);
    blocks_z_ = blocks(nz_);
    corners_of_.assign(blocks(nx_) * blocks_y_ * blocks_z_, kNoCorners);
  }

  SurfaceMesh make() {
    for (int x = 0; x < nx_; x += kBlock)
      for (int y = 0; y < ny_; y += kBlock)
        for (int z = 0; z < nz_; z += kBlock) block({x, y, z});
    for (const CellPlace& cell : cells_) squares(cell);
    return std::move(mesh_);
  }

 private:
  /// A corner, and the cell above it.
  struct Corner {
    float value = kUnknown;
    std::uint32_t vertex = kNoVertex;
  };
  /// Blocks that the surface passes have corners; most of a large box has none.
  Corner& cornerAt(int x, int y, int z) {
    constexpr int kIn = kBlock - 1;
    const auto part = [](int at) { return static_cast<std::size_t>(at / kBlock); };
    std::uint32_t& first = corners_of_[(part(x) * blocks_y_ + part(y)) * blocks_z_ + part(z)];
    if (first == kNoCorners) {
      first = static_cast<std::uint32_t>(corners_.size());
      corners_.resize(corners_.size() + kBlock * kBlock * kBlock);
    }
    return corners_[first + static_cast<std::size_t>(((x & kIn) * kBlock + (y & kIn)) * kBlock + (z & kIn))];
  }
  [[nodiscard]] Vec3 placeOf(double x, double y, double z) const { return low_m_ + Vec3{x, y, z} * cell_m_; }
  [[nodiscard]] double distance(Vec3 p_m) const { return parts_.structuresDistance(mask_, p_m) - grown_m_; }

  float valueAt(int x, int y, int z) {
    float& value = cornerAt(x, y, z).value;
    if (std::isnan(value)) value = static_cast<float>(distance(placeOf(x, y, z)));
    return value;
  }

  void block(CellPlace at) {
    constexpr double kHalf = 0.5 * kBlock;
    const Vec3 center_m = placeOf(at.x + kHalf, at.y + kHalf, at.z + kHalf);
    // a vertex moves by up to half a cell, and looks a little further
    parts_ = field_.inBall(center_m, (kHalf * kRoot3 + 1) * cell_m_ + grown_m_, mask_);
    cube(at, kBlock);
  }

  void cube(CellPlace at, int size) {
    if (at.x >= nx_ || at.y >= ny_ || at.z >= nz_) return;
    const double half = 0.5 * size;
    const double off_m = distance(placeOf(at.x + half, at.y + half, at.z + half));
    if (std::fabs(off_m) > kMostSteep * kRoot3 * half * cell_m_) return;
    const int step = size > kLeaf ? size / 2 : 1;
    for (int x = at.x; x < at.x + size; x += step)
      for (int y = at.y; y < at.y + size; y += step)
        for (int z = at.z; z < at.z + size; z += step) {
          if (size > kLeaf)
            cube({x, y, z}, step);
          else if (x < nx_ && y < ny_ && z < nz_)
            cell({x, y, z});
        }
  }

  void cell(CellPlace at) {
    std::array<float, 8> corner{};
    unsigned inside = 0;
    for (unsigned i = 0; i < 8; ++i) {
      corner[i] = valueAt(at.x + static_cast<int>(i & 1u), at.y + static_cast<int>(i >> 1 & 1u),
                          at.z + static_cast<int>(i >> 2));
      inside |= static_cast<unsigned>(corner[i] < 0) << i;
    }
    if (inside == 0 || inside == 0xFFu) return;
    Vec3 sum;
    int crossings = 0;
    for (unsigned a = 0; a < 8; ++a) {
      for (unsigned way = 1; way < 8; way <<= 1) {
        const unsigned b = a | way;
        if (a == b || (corner[a] < 0) == (corner[b] < 0)) continue;
        const auto share = static_cast<double>(corner[a] / (corner[a] - corner[b]));
        sum += Vec3{(a & 1u) + (way == 1u ? share : 0), (a >> 1 & 1u) + (way == 2u ? share : 0),
                    (a >> 2) + (way == 4u ? share : 0)};
        ++crossings;
      }
    }
    const Vec3 mean = sum / crossings;
    cornerAt(at.x, at.y, at.z).vertex = static_cast<std::uint32_t>(mesh_.vertices.size());
    const Vec3 p_m = placeOf(at.x + mean.x, at.y + mean.y, at.z + mean.z);
    mesh_.vertices.push_back(rough_ ? SurfaceMesh::Vertex{p_m, {}} : onSurface(p_m));
    cells_.push_back(at);
  }

  /// Newton steps along the gradient: two where the first is long.
  [[nodiscard]] SurfaceMesh::Vertex onSurface(Vec3 p_m) const {
    Vec3 normal{0, 0, 1};
    for (int step = 0; step < 2; ++step) {
      const auto [distance_m, slope] = parts_.slope(mask_, p_m);
      const double off_m = distance_m - grown_m_;
      const double steepness = norm(slope);
      if (!(steepness > 0)) break;
      normal = slope / steepness;
      if (steepness < 0.1) break;  // a ridge between two surfaces
      const double step_m = std::clamp(off_m / steepness, -0.5 * cell_m_, 0.5 * cell_m_);
      p_m = p_m - normal * step_m;
      if (std::fabs(step_m) < kLongStep * cell_m_) break;
    }
    return {p_m, normal};
  }

  /// The squares of the three edges that leave a cell's lowest corner upwards.
  void squares(CellPlace at) {
    const std::array<int, 3> place = {at.x, at.y, at.z};
    const bool inside = valueAt(at.x, at.y, at.z) < 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
      if (place[u] == 0 || place[v] == 0) continue;  // the mesh ends
      std::array<int, 3> end = place;
      ++end[axis];
      if (inside == (cornerAt(end[0], end[1], end[2]).value < 0)) continue;
      std::array<std::uint32_t, 4> ring{};
      for (std::size_t i = 0; i < 4; ++i) {  // round the axis
        std::array<int, 3> one = place;
        one[u] -= i == 1 || i == 2;
        one[v] -= i >= 2;
        ring[i] = cornerAt(one[0], one[1], one[2]).vertex;
        assert(ring[i] != kNoVertex);  // each of the four has this edge
      }
      if (!inside) std::swap(ring[1], ring[3]);
      const auto length = [&](std::size_t a, std::size_t b) {
        return normSquared(mesh_.vertices[ring[a]].p_m - mesh_.vertices[ring[b]].p_m);
      };
      // along the shorter diagonal
      const std::size_t from = length(0, 2) <= length(1, 3) ? 0 : 1;
      mesh_.triangles.push_back({ring[from], ring[from + 1], ring[from + 2]});
      mesh_.triangles.push_back({ring[from], ring[from + 2], ring[(from + 3) % 4]});
    }
  }

  const Field& field_;
  StructureMask mask_;
  double grown_m_;
  bool rough_;
  double cell_m_;
  int nx_ = 0, ny_ = 0, nz_ = 0;  // cells
  Vec3 low_m_;
  std::size_t blocks_y_ = 0, blocks_z_ = 0;
  std::vector<std::uint32_t> corners_of_;  // of each block: the first one's place
  std::vector<Corner> corners_;
  std::vector<CellPlace> cells_;  // those with a vertex
  Field::InBall parts_;           // of the current block
  SurfaceMesh mesh_;
};

}  // namespace

SurfaceMesh surfaceNet(const Field& field, StructureMask mask, const NetOptions& options) {
  assert(options.cell_m > 0);
  FieldBox box = field.boxAround(mask);
  const Vec3 grown_m{options.grown_m, options.grown_m, options.grown_m};
  box = common({box.low_m - grown_m, box.high_m + grown_m}, options.within);
  if (box.empty()) return {};
  return Net(field, mask, box, options).make();
}

double areaOf(const SurfaceMesh& mesh) {
  double twice_m2 = 0;
  for (const SurfaceMesh::Triangle& triangle : mesh.triangles) {
    const Vec3 a = mesh.vertices[triangle[0]].p_m;
    twice_m2 += norm(cross(mesh.vertices[triangle[1]].p_m - a, mesh.vertices[triangle[2]].p_m - a));
  }
  return 0.5 * twice_m2;
}

double cellFor_m(double area_m2, std::size_t triangles) {
  return std::sqrt(3 * area_m2 / static_cast<double>(std::max<std::size_t>(triangles, 1)));
}

}  // namespace needlelab
