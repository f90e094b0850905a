/// CUT_MEMORY, a stage: tissue that was cut is not cut again (FORCE_MODEL.md, "Memory of the cut"). Along the
/// track of an earlier insertion, cutting takes only a share of the force in intact tissue (spreading
/// remains), and a membrane stays open near its hole. The effect has no force of its own: it moves the wall
/// forward, up to the end of the cut, and opens intact membranes in the tick in which the needle meets them.
/// Both only shorten what is stretched.
///
/// Initial value of `cutting_share`: on average, 61 % of a needle's force in tissue is tearing, 18 %
/// spreading and 21 % friction (Barnett, Lee and Moore 2016); "cutting" here is tearing and spreading, so
/// 18/(61 + 18).
#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/effects/puncture.h"
#include "common/haptics/spec_checker.h"
#include "common/haptics/state_hash.h"

namespace needlelab {
namespace {

constexpr std::size_t kCutOwn = stageOf(Effect::kCutMemory);
// the author's numbers
constexpr std::size_t kCutShare = 0, kCutRadius_m = 1;
/// Larger than the rounding of places, far smaller than a step that can be felt.
constexpr double kPassRounding_m = 1e-12;
/// The shortest extension of a cut that counts as a new cut.
constexpr double kNewCut_m = 1e-6;
/// The squared sine below which two lines diverge by less than a micrometre per metre.
constexpr double kParallel = 1e-12;
/// A membrane is at a hole of its structure that is no farther along the track than this, and at no other
/// membrane of that structure.
constexpr double kSameHole_m = 3e-3;
/// Tolerance that keeps a wall at the side of a track in the track despite rounding.
constexpr double kSide_m = 1e-9;

template <std::size_t kIndex>
double& cutNumber(SceneSpec& spec) {
  return spec.stage_numbers[kCutOwn][kIndex];
}

constexpr std::array<EffectField, 2> kCutFields = {
    {{"cutting_share", "Share of the cutting force along a cut", {0, 1}, 0.23, cutNumber<kCutShare>},
     {"radius_m", "Radius of a cut", {0, 0.01, true}, 0.001, cutNumber<kCutRadius_m>}}};

constexpr double kNoWay = std::numeric_limits<double>::infinity();

Vec3 pointAt(const SimState& state, double x_m) {
  return state.p_entry_W_m + state.u_W * x_m;
}

// a point's position along a track, and its offset from the track's line
struct OnTrack {
  double along_m = 0;
  Vec3 aside_W_m;
  bool near = false;  ///< within the radius of the line
};

OnTrack onTrack(const CutTrack& track, Vec3 p_W_m, double radius_m) {
  const Vec3 arm = p_W_m - track.p_entry_W_m;
  const double along_m = dot(track.u_W, arm);
  const Vec3 aside_W_m = arm - track.u_W * along_m;
  return {along_m, aside_W_m, normSquared(aside_W_m) <= radius_m * radius_m};
}

// how far the tissue is cut along u from a point in a track: to the track's end, or to where u leaves the
// track
double cutFrom(const CutTrack& track, const OnTrack& at, Vec3 u_W, double radius_m) {
  assert(isUnit(u_W) && isUnit(track.u_W));
  const double cosine = dot(u_W, track.u_W);
  if (!(cosine > 0.0)) return at.along_m <= track.length_m ? 0.0 : -kNoWay;
  double cut_m = (track.length_m - at.along_m) / cosine;
  const Vec3 across = u_W - track.u_W * cosine;
  if (const double slope = normSquared(across); slope > kParallel) {
    const double toward_m = dot(at.aside_W_m, across);
    const double room_m2 = std::max(0.0, radius_m * radius_m - normSquared(at.aside_W_m));
    cut_m = std::min(cut_m, (std::sqrt(toward_m * toward_m + slope * room_m2) - toward_m) / slope);
  }
  return cut_m;
}

// the insertion's own track moves with P0 and u, as do all lengths along u; in a body it stays where it was
// cut, and when the line has turned away from it it is an earlier one
void turnOwnTrack(const SceneModel& model, SimState& state) {
  CutMemory& cuts = state.cuts;
  if (cuts.own < kMaxCutTracks) {
    CutTrack& own = cuts.tracks[cuts.own];
    if (!model.in_body) {
      own.p_entry_W_m = state.p_entry_W_m;
      own.u_W = state.u_W;
    } else if (const Vec3 end = own.p_entry_W_m + own.u_W * own.length_m - state.p_entry_W_m;
               normSquared(end - state.u_W * dot(state.u_W, end)) >
               model.stage_numbers[kCutOwn][kCutRadius_m] * model.stage_numbers[kCutOwn][kCutRadius_m]) {
      cuts.own = kMaxCutTracks;
      cuts.shift_m = state.x_shift_m;
      return;
    }
    const double shift_m = state.x_shift_m - cuts.shift_m;
    own.length_m += shift_m;
    for (std::uint32_t i = 0; i < own.hole_count; ++i) own.holes[i].at_m += shift_m;
  }
  cuts.shift_m = state.x_shift_m;
}

// whether one of a track's holes is that of a membrane at `along_m` of it
bool isHole(const SceneModel& model, const SimState& state, std::size_t membrane, const CutTrack& track,
            double along_m) {
  const CompiledMembrane& here = model.membranes[membrane];
  for (std::uint32_t i = 0; i < track.hole_count; ++i) {
    const CutHole& hole = track.holes[i];
    const double off_m = std::fabs(along_m - hole.at_m);
    if (hole.id != model.membrane_ids[membrane] || off_m > kSameHole_m) continue;
    bool nearest = true;
    for (std::uint32_t other = 0; other < model.membrane_count && nearest; ++other) {
      if (other == membrane || model.membrane_ids[other] != hole.id) continue;
      const double there_m = along_m + (model.membranes[other].top_m - here.top_m) * state.inverse_slant;
      nearest = std::fabs(there_m - hole.at_m) >= off_m;
    }
    if (nearest) return true;
  }
  return false;
}

bool hasHole(const SceneModel& model, const SimState& state, std::size_t membrane, double radius_m) {
  const std::uint8_t id = model.membrane_ids[membrane];
  assert(id < kMaxLayers && state.cuts.count <= kMaxCutTracks);
  const Vec3 p_W_m = pointAt(state, state.membrane_place_m[membrane]);
  for (std::uint32_t i = 0; i < state.cuts.count; ++i) {
    const CutTrack& track = state.cuts.tracks[i];
    if ((track.membranes >> id & 1u) == 0) continue;
    const OnTrack at = onTrack(track, p_W_m, radius_m);
    if (at.near && (!model.in_body || isHole(model, state, membrane, track, at.along_m))) return true;
  }
  return false;
}

// opens the membranes that the needle meets at a hole; returns the change of the force along u
double openMembranes(const SceneModel& model, SimState& state, double x_m, double x_before_m,
                     StepReport& report) {
  const double radius_m = model.stage_numbers[kCutOwn][kCutRadius_m];
  std::uint32_t open = 0;
  bool held_before = false;
  for (std::uint32_t left = intactMembranes(state); left != 0; left &= left - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left));
    if (!hasHole(model, state, i, radius_m)) continue;
    open |= 1u << i;
    held_before = held_before || x_before_m > state.membrane_place_m[i];
  }
  if (open == 0) return 0.0;
  // as in a rupture: the walls follow the tip, and their forces do not change
  const double x_cut_before_m = cuttingPosition(state, x_m);
  state.membranes_ruptured |= open;
  state.cuts.opened |= open;
  const double follow_m = cuttingPosition(state, x_m) - x_cut_before_m;
  state.wall_m += follow_m;
  state.friction_wall_m += follow_m;
  if (held_before) report.flags |= kFlagRupture;
  const double before_N = report.puncture_N;
  report.puncture_N = membranesForce(model, state, x_m);
  return report.puncture_N - before_N;
}

// the place along u up to which the tissue at the wall is cut; less than the wall's own place if it is not
// cut
double endOfCut(const SceneModel& model, const SimState& state) {
  const CutMemory& cuts = state.cuts;
  const double radius_m = model.stage_numbers[kCutOwn][kCutRadius_m];
  const Vec3 wall_W_m = pointAt(state, state.wall_m);
  double end_m = cuts.own < kMaxCutTracks ? std::max(0.0, cuts.tracks[cuts.own].length_m) : 0.0;
  for (std::uint32_t i = 0; i < cuts.count; ++i) {
    if (i == cuts.own) continue;
    const CutTrack& track = cuts.tracks[i];
    const OnTrack at = onTrack(track, wall_W_m, radius_m + kSide_m);
    if (at.near && at.along_m >= -radius_m)
      end_m = std::max(end_m, state.wall_m + cutFrom(track, at, state.u_W, radius_m));
  }
  return end_m;
}

// moves the wall forward to where a cut's smaller force holds it; returns the change of the force along u
double followCut(const SceneModel& model, SimState& state, double x_m, double x_before_m, double end_m,
                 StepReport& report) {
  assert(model.cut_reach != nullptr);
  const double x_cut_m = cuttingPosition(state, x_m);
  const double reach_m =
      model.stage_numbers[kCutOwn][kCutShare] * model.cut_reach(model, state, report.depth_m);
  const double to_m = std::min(x_cut_m - reach_m, end_m);
  const double move_m = to_m - state.wall_m;
  if (!(move_m > 0.0)) return 0.0;
  // the needle entered an old cut from the side: a release, as on entering a softer layer
  if (move_m > std::max(0.0, x_m - x_before_m) + kPassRounding_m) report.flags |= kFlagLayerChange;
  state.wall_m = to_m;
  const double before_N = report.cutting_N + report.attracted_N;
  report.cutting_N = -model.layers[state.layer].wall_stiffness_N_per_m * (x_cut_m - to_m);
  report.attracted_N = 0.0;
  return report.cutting_N - before_N;
}

// the index of this insertion's track: a track that it extends along the same line, otherwise the next free
// one
std::uint32_t placeOfTrack(CutMemory& cuts, const SimState& state, double radius_m, bool wall_cuts) {
  const Vec3 wall_W_m = pointAt(state, state.wall_m);
  for (std::uint32_t i = 0; wall_cuts && i < cuts.count; ++i) {
    const CutTrack& track = cuts.tracks[i];
    const OnTrack wall = onTrack(track, wall_W_m, radius_m);
    if (wall.near && wall.along_m >= track.length_m && onTrack(track, state.p_entry_W_m, radius_m).near)
      return i;
  }
  assert(cuts.next < kMaxCutTracks);
  assert(cuts.count == kMaxCutTracks || cuts.next == cuts.count);
  const std::uint32_t place = cuts.next;
  cuts.next = (cuts.next + 1) % static_cast<std::uint32_t>(kMaxCutTracks);
  cuts.count = std::min(cuts.count + 1, static_cast<std::uint32_t>(kMaxCutTracks));
  cuts.tracks[place] = {};
  return place;
}

// membranes by their numbers as a set of their ids
std::uint32_t idsOf(const SceneModel& model, std::uint32_t membranes) {
  std::uint32_t ids = 0;
  for (; membranes != 0; membranes &= membranes - 1)
    ids |= 1u << model.membrane_ids[static_cast<std::size_t>(std::countr_zero(membranes))];
  return ids;
}

// records what is newly cut or ruptured
void record(const SceneModel& model, SimState& state, double end_m, bool wall_cuts) {
  CutMemory& cuts = state.cuts;
  if (cuts.own == kMaxCutTracks) {
    const bool cut_new = wall_cuts && state.wall_m > end_m + kNewCut_m;
    const bool ruptured_new = (state.membranes_ruptured & ~cuts.opened) != 0;
    if (!cut_new && !ruptured_new) return;
    cuts.own = placeOfTrack(cuts, state, model.stage_numbers[kCutOwn][kCutRadius_m], wall_cuts);
    cuts.tracks[cuts.own].length_m = 0;
    cuts.tracks[cuts.own].p_entry_W_m = state.p_entry_W_m;
    cuts.tracks[cuts.own].u_W = state.u_W;
  }
  assert(cuts.own < cuts.count && "a track of the ring");
  CutTrack& own = cuts.tracks[cuts.own];
  if (wall_cuts) own.length_m = std::max(own.length_m, state.wall_m);
  own.membranes |= idsOf(model, state.membranes_ruptured);
  if (!model.in_body) return;
  for (std::uint32_t left = state.membranes_ruptured & ~cuts.opened; left != 0; left &= left - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left));
    const CutHole hole{model.membrane_ids[i], state.membrane_place_m[i]};
    cuts.opened |= 1u << i;  // it has its hole
    if (own.hole_count < kMaxCutHoles) own.holes[own.hole_count++] = hole;
  }
}

Vec3 remember(const SceneModel& model, const TipSample& sample, SimState& state,
              StepReport& report) noexcept {
  assert(state.inside && model.isLive(Effect::kCutMemory));
  if ((report.flags & kFlagEntry) != 0) {
    state.cuts.own = kMaxCutTracks;
    state.cuts.opened = 0;
  }
  turnOwnTrack(model, state);
  const double x_m = dot(state.u_W, sample.p_WT_m - state.p_entry_W_m);
  const double x_before_m = tickBefore(state).x_m;
  double along_N = openMembranes(model, state, x_m, x_before_m, report);
  const bool wall_cuts = model.cut_reach != nullptr && model.isLive(Effect::kCutting);
  const double end_m = wall_cuts ? endOfCut(model, state) : 0.0;
  if (wall_cuts) along_N += followCut(model, state, x_m, x_before_m, end_m, report);
  record(model, state, end_m, wall_cuts);
  // "no wall" stays "no wall"
  if (!std::isnan(report.p_wall_W_m.x)) report.p_wall_W_m = pointAt(state, state.wall_m);
  return state.u_W * along_N;
}

void hashCuts(const SimState& state, StateHash& hash) {
  const CutMemory& cuts = state.cuts;
  if (cuts.count == 0) return;  // scenes without CUT_MEMORY keep their hash from before it existed
  hash.add(std::uint64_t{cuts.count} | std::uint64_t{cuts.next} << 32);
  for (std::uint32_t i = 0; i < cuts.count; ++i) {
    hash.add(cuts.tracks[i].p_entry_W_m);
    hash.add(cuts.tracks[i].u_W);
    hash.add(cuts.tracks[i].length_m);
    hash.add(std::uint64_t{cuts.tracks[i].membranes});
    for (std::uint32_t k = 0; k < cuts.tracks[i].hole_count; ++k) hash.add(cuts.tracks[i].holes[k].at_m);
  }
  if (!state.inside) return;
  hash.add(std::uint64_t{cuts.own} | std::uint64_t{cuts.opened} << 32);
  hash.add(cuts.shift_m);
}

}  // namespace

extern const EffectEntry kCutMemoryEntry;
constinit const EffectEntry kCutMemoryEntry = {
    .effect = Effect::kCutMemory,
    .name = "CUT_MEMORY",
    .label = "Cut memory: cut tissue stays cut",
    .short_name = "memory",
    .term = "cut memory",
    .place = 6,
    .section = "cut_memory",
    .fields = kCutFields,
    .hasNumbers =
        [](const SceneSpec& spec) {
          if (!(spec.stage_numbers[kCutOwn][kCutRadius_m] > 0)) return false;
          // without a wall that cuts, only membranes are remembered
          return axialEntry(spec.axial_model).has_tracking_wall ||
                 spec.axial_model == AxialModel::kFirstOrder ||
                 std::any_of(spec.layers.begin(), spec.layers.end(),
                             [](const LayerSpec& layer) { return layer.membrane.has_value(); });
        },
    .remark = [](const SceneSpec& spec) -> std::string {
      if (axialEntry(spec.axial_model).has_tracking_wall) return {};
      return "axial_model " + std::string(axialModelName(spec.axial_model)) +
             " has no wall that cuts: only membranes are remembered";
    },
    .stage = remember,
    .hashLasting = hashCuts};

}  // namespace needlelab
