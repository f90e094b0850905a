#include "common/fem/needle_box.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace needlelab {
namespace {

constexpr double kQuarter_rad = std::numbers::pi / 2;
/// Share of the cells in depth that lie below the path.
constexpr double kBelowShare = 0.15;
/// Cells along a quarter circle; even, so that the box's edge is a grid line. Four instead of two make the
/// needle 0.4 % softer and the mesh almost twice as large.
constexpr int kAround = 2;
/// Index of the ring at the needle's surface.
constexpr int kNeedleRing = 1;

// the geometric growth q with first (1 + q + … + q^(n−1)) = total; by bisection
double growthFor(double first, int n, double total) {
  double low = 1.0, high = 1e4;
  for (int i = 0; i < 200; ++i) {
    const double q = 0.5 * (low + high);
    double sum = 0, piece = first;
    for (int k = 0; k < n; ++k, piece *= q) sum += piece;
    (sum < total ? low : high) = q;
  }
  return low;
}

// lines along the path: one at every layer's top, with cells of about the same height in between
std::vector<double> linesOnPath(const NeedleBoxSpec& spec, int cells) {
  std::vector<double> edges;
  for (const double top : spec.top_m)
    if (top < spec.length_m * (1 - 1e-9)) edges.push_back(top);
  edges.push_back(spec.length_m);
  const double height = spec.length_m / cells;
  std::vector<double> lines = {0.0};
  for (std::size_t e = 1; e < edges.size(); ++e) {
    const double from = edges[e - 1], thickness = edges[e] - from;
    const int pieces = std::max(1, static_cast<int>(std::lround(thickness / height)));
    for (int p = 1; p <= pieces; ++p) lines.push_back(from + thickness * p / pieces);
  }
  return lines;
}

// below the path cells grow; each layer's top there replaces the nearest line
void addLinesBelow(const NeedleBoxSpec& spec, int cells, std::vector<double>& lines) {
  double height = lines.back() - lines[lines.size() - 2];
  const double total = spec.depth_m - spec.length_m;
  const double growth = growthFor(height, cells, total);
  const std::size_t first_below = lines.size();
  for (int c = 0; c < cells; ++c) {
    height *= c == 0 ? 1.0 : growth;
    lines.push_back(c + 1 == cells ? spec.depth_m : lines.back() + height);
  }
  for (const double top : spec.top_m) {
    if (top <= spec.length_m || top >= spec.depth_m) continue;
    const auto above = std::lower_bound(lines.begin(), lines.end(), top);
    const auto n = static_cast<std::size_t>(above - lines.begin());
    const double share = (top - lines[n - 1]) / (lines[n] - lines[n - 1]);
    if (share > 0.75 && n + 1 < lines.size())
      lines[n] = top;
    else if (share < 0.25 && n - 1 >= first_below)
      lines[n - 1] = top;
    else
      lines.insert(above, top);
  }
}

// a corner of the grid across the path: on a circle near the needle, on a square at the box's sides
Eigen::Vector2d placeAcross(double radius, double half_width, int j, int around) {
  const double angle = kQuarter_rad * j / around;
  const double c = j == around ? 0.0 : std::cos(angle), s = j == 0 ? 0.0 : std::sin(angle);
  // a polygon with the circle's circumference
  const double half_chord = 0.5 * kQuarter_rad / around;
  const double circle = half_chord / std::sin(half_chord);
  const double square = 1.0 / std::max(c, s);
  const double far = radius / half_width;
  return radius * ((1.0 - far) * circle + far * square) * Eigen::Vector2d(c, s);
}

// Gauss, three points on [0, 1]
constexpr std::array<double, 3> kGaussAt = {0.11270166537925831, 0.5, 0.88729833462074169};
constexpr std::array<double, 3> kGaussWeight = {5.0 / 18, 8.0 / 18, 5.0 / 18};

}  // namespace

NeedleBox::Lines NeedleBox::linesFor(const NeedleBoxSpec& spec, int nodes) {
  Lines lines;
  // (2 cells + 1) lines of nodes in each direction. The height of the cells on the path matters most for the
  // tip, then the number of rings, which grow geometrically: use about four cells on the path per ring
  const double wanted = static_cast<double>(nodes) / (2 * kAround + 1);
  const int rings = std::max(4, static_cast<int>(std::lround(0.84 * std::cbrt(wanted))));
  const int cells_deep =
      std::max(5, static_cast<int>(std::lround(0.5 * (wanted / (2 * (rings + 1) + 1) - 1))));
  const int below = std::clamp(static_cast<int>(std::lround(kBelowShare * cells_deep)), 2, 10);
  lines.depth_m = linesOnPath(spec, cells_deep - below);
  addLinesBelow(spec, below, lines.depth_m);
  lines.radius_m = {0.0};
  for (int i = 0; i < rings; ++i)
    lines.radius_m.push_back(spec.radius_m *
                             std::pow(spec.half_width_m / spec.radius_m, static_cast<double>(i) / rings));
  lines.radius_m.push_back(spec.half_width_m);
  return lines;
}

NeedleBox::NeedleBox(const NeedleBoxSpec& spec, int nodes) : NeedleBox(spec, linesFor(spec, nodes)) {}

NeedleBox::NeedleBox(const NeedleBoxSpec& spec, Lines lines)
    : spec_(spec),
      lines_(std::move(lines)),
      grid_(
          {static_cast<int>(lines_.radius_m.size()) - 1, kAround,
           static_cast<int>(lines_.depth_m.size()) - 1},
          [this](int i, int j, int k) {
            const Eigen::Vector2d across =
                placeAcross(lines_.radius_m[static_cast<std::size_t>(i)], spec_.half_width_m, j, kAround);
            return Eigen::Vector3d(across.x(), across.y(), lines_.depth_m[static_cast<std::size_t>(k)]);
          },
          [this](int, int, int k) {
            const double middle = 0.5 * (lines_.depth_m[static_cast<std::size_t>(k)] +
                                         lines_.depth_m[static_cast<std::size_t>(k) + 1]);
            const auto below = std::upper_bound(spec_.top_m.begin(), spec_.top_m.end(), middle);
            return static_cast<int>(below - spec_.top_m.begin()) - 1;
          },
          true) {}

std::vector<bool> NeedleBox::held() const {
  const double near = 1e-9 * spec_.radius_m;
  const double side = spec_.half_width_m * (1 - 1e-9), bottom = spec_.depth_m * (1 - 1e-9);
  std::vector<bool> held;
  held.reserve(3 * mesh().node_m.size());
  for (const Eigen::Vector3d& p : mesh().node_m) {
    const bool far = std::max(p.x(), p.y()) > side || p.z() > bottom;
    held.push_back(far || p.x() < near);
    held.push_back(far || p.y() < near);
    held.push_back(far);
  }
  return held;
}

Eigen::SparseMatrix<double> NeedleBox::surfaceLoads(const std::vector<double>& edges_m) const {
  std::vector<Eigen::Triplet<double>> weights;
  constexpr int line = kNeedleRing, around = kAround;

  // adds a surface point at (t, s) in the rectangle (j, k), using the shape functions of its triangle
  const auto addPoint = [&](int column, double weight, int j, int k, double t, double s) {
    const std::int32_t least = grid_.corner(line, j, k), greatest = grid_.corner(line, j + 1, k + 1);
    const bool along_j = t >= s;  // which side of the diagonal
    const std::int32_t third = along_j ? grid_.corner(line, j + 1, k) : grid_.corner(line, j, k + 1);
    const std::array<std::int32_t, 3> node = {least, third, greatest};
    const std::array<double, 3> at = {1 - std::max(t, s), std::fabs(t - s), std::min(t, s)};
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t b = (a + 1) % 3;
      weights.emplace_back(3 * node[a] + 2, column, weight * at[a] * (2 * at[a] - 1));
      weights.emplace_back(3 * grid_.middle(node[a], node[b]) + 2, column, weight * 4 * at[a] * at[b]);
    }
  };

  for (std::size_t c = 0; c + 1 < edges_m.size(); ++c) {
    const double from = edges_m[c], to = edges_m[c + 1];
    for (std::size_t k = 0; k + 1 < lines_.depth_m.size(); ++k) {
      const double top = lines_.depth_m[k], height = lines_.depth_m[k + 1] - top;
      const double first = std::max(from, top), last = std::min(to, top + height);
      if (last <= first) continue;
      for (int j = 0; j < around; ++j)
        for (std::size_t a = 0; a < 3; ++a)
          for (std::size_t b = 0; b < 3; ++b)
            addPoint(static_cast<int>(c),
                     kGaussWeight[a] * kGaussWeight[b] * (last - first) / (to - from) / around, j,
                     static_cast<int>(k), kGaussAt[b], (first + (last - first) * kGaussAt[a] - top) / height);
    }
  }
  Eigen::SparseMatrix<double> loads(static_cast<Eigen::Index>(3 * mesh().node_m.size()),
                                    static_cast<Eigen::Index>(edges_m.size()) - 1);
  loads.setFromTriplets(weights.begin(), weights.end());
  return loads;
}

}  // namespace needlelab
