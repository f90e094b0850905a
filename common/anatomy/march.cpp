#include "common/anatomy/march.h"

#include <algorithm>
#include <cassert>

namespace needlelab {
namespace {

/// A line is walked in stretches of this length: on a short one few parts of the field matter.
constexpr double kStretch_m = 0.006;

/// Where a walk along a line is, and the stretch that it is on.
class Walk {
 public:
  Walk(const Field& field, Vec3 from_m, Vec3 axis, double at_m, double reach_m) noexcept
      : line_(field.onLine(from_m, axis)), reach_m_(reach_m) {
    begin(at_m);
  }
  [[nodiscard]] double at_m() const { return at_m_; }
  [[nodiscard]] const FieldPoint& here() const { return here_; }
  [[nodiscard]] const Field::Stretch& stretch() const { return stretch_; }
  /// The next place: as far as the clearance allows, at least `min_step_m`, at most to the stretch's end.
  double next(double min_step_m) noexcept {
    if (at_m_ + min_step_m >= end_m_ && end_m_ < reach_m_) {
      [[maybe_unused]] const StructureIndex before = here_.structure;
      begin(at_m_);
      assert(here_.structure == before);  // a stretch has the bits of the whole field
    }
    return std::min(at_m_ + std::max(here_.clearance_m, min_step_m), end_m_);
  }
  void go(double to_m, const FieldPoint& there) noexcept {
    at_m_ = to_m;
    here_ = there;
  }

 private:
  void begin(double at_m) noexcept {
    end_m_ = std::min(at_m + kStretch_m, reach_m_);
    stretch_ = line_.between(at_m, end_m_);
    go(at_m, stretch_.at(at_m));
  }
  Field::OnLine line_;
  Field::Stretch stretch_;
  double reach_m_, at_m_ = 0, end_m_ = 0;
  FieldPoint here_;
};

/// Narrows a boundary between two places of a line to kBoundary_m; returns the place behind it. Where the
/// boundary lies between them follows from the clearances of both (regula falsi, Illinois' variant); every
/// third step halves, because a clearance may be of another boundary.
double boundary(const Field::Stretch& stretch, double low_m, FieldPoint low, double high_m,
                FieldPoint high) noexcept {
  const StructureIndex before = low.structure;
  bool was_low = false;
  for (int i = 0; high_m - low_m > kBoundary_m; ++i) {
    const double sum_m = low.clearance_m + high.clearance_m;
    const double share = i % 3 == 2 || !(sum_m > 0) ? 0.5 : low.clearance_m / sum_m;
    const double guess_m = low_m + share * (high_m - low_m);
    const double middle_m =
        std::min(std::max(guess_m, low_m + 0.4 * kBoundary_m), high_m - 0.4 * kBoundary_m);
    const FieldPoint middle = stretch.at(middle_m);
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
  LayerStack stack;
  stack.end_m = options.reach_m;
  // the entry itself is on the skin, so the first layer is that of the first step
  Walk walk(field, entry_m, axis, std::min(options.min_step_m, options.reach_m), options.reach_m);
  if (walk.here().structure == kOutside) {
    stack.end = StackEnd::kExit;
    stack.end_m = 0;
    return stack;
  }
  const auto ends = [&](StructureIndex structure) {
    return options.at_bone == AtBone::kEnds && field.structures()[structure].layer.is_bone;
  };
  if (ends(walk.here().structure)) {
    stack.end = StackEnd::kBone;
    stack.end_m = 0;
  }
  (void)append(stack, walk.here().structure, 0, options.min_layer_m);
  while (walk.at_m() < options.reach_m && stack.end == StackEnd::kReach) {
    const double next_m = walk.next(options.min_step_m);
    const FieldPoint next = walk.stretch().at(next_m);
    if (next.structure == walk.here().structure) {
      walk.go(next_m, next);
      continue;
    }
    const double top_m = boundary(walk.stretch(), walk.at_m(), walk.here(), next_m, next);
    walk.go(top_m, walk.stretch().at(top_m));
    stack.end_m = top_m;
    if (walk.here().structure == kOutside) {
      stack.end = StackEnd::kExit;
    } else if (!append(stack, walk.here().structure, top_m, options.min_layer_m)) {
      stack.end = StackEnd::kFull;
    } else if (ends(walk.here().structure)) {
      stack.end = StackEnd::kBone;
    } else {
      stack.end_m = options.reach_m;
    }
  }
  return stack;
}

std::optional<double> findEntry(const Field& field, Vec3 from_m, Vec3 axis, double reach_m) noexcept {
  Walk walk(field, from_m, axis, 0, reach_m);
  if (walk.here().structure != kOutside) return std::nullopt;
  while (walk.at_m() < reach_m) {
    const double next_m = walk.next(1e-4);
    const FieldPoint next = walk.stretch().at(next_m);
    if (next.structure != kOutside) return boundary(walk.stretch(), walk.at_m(), walk.here(), next_m, next);
    walk.go(next_m, next);
  }
  return std::nullopt;
}

}  // namespace needlelab
