#include "common/haptics/body/next_path.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/line_layers.h"
#include "common/haptics/effects/puncture.h"
#include "common/haptics/tick.h"

namespace needlelab {
namespace {

/// Layers that were met stay met on a path whose tops there differ by no more than this.
constexpr double kSameTop_m = 0.3e-3;
/// A membrane of one structure is the same on the next path if it is no farther away there.
constexpr double kSameMembrane_m = 2e-3;

/// How many layers two paths have in common, from the skin inwards.
std::uint32_t commonLayers(const PathStack& a, const PathStack& b) {
  const std::uint32_t most = std::min(a.model.layer_count, b.model.layer_count);
  std::uint32_t i = 0;
  while (i < most && a.reported[i] == b.reported[i] &&
         std::fabs(a.model.layers[i].top_m - b.model.layers[i].top_m) <= kSameTop_m)
    ++i;
  return i;
}

/// Whether a path has a layer of this structure within a stretch of depth.
bool has(const PathStack& path, std::int8_t structure, double from_m, double to_m) {
  for (std::uint32_t i = 0; i < path.model.layer_count; ++i)
    if (path.reported[i] == structure && path.model.layers[i].top_m < to_m &&
        path.model.layers[i].bottom_m > from_m)
      return true;
  return false;
}

/// Whether the tip went through a whole layer that the path before did not have, since that was found.
bool skips(const PathStack& before, const PathStack& next, double depth_m) {
  for (std::uint32_t i = 0; i < next.model.layer_count; ++i) {
    const CompiledLayer& layer = next.model.layers[i];
    if (layer.bottom_m > depth_m) return false;
    if (layer.top_m >= before.path.asked_depth_m &&
        !has(before, next.reported[i], layer.top_m, layer.bottom_m))
      return true;
  }
  return false;
}

/// The membranes of an insertion on its next path. Those that the paths have in common keep what became of
/// them, and so do those behind the tip that are the same. One that holds the needle goes on holding it from
/// the same place. One that came to lie close behind the tip, as that went on while the path was made, or as
/// the line turned, is met where the tip is: the last of them, as the others are behind it. Those farther
/// behind the tip are open. Returns whether one that held the needle is gone.
bool moveMembranes(const PathStack& before, const PathStack& next, double last_top_m, double x_m,
                   SimState& state) {
  const SceneModel &was = before.model, &model = next.model;
  const double x_cut_m = cuttingPosition(state, x_m);
  // ahead of the tip the memory of the cut knows the holes, by their places
  const double kept_m =
      model.isLive(Effect::kCutMemory) ? std::min(last_top_m, state.depth_prev_m) : last_top_m;
  std::uint32_t holding = intactMembranes(state), met = 0, ruptured = 0, opened = 0, late = 0;
  std::array<double, kMaxLayers> places;
  for (; met < model.membrane_count; ++met) {
    const double top_m = model.membranes[met].top_m;
    const std::uint32_t bit = 1u << met;
    const bool same = top_m <= kept_m;
    if (same && met < state.membranes_met) {
      ruptured |= state.membranes_ruptured & bit;
      opened |= state.cuts.opened & bit;
      holding &= ~bit;
      places[met] = state.membrane_place_m[met];
      continue;
    }
    const auto sameAs = [&](std::uint32_t among) {
      for (; among != 0; among &= among - 1) {
        const auto i = static_cast<std::uint32_t>(std::countr_zero(among));
        if (was.membrane_ids[i] == model.membrane_ids[met] &&
            std::fabs(was.membranes[i].top_m - top_m) <= kSameMembrane_m)
          return i;
      }
      return static_cast<std::uint32_t>(kMaxLayers);
    };
    if (const std::uint32_t held = sameAs(holding); held < kMaxLayers) {
      holding &= ~(1u << held);
      places[met] = state.membrane_place_m[held];
      continue;
    }
    if (top_m > state.depth_prev_m) break;
    places[met] = x_m;
    if (sameAs(state.membranes_ruptured) == kMaxLayers && top_m > next.path.asked_depth_m - kSameMembrane_m) {
      ruptured |= late;
      opened |= late;
      late = bit;
    } else {
      ruptured |= bit;
      opened |= bit;
    }
  }
  state.membranes_met = met;
  state.membranes_ruptured = ruptured;
  state.cuts.opened = opened;
  std::copy_n(places.begin(), met, state.membrane_place_m.begin());
  // where one is gone the walls follow the tip, and their forces do not change
  const double follow_m = cuttingPosition(state, x_m) - x_cut_m;
  state.wall_m += follow_m;
  state.friction_wall_m += follow_m;
  return holding != 0;
}

/// Likewise the tops of GOD_OBJECT.
void moveTops(const PathStack& next, std::uint32_t common, double x_m, SimState& state) {
  if (state.tops_met == 0) return;
  state.tops_met = std::min(state.tops_met, common);
  for (; state.tops_met < next.model.layer_count &&
         next.model.layers[state.tops_met].top_m <= state.depth_prev_m;
       ++state.tops_met)
    state.top_place_m[state.tops_met] = x_m - state.x_shift_m;
  if (state.proxy_layer < common && state.proxy_layer < state.tops_met) return;
  state.proxy_layer = state.tops_met - 1;
  state.proxy_held = false;
}

}  // namespace

// the layers along the shaft stay; the tip is in the layer that the new path has there
std::uint32_t continueOn(const PathStack& before, PathStack& next, SimState& state) noexcept {
  assert(state.inside);
  std::uint32_t flags = 0;
  SceneModel& model = next.model;
  model.plane_point_m = before.model.plane_point_m;  // as it gave way
  model.plane_normal = before.model.plane_normal;
  model.limb = before.model.limb;
  const double x_m = dot(state.u_W, state.p_prev_W_m - state.p_entry_W_m);
  const std::uint32_t common = commonLayers(before, next);
  const bool has_membranes =
      model.isLive(Effect::kPuncture) || axialEntry(model.axial_model).topOf != nullptr;
  if ((has_membranes || state.membranes_met > 0) &&  // the next path may have no membrane
      moveMembranes(before, next, common > 0 ? model.layers[common - 1].top_m : -1.0, x_m, state))
    flags |= kFlagLayerChange;
  moveTops(next, common, x_m, state);
  if (skips(before, next, state.depth_prev_m)) flags |= kFlagSkipped;
  const std::uint32_t layer = findLayer(model, state.depth_prev_m, 0);
  if (next.reported[layer] != before.reported[state.layer]) flags |= kFlagLayerChange;
  // OKAMURA and DAHL look along the shaft for a layer's own numbers
  for (std::uint32_t i = 0; i < state.along.count; ++i) {
    std::int64_t& index = state.along.spans[i].layer;
    if (index < 0) continue;
    const std::int8_t structure = before.reported[static_cast<std::size_t>(index)];
    std::uint32_t there = 0;
    while (there < model.layer_count && next.reported[there] != structure) ++there;
    index = there < model.layer_count ? there : std::min<std::int64_t>(index, layer);
  }
  state.layer = layer;
  relayLayers(model, state);
  return flags;
}

}  // namespace needlelab
