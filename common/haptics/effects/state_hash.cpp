#include "common/haptics/state_hash.h"

#include <algorithm>
#include <cassert>

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

std::uint64_t hashOf(const SimState& state) {
  StateHash hash;
  hash.add(state.p_prev_W_m);
  hash.add(state.depth_prev_m);
  hash.add(std::uint64_t{state.has_prev} | std::uint64_t{state.outside_once} << 1 |
           std::uint64_t{state.inside} << 2 | std::uint64_t{state.inside && state.past_middle} << 3);
  hash.add(state.insertions);
  for (const EffectEntry* entry : effectEntries())
    if (entry->hashLasting != nullptr) entry->hashLasting(state, hash);
  if (!state.inside) return hash.value();

  // the other members matter only during an insertion
  assert(state.history_mask < kHistoryCapacity);
  assert(state.membranes_met <= kMaxLayers && state.tops_met <= kMaxLayers);
  assert(state.needle.stations <= kMaxNeedleStations && state.cuts.count <= kMaxCutTracks);
  hash.add(static_cast<std::uint64_t>(state.phase));
  for (const Vec3 v :
       {state.p_entry_W_m, state.normal_W, state.u_W, state.u0_W, state.aim_W, state.p_hole_W_m})
    hash.add(v);
  hash.add(state.slant);
  hash.add(std::uint64_t{state.layer});
  hash.add(state.ticks_inside);
  hash.add(state.x_shift_m);
  const std::uint64_t kept = std::min(state.ticks_inside, state.history_mask) + 1;
  for (std::uint64_t i = 0; i < kept; ++i)
    hash.add(state.x_history_m[(state.ticks_inside - i) & state.history_mask]);
  hash.add(state.wall_m);
  hash.add(std::uint64_t{state.stopped} | std::uint64_t{state.armed} << 1 |
           std::uint64_t{state.moves_in} << 2);
  for (const std::uint64_t tick : {state.fast_tick, state.band_tick, state.across_tick}) hash.add(tick);
  hash.add(state.across_from_W_m);
  for (const Relaxation& rest : {state.wall_rest, state.friction_rest}) {
    hash.add(rest.ramp_ticks);
    for (const double d : {rest.step_m, rest.way_m, rest.stretch_m}) hash.add(d);
  }
  for (const double d : {state.wall_stiffness_N_per_m, state.band_low_m, state.band_high_m,
                         state.stop_least_m, state.friction_wall_m})
    hash.add(d);
  hash.add(std::uint64_t{state.tilt_limit_is_cone});
  hash.add(state.tilt_limit_rad);
  hash.add(state.tilt_limit_insertion_m);
  hash.add(std::uint64_t{state.table_row} | std::uint64_t{state.proxy_layer} << 32);
  hash.add(std::uint64_t{state.proxy_held} | static_cast<std::uint64_t>(state.score.cell + 1) << 1);
  hash.add(std::uint64_t{state.tops_met});
  for (std::uint32_t i = 0; i < state.tops_met; ++i) hash.add(state.top_place_m[i]);
  hash.add(std::uint64_t{state.membranes_met} | std::uint64_t{state.membranes_ruptured} << 32);
  for (std::uint32_t i = 0; i < state.membranes_met; ++i) hash.add(state.membrane_place_m[i]);
  for (std::size_t i = 0; i < kMaxStages; ++i) {
    // scenes without stages keep their hash from before stages existed
    if (std::all_of(state.stage[i].begin(), state.stage[i].end(), [](double d) { return d == 0.0; }))
      continue;
    hash.add(std::uint64_t{i});
    for (const double d : state.stage[i]) hash.add(d);
  }
  // scenes with other models keep their hash from before OKAMURA existed
  if (state.slid_m != 0.0) hash.add(state.slid_m);
  for (const EffectEntry* entry : effectEntries())
    if (entry->hash != nullptr) entry->hash(state, hash);
  const NeedleState& needle = state.needle;
  if (needle.stations == 0) return hash.value();
  for (const double d : {needle.x_m, needle.cut_m, needle.gap_m, needle.tip_N, needle.tip_most_N})
    hash.add(d);
  hash.add(static_cast<std::uint64_t>(needle.tip_hold));
  for (std::uint32_t i = 0; i < needle.stations; ++i) {
    hash.add(needle.shaft_N[i]);
    hash.add(needle.moved_m[i]);
    hash.add(static_cast<std::uint64_t>(needle.hold[i]));
  }
  return hash.value();
}

}  // namespace needlelab
