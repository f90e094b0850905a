#include "common/anatomy/inner_point.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <queue>
#include <variant>
#include <vector>

namespace needlelab {
namespace {

constexpr double kTolerance_m = 1e-4, kToleranceShare = 0.05;
constexpr int kMostCells = 8000;
/// Where nothing bounds the search: this far from the origin, or around what is bounded.
constexpr double kFarthest_m = 0.2, kAround_m = 0.05;
constexpr double kFinest_m = 1e-5;  // of the search around the best cell

struct Box {
  Vec3 low, high;
  bool bounded = true;
};

Box everywhere() {
  return {{-kFarthest_m, -kFarthest_m, -kFarthest_m}, {kFarthest_m, kFarthest_m, kFarthest_m}, false};
}

Box grown(Box box, double by_m) {
  const Vec3 by{by_m, by_m, by_m};
  return {box.low - by, box.high + by, box.bounded};
}

void widen(Box& box, Vec3 p_m, double radius_m) {
  box.low = {std::min(box.low.x, p_m.x - radius_m), std::min(box.low.y, p_m.y - radius_m),
             std::min(box.low.z, p_m.z - radius_m)};
  box.high = {std::max(box.high.x, p_m.x + radius_m), std::max(box.high.y, p_m.y + radius_m),
              std::max(box.high.z, p_m.z + radius_m)};
}

/// What both contain; an unbounded one contains the other.
Box common(const Box& a, const Box& b) {
  if (!a.bounded) return b;
  if (!b.bounded) return a;
  return {{std::max(a.low.x, b.low.x), std::max(a.low.y, b.low.y), std::max(a.low.z, b.low.z)},
          {std::min(a.high.x, b.high.x), std::min(a.high.y, b.high.y), std::min(a.high.z, b.high.z)}};
}

/// A box around a group's points; blends grow it by less than their distances.
Box boxOf(const FieldGroup& group) {
  Box box{{1e3, 1e3, 1e3}, {-1e3, -1e3, -1e3}};
  double blend_m = 0;
  for (const FieldPart& part : group.parts) {
    blend_m += part.blend_m;
    if (const auto* const capsule = std::get_if<CapsulePart>(&part.shape)) {
      widen(box, capsule->a_m, capsule->radius_a_m);
      widen(box, capsule->b_m, capsule->radius_b_m);
    } else if (const auto* const ellipsoid = std::get_if<EllipsoidPart>(&part.shape)) {
      const Vec3 r = ellipsoid->radii_m;
      widen(box, ellipsoid->center_m, std::max({r.x, r.y, r.z}));
    } else if (const auto* const tube = std::get_if<TubePart>(&part.shape)) {
      for (const TubePart::Point& point : tube->points) widen(box, point.at_m, point.radius_m);
    } else {
      return everywhere();
    }
  }
  return grown(box, blend_m);
}

Box boxOf(const FieldSpec& spec, const std::string& group) {
  for (const FieldGroup& one : spec.groups)
    if (one.id == group) return boxOf(one);
  return everywhere();
}

/// A box around all points that the rules give to the structure.
Box boxOf(const FieldSpec& spec, std::size_t structure) {
  const std::string& id = spec.structures[structure].id;
  const Box skin = boxOf(spec, spec.skin);
  Box all{{1e3, 1e3, 1e3}, {-1e3, -1e3, -1e3}};
  const auto add = [&](const Box& box) {
    all.bounded = all.bounded && box.bounded;
    widen(all, box.low, 0);
    widen(all, box.high, 0);
  };
  const auto within = [&](const FieldRange& range) {
    return std::isfinite(range.to_m) ? grown(boxOf(spec, range.group), std::max(0.0, range.to_m))
                                     : everywhere();
  };
  if (spec.rest == id) add(skin);
  for (const FieldRule& rule : spec.rules) {
    if (rule.structure != id) continue;
    Box box = common(skin, within(rule.range));
    for (const FieldRange& clip : rule.clips) box = common(box, within(clip));
    if (box.low.x <= box.high.x && box.low.y <= box.high.y && box.low.z <= box.high.z) add(box);
  }
  if (all.bounded) return all;
  // around whatever is bounded
  Box others{{1e3, 1e3, 1e3}, {-1e3, -1e3, -1e3}};
  for (const FieldGroup& group : spec.groups)
    if (const Box box = boxOf(group); box.bounded) widen(others, box.low, 0), widen(others, box.high, 0);
  return others.low.x <= others.high.x ? grown(others, kAround_m) : everywhere();
}

struct Cell {
  Vec3 center_m;
  double half_m = 0;
  double depth_m = 0;
  double most_m = 0;  // depth that no point of it exceeds
  int number = 0;     // in the order of their making: ties are the same on every machine
};
struct LessDeep {
  bool operator()(const Cell& a, const Cell& b) const {
    return a.most_m < b.most_m || (!(b.most_m < a.most_m) && a.number > b.number);
  }
};

}  // namespace

std::optional<InnerPoint> innerPoint(const FieldSpec& spec, const Field& field, StructureIndex structure) {
  assert(structure < spec.structures.size() && structure < field.structures().size());
  const Box box = boxOf(spec, structure);
  if (!(box.low.x <= box.high.x)) return std::nullopt;
  const auto depth = [&](Vec3 p_m) { return -field.structuresDistance(StructureMask{1} << structure, p_m); };
  int cells = 0;
  Cell best;
  const auto made = [&](Vec3 center_m, double half_m) {
    Cell cell{center_m, half_m, depth(center_m), 0, cells++};
    cell.most_m = cell.depth_m + kMostSteep * std::sqrt(3.0) * half_m;
    if (cell.number == 0 || cell.depth_m > best.depth_m) best = cell;
    return cell;
  };

  std::priority_queue<Cell, std::vector<Cell>, LessDeep> open;
  const Vec3 size = box.high - box.low;
  open.push(made((box.low + box.high) * 0.5, 0.5 * std::max({size.x, size.y, size.z})));
  while (!open.empty() && cells < kMostCells) {
    const Cell cell = open.top();
    open.pop();
    const double tolerance_m = std::max(kTolerance_m, kToleranceShare * best.depth_m);
    if (cell.most_m <= std::max(0.0, best.depth_m + tolerance_m)) break;
    const double half_m = 0.5 * cell.half_m;
    for (int corner = 0; corner < 8; ++corner) {
      const auto side = [&](int bit) { return (corner >> bit & 1) != 0 ? half_m : -half_m; };
      const Vec3 center = cell.center_m + Vec3{side(0), side(1), side(2)};
      const bool outside = center.x + half_m < box.low.x || center.x - half_m > box.high.x ||
                           center.y + half_m < box.low.y || center.y - half_m > box.high.y ||
                           center.z + half_m < box.low.z || center.z - half_m > box.high.z;
      if (!outside) open.push(made(center, half_m));
    }
  }

  // the best cell's centre may still be beside a thin structure
  for (double step_m = std::max(best.half_m, kTolerance_m); step_m > kFinest_m;) {
    Vec3 next = best.center_m;
    double next_m = best.depth_m;
    for (const Vec3 way :
         {Vec3{1, 0, 0}, Vec3{-1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, -1, 0}, Vec3{0, 0, 1}, Vec3{0, 0, -1}}) {
      const Vec3 there = best.center_m + way * step_m;
      if (const double there_m = depth(there); there_m > next_m) next = there, next_m = there_m;
    }
    if (next_m > best.depth_m + 0.01 * step_m)
      best.center_m = next, best.depth_m = next_m;
    else
      step_m *= 0.5;
  }
  if (!(best.depth_m > 0) || field.at(best.center_m).structure != structure) return std::nullopt;
  return InnerPoint{best.center_m, best.depth_m};
}

}  // namespace needlelab
