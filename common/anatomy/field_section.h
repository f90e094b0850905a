/// A field cut by a plane: which structure lies at each point of a grid. For drawings.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "common/anatomy/field.h"

namespace needlelab {

/// A rectangle in space, divided into width × height points: the middles of its pixels.
struct SectionFrame {
  Vec3 corner_m;            ///< its lower left corner
  Vec3 across_m, upward_m;  ///< its sides, perpendicular to each other
  int width = 0, height = 0;

  /// A place of the frame; whole numbers plus a half are the grid's points.
  [[nodiscard]] Vec3 at(double x, double y) const {
    return corner_m + across_m * (x / width) + upward_m * (y / height);
  }
};

struct FieldSection {
  /// A point of a structure, where its name belongs: away from its bounds, up to 4 mm, and not far from the
  /// place that the caller looks at, 10 mm of which weigh as much as 1 mm from the bounds.
  struct Place {
    StructureIndex structure = kOutside;
    double x = 0, y = 0;     ///< in the frame's points
    double clearance_m = 0;  ///< no other structure is nearer
  };
  SectionFrame frame;
  std::vector<StructureIndex> structures;  ///< rows from bottom to top; kOutside outside of the skin
  std::vector<Place> places;               ///< one for each structure that is seen, by structure

  [[nodiscard]] StructureIndex at(int x, int y) const {
    return structures[static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width) +
                      static_cast<std::size_t>(x)];
  }
};

/// `near_m`: what the caller looks at; without it, the frame's middle. Asks the field at a square's middle:
/// if its clearance covers the square, all of it is one structure; otherwise its quarters are asked. A
/// structure smaller than a pixel can be missed. Thread: any; allocates.
FieldSection sectionOf(const Field& field, const SectionFrame& frame,
                       const std::optional<Vec3>& near_m = std::nullopt);

}  // namespace needlelab
