#include "common/anatomy/field_section.h"

#include <algorithm>
#include <array>
#include <cassert>

namespace needlelab {
namespace {

constexpr double kClear_m = 4e-3, kNear = 0.1;  // FieldSection::Place
constexpr int kTile = 32;  // points along the edge of a square with its own list of parts

class Sectioner {
 public:
  Sectioner(const Field& field, const SectionFrame& frame, Vec3 near_m)
      : field_(field), frame_(frame), near_m_(near_m) {
    section_.frame = frame;
    section_.structures.assign(static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height),
                               kOutside);
    best_m_.fill(-1);
    point_m_ = std::max(norm(frame.across_m) / frame.width, norm(frame.upward_m) / frame.height);
  }

  FieldSection make() {
    for (int y = 0; y < frame_.height; y += kTile)
      for (int x = 0; x < frame_.width; x += kTile) {
        constexpr double kHalf = 0.5 * kTile;
        parts_ = field_.inBall(frame_.at(x + kHalf, y + kHalf), 1.42 * kHalf * point_m_);
        square(x, y, kTile);
      }
    for (std::size_t i = 0; i < kMaxFieldStructures; ++i)
      if (places_[i].structure != kOutside) section_.places.push_back(places_[i]);
    return std::move(section_);
  }

 private:
  void square(int x, int y, int size) {
    if (x >= frame_.width || y >= frame_.height) return;
    const double half = 0.5 * size;
    const FieldPoint point = parts_.at(frame_.at(x + half, y + half));
    // from the middle to the farthest of its points
    if (size == 1 || point.clearance_m > 1.4143 * (half - 0.5) * point_m_) {
      if (point.structure == kOutside) return;
      const int to_x = std::min(x + size, frame_.width), to_y = std::min(y + size, frame_.height);
      for (int row = y; row < to_y; ++row)
        std::fill_n(section_.structures.begin() + static_cast<std::ptrdiff_t>(row) * frame_.width + x,
                    to_x - x, point.structure);
      if (x + half < frame_.width && y + half < frame_.height) name(point, x + half, y + half);
      return;
    }
    const int part = size / 2;
    for (const int dy : {0, part})
      for (const int dx : {0, part}) square(x + dx, y + dy, part);
  }

  void name(const FieldPoint& point, double x, double y) {
    const double far_m = kNear * norm(frame_.at(x, y) - near_m_);
    double& best_m = best_m_[point.structure];
    if (!(std::min(point.clearance_m, kClear_m) - far_m > best_m)) return;
    // beyond its ball the list of parts knows nothing
    const double clearance_m = field_.at(frame_.at(x, y)).clearance_m;
    if (!(std::min(clearance_m, kClear_m) - far_m > best_m)) return;
    best_m = std::min(clearance_m, kClear_m) - far_m;
    places_[point.structure] = {point.structure, x, y, clearance_m};
  }

  const Field& field_;
  const SectionFrame& frame_;
  Vec3 near_m_;
  double point_m_ = 0;
  Field::InBall parts_;
  std::array<FieldSection::Place, kMaxFieldStructures> places_{};
  std::array<double, kMaxFieldStructures> best_m_{};
  FieldSection section_;
};

}  // namespace

FieldSection sectionOf(const Field& field, const SectionFrame& frame, const std::optional<Vec3>& near_m) {
  assert(frame.width > 0 && frame.height > 0);
  return Sectioner(field, frame, near_m.value_or(frame.at(0.5 * frame.width, 0.5 * frame.height))).make();
}

}  // namespace needlelab
