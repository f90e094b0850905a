#include "common/anatomy/march.h"

#include <algorithm>
#include <cassert>

namespace needlelab {
namespace {

/// Narrows a boundary between two places of a line to kBoundary_m; returns the place behind it. Where the
/// boundary lies between them follows from the clearances of both (regula falsi, Illinois' variant); every
/// third step halves, because a clearance may be of another boundary.
double boundary(const Field::OnLine& line, double low_m, FieldPoint low, double high_m,
                FieldPoint high) noexcept {
  const StructureIndex before = low.structure;
  bool was_low = false;
  for (int i = 0; high_m - low_m > kBoundary_m; ++i) {
    const double sum_m = low.clearance_m + high.clearance_m;
    const double share = i % 3 == 2 || !(sum_m > 0) ? 0.5 : low.clearance_m / sum_m;
    const double guess_m = low_m + share * (high_m - low_m);
    const double middle_m =
        std::min(std::max(guess_m, low_m + 0.4 * kBoundary_m), high_m - 0.4 * kBoundary_m);
    const FieldPoint middle = line.at(middle_m);
    const bool is_low = middle.structure == before;
    if (is_low) {
      low_m = middle_m;
      low.clearance_m = middle.clearance_m;
      if (i > 0 && was_low) high.clearance_m *= 0.5;
    } else {
      high_m = middle_m;
      high.clearance_m = middle.clearance_m;
      if (i > 0 && !was_low) low.clearance_m *= 0.5;
    }
    was_low = is_low;
  }
  return high_m;
}

/// Adds a layer. If the last one is a sliver, it goes to the layer before it; the first one to the layer
/// behind it. Returns false if the stack is full.
bool append(LayerStack& stack, StructureIndex structure, double top_m, double min_m) noexcept {
  if (stack.count > 0 && top_m - stack.layers[stack.count - 1].top_m < min_m) {
    if (stack.count == 1) {
      stack.layers[0].structure = structure;
      return true;
    }
    --stack.count;
    if (stack.layers[stack.count - 1].structure == structure) return true;
  }
  if (stack.count == kMaxStackLayers) return false;
  stack.layers[stack.count++] = {structure, top_m};
  return true;
}

}  // namespace

LayerStack march(const Field& field, Vec3 entry_m, Vec3 axis, const MarchOptions& options) noexcept {
  assert(options.reach_m > 0 && options.min_step_m > kBoundary_m && options.min_layer_m >= 0);
  const Field::OnLine line = field.onLine(entry_m, axis);
  LayerStack stack;
  stack.end_m = options.reach_m;
  // the entry itself is on the skin, so the first layer is that of the first step
  double before_m = options.min_step_m;
  FieldPoint before = line.at(before_m);
  if (before.structure == kOutside) {
    stack.end = StackEnd::kExit;
    stack.end_m = 0;
    return stack;
  }
  if (field.structures()[before.structure].layer.is_bone) {
    stack.end = StackEnd::kBone;
    stack.end_m = 0;
  }
  (void)append(stack, before.structure, 0, options.min_layer_m);
  while (before_m < options.reach_m && stack.end == StackEnd::kReach) {
    const double next_m =
        std::min(before_m + std::max(before.clearance_m, options.min_step_m), options.reach_m);
    const FieldPoint next = line.at(next_m);
    if (next.structure == before.structure) {
      before_m = next_m;
      before = next;
      continue;
    }
    before_m = stack.end_m = boundary(line, before_m, before, next_m, next);
    before = line.at(before_m);
    if (before.structure == kOutside) {
      stack.end = StackEnd::kExit;
    } else if (!append(stack, before.structure, before_m, options.min_layer_m)) {
      stack.end = StackEnd::kFull;
    } else if (field.structures()[before.structure].layer.is_bone) {
      stack.end = StackEnd::kBone;
    } else {
      stack.end_m = options.reach_m;
    }
  }
  return stack;
}

std::optional<double> findEntry(const Field& field, Vec3 from_m, Vec3 axis, double reach_m) noexcept {
  const Field::OnLine line = field.onLine(from_m, axis);
  double t_m = 0;
  FieldPoint here = line.at(t_m);
  if (here.structure != kOutside) return std::nullopt;
  while (t_m < reach_m) {
    const double next_m = t_m + std::max(here.clearance_m, 1e-4);
    const FieldPoint next = line.at(next_m);
    if (next.structure != kOutside) return boundary(line, t_m, here, next_m, next);
    t_m = next_m;
    here = next;
  }
  return std::nullopt;
}

}  // namespace needlelab
