#include "common/anatomy/tube_axes.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace needlelab {
namespace {

constexpr double kSamePlace_m = 1e-9;  // ends of capsules, as authors write them

/// `v`, turned with `from` by the least rotation to `to`, both of them unit vectors.
Vec3 turnedWith(Vec3 v, Vec3 from, Vec3 to) {
  const Vec3 about = cross(from, to);
  const double cosine = dot(from, to);
  if (cosine < -1 + 1e-12) return v;  // straight back: any perpendicular vector will do
  // Rodrigues' formula, with (1 − cos)/sin² = 1/(1 + cos)
  return v * cosine + cross(about, v) + about * (dot(about, v) / (1 + cosine));
}

Vec3 zeroBeside(Vec3 axis) {
  const Vec3 size{std::fabs(axis.x), std::fabs(axis.y), std::fabs(axis.z)};
  const Vec3 most = size.x <= size.y && size.x <= size.z ? Vec3{1, 0, 0}
                    : size.y <= size.z                   ? Vec3{0, 1, 0}
                                                         : Vec3{0, 0, 1};
  return normalized(most - axis * dot(axis, most));
}

}  // namespace

std::optional<TubeAxes> TubeAxes::of(const FieldGroup& group) {
  TubeAxes axes;
  for (const FieldPart& part : group.parts) {
    if (const auto* const capsule = std::get_if<CapsulePart>(&part.shape)) {
      axes.add(capsule->a_m, capsule->b_m, capsule->radius_a_m, capsule->radius_b_m);
    } else if (const auto* const tube = std::get_if<TubePart>(&part.shape)) {
      for (std::size_t i = 1; i < tube->points.size(); ++i)
        axes.add(tube->points[i - 1].at_m, tube->points[i].at_m, tube->points[i - 1].radius_m,
                 tube->points[i].radius_m);
    } else {
      return std::nullopt;
    }
  }
  return axes.pieces_.empty() ? std::nullopt : std::optional(std::move(axes));
}

void TubeAxes::add(Vec3 a_m, Vec3 b_m, double radius_a_m, double radius_b_m) {
  const double length_m = norm(b_m - a_m);
  if (!(length_m > kSamePlace_m)) return;
  Piece piece{a_m, (b_m - a_m) / length_m, {}, length_m, 0, radius_a_m, (radius_b_m - radius_a_m) / length_m};
  piece.zero = zeroBeside(piece.axis);
  if (!pieces_.empty()) {
    const Piece& before = pieces_.back();
    if (norm(before.from_m + before.axis * before.length_m - a_m) <= kSamePlace_m) {
      piece.along_m = before.along_m + before.length_m;
      piece.zero = turnedWith(before.zero, before.axis, piece.axis);
    }
  }
  pieces_.push_back(piece);
}

TubePlace TubeAxes::at(Vec3 p_m) const noexcept {
  const Piece* nearest = nullptr;
  double least_m = std::numeric_limits<double>::infinity(), along_m = 0;
  for (const Piece& piece : pieces_) {
    const Vec3 way = p_m - piece.from_m;
    const double foot_m = std::clamp(dot(way, piece.axis), 0.0, piece.length_m);
    const double away_m = norm(way - piece.axis * foot_m) - (piece.radius_m + piece.growth * foot_m);
    if (!(away_m < least_m)) continue;
    least_m = away_m;
    nearest = &piece;
    along_m = foot_m;
  }
  const Vec3 out = p_m - (nearest->from_m + nearest->axis * along_m);
  return {nearest->along_m + along_m, norm(out),
          std::atan2(dot(out, cross(nearest->axis, nearest->zero)), dot(out, nearest->zero))};
}

}  // namespace needlelab
