/// The engine's whole state between ticks: plain data; a copy is a snapshot.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

#include "common/haptics/geometry.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// The needle's phase (FORCE_MODEL.md, "Tracking wall"). Values are stored in recordings: append only.
enum class Phase : std::uint8_t { kFree = 0, kInserting = 1, kStopped = 2, kWithdrawing = 3 };
constexpr const char* phaseName(Phase phase) {
  switch (phase) {
    case Phase::kFree:
      return "FREE";
    case Phase::kInserting:
      return "INSERTING";
    case Phase::kStopped:
      return "STOPPED";
    case Phase::kWithdrawing:
      return "WITHDRAWING";
  }
  return "?";
}

/// 2^16 cells of 15 µm: a correlation length below 60 µm is rendered as 60 µm.
inline constexpr int kMaxScoreLevels = 16;

/// STATISTICAL: the last cell evaluated by the process over depth (models/score_process.h), and the nodes on
/// the path from the whole metre down to that cell.
struct ScorePath {
  std::int32_t cell = -1;  ///< −1: none yet
  std::array<double, kMaxScoreLevels + 1> low, high;
};

/// Whether a station of the shaft, or the tip, moves with the tissue.
enum class Hold : std::uint8_t { kSticks, kSlipsIn, kSlipsOut };

/// FEM's state between ticks. Value-initialised: the needle is outside and nothing is cut. Lengths run along
/// u from the entry, with the shifts of turns and ruptures subtracted. Forces act on the tissue; positive is
/// into the tissue.
struct NeedleState {
  double x_m = 0;          ///< tip at the last tick
  double cut_m = 0;        ///< the cut's end in the undeformed tissue: the tip's greatest depth so far
  double gap_m = 0;        ///< from the tip to the cut's end, ≥ 0; 0 while the tip presses
  double tip_N = 0;        ///< [0, cutting force]
  double tip_most_N = 0;   ///< the cutting force at the last tick
  double tip_moved_m = 0;  ///< w at the tip
  Hold tip_hold = Hold::kSticks;
  std::uint32_t unsettled = 0;  ///< ticks in which the contact did not settle within the bound
  std::uint32_t solves = 0;     ///< systems solved at the last tick
  std::uint32_t stations = 0;   ///< number of valid entries below; 0 before the first tick
  std::array<double, kMaxNeedleStations> shaft_N{};
  std::array<double, kMaxNeedleStations> moved_m{};  ///< w
  std::array<Hold, kMaxNeedleStations> hold{};
};

/// A hole in a membrane of a body, whose structure a line may cross more than once.
struct CutHole {
  std::uint8_t id = 0;  ///< of the membrane
  double at_m = 0;      ///< along the track
  friend bool operator==(const CutHole&, const CutHole&) = default;
};
/// The greatest number of holes that a track remembers.
inline constexpr std::size_t kMaxCutHoles = 16;

/// A cut that an insertion left in the tissue: the points entry + s·u with 0 ≤ s ≤ length.
struct CutTrack {
  Vec3 p_entry_W_m;
  Vec3 u_W;  ///< unit
  double length_m = 0;
  std::uint32_t membranes = 0;  ///< bit i: the one of id i is open where the line crosses it; in a body …
  std::uint32_t hole_count = 0;
  std::array<CutHole, kMaxCutHoles> holes{};  ///< … only at these, the first `hole_count`
};

/// CUT_MEMORY: the cuts of this session, a ring. An exit does not clear it. Empty in a scene without the
/// effect.
struct CutMemory {
  std::array<CutTrack, kMaxCutTracks> tracks{};  ///< the first `count` are valid
  std::uint32_t count = 0;
  std::uint32_t next = 0;  ///< index of the next track; in a full ring, of the oldest

  // of the insertion under way
  std::uint32_t own = kMaxCutTracks;  ///< its track; kMaxCutTracks: nothing newly cut
  std::uint32_t opened = 0;           ///< the membranes that it met at a hole
  double shift_m = 0;                 ///< `x_shift_m` at the last tick
};

/// How a tip rests on a surface (touch/proxy_contact.h).
struct ProxyContact {
  bool touching = false;
  Vec3 p_proxy_W_m;  ///< the rendered tip: on the surface
  Vec3 stretch_W_m;  ///< from the measured tip to the proxy
};

/// BONE: how the needle rests on the bone.
struct BoneContact : ProxyContact {
  double held_m = 0;  ///< how far short of its measured place the tissue feels the tip, along −u
  // while held
  double cutting_N = 0, friction_N = 0;  ///< the forces along u, which may not grow
  double place_m = 0;                    ///< where the tissue felt the tip in the last tick, along u, minus
                                         ///< `x_shift_m`
  // in a body: a ball without bone, by its squared radius; not part of the hash
  Vec3 p_clear_W_m;
  double clear_m2 = 0;
};

/// PALPATION: the cap, and what the ball under it touches.
struct Palpation {
  bool capped = false;
  bool clear = false;  ///< capped, the ball has been off the skin: it touches nothing before
  ProxyContact skin, bone;
  double held_J = 0;  ///< what the springs of both hold; not part of the hash
};

/// A stretch of the line from P0 along u that lies in one layer. Without initial values, as StiffnessSpan: to
/// clear an array of them would take most of the time of laying the layers of a new path.
struct LayerSpan {
  double begin_m, end_m;                       ///< the first begins at −∞, the last ends at ∞
  double friction_N_per_m, friction_offset_N;  ///< ∫₀^s friction = offset + slope·s
  double lateral_N_per_m2;
  std::int64_t layer;  ///< −1: beyond the limb
};

/// A stretch of the fixture's stiffness over the inserted length: with t from its beginning,
/// k = k + t·(slope + t·half_bend).
struct StiffnessSpan {
  double begin_m, end_m;  ///< the first begins at 0, the last ends at ∞
  double k_N_per_m, slope_N_per_m2, half_bend_N_per_m3;
};

/// The layers along u, in the order in which the needle meets them: in a round limb it leaves through the
/// same layers through which it entered.
struct LayersAlong {
  std::array<LayerSpan, 2 * kMaxLayers> spans;
  std::uint32_t count = 0;  ///< of valid spans
  std::uint32_t at = 0;     ///< the span used last
  std::array<StiffnessSpan, 4 * kMaxLayers + 1> stiffness;
  std::uint32_t stiffness_count = 0;
  StiffnessSpan stiffness_here{};  ///< the span used last
  double deepest_m = 0;            ///< where the line is deepest in the limb; infinite under a plane
};

/// How a wall relaxes in a stop.
struct Relaxation {
  std::uint64_t ramp_ticks = 0;  ///< RAMP: its remaining part once it has closed the gap; 0: the wall follows
                                 ///< a drift
  double step_m = 0;             ///< m of eq. 5
  double way_m = 0;              ///< RAMP: the wall's remaining distance
  double stretch_m = 0;          ///< z0 of EXPONENTIAL
};

/// Value-initialised: before the first tick. Only `step` changes it.
struct SimState {
  // contact
  Vec3 p_prev_W_m;            ///< tip at the last stepped tick
  double depth_prev_m = 0;    ///< δ at the last stepped tick
  bool has_prev = false;      ///< a tick was stepped before
  bool outside_once = false;  ///< the tip has been outside: an entry is possible only then
  bool inside = false;        ///< an insertion is under way; everything below belongs to it
  bool in_limb = false;       ///< … and the tip is in the limb: not through it
  bool past_middle = false;   ///< … and it was past the line's deepest place, and is not back on P0's side
  Phase phase = Phase::kFree;
  Vec3 p_entry_W_m;          ///< P0
  Vec3 p_hole_W_m;           ///< where the skin was pierced
  Vec3 normal_W;             ///< n at P0, out of the tissue
  Vec3 u_W;                  ///< the trajectory's direction, a unit vector
  Vec3 u0_W;                 ///< u at entry; near the skin it follows u
  Vec3 aim_W;                ///< the needle's axis with a lag, up to which u may turn; not a unit vector
  double slant = 1;          ///< c = max(0.05, −n·u)
  double inverse_slant = 1;  ///< 1/c
  std::uint32_t layer = 0;   ///< by δ
  std::uint32_t line_changes = 0;  ///< how often P0 or u was set; not part of the hash
  LayersAlong along;               ///< the layers along u, for the integrals over the inserted length

  // speed: positions along u since the tick before entry are kept in `x_history_m` minus `x_shift_m`, so that
  // a turn moves all of them at once
  std::uint64_t ticks_inside = 0;  ///< k − k_entry of the last stepped tick, plus 1
  double x_shift_m = 0;

  // tracking wall
  double wall_m = 0;                  ///< w
  double wall_stiffness_N_per_m = 0;  ///< K_t of the last tick's layer

  // stops
  double band_low_m = 0,
         band_high_m = 0;       ///< where the needle has been since it last moved, minus `x_shift_m`
  std::uint64_t band_tick = 0;  ///< `ticks_inside` when that band began
  std::uint64_t fast_tick = 0;  ///< `ticks_inside` when it was last as fast as v_stop, or a stop ended
  bool moves_in = true;         ///< the direction in which it last left a band
  bool armed = false;           ///< it has moved fast since the last stop
  bool stopped = false;
  double stop_least_m = 0;  ///< the least |z| of this stop
  Vec3 across_from_W_m;     ///< slow: from here the needle has gone less than the band across its line …
  std::uint64_t across_tick = 0;  ///< … since this `ticks_inside`
  Relaxation wall_rest, friction_rest;

  // shaft friction
  double friction_wall_m = 0;  ///< w_f

  // orientation limit: θ_l is `tilt_limit_rad`, or α(tilt_limit_insertion_m) as long as that avoids
  // trigonometry; θ_l is at least α(tilt_limit_insertion_m) in both cases
  bool tilt_limit_is_cone = false;
  double tilt_limit_rad = 0;
  double tilt_limit_insertion_m = 0;

  // axial models
  std::uint64_t insertions = 0;  ///< number of insertions, including this one; an exit does not reset it
  std::uint32_t table_row = 0;   ///< start of the search in a table over depth
  ScorePath score;               ///< STATISTICAL
  bool proxy_held = false;       ///< GOD_OBJECT: the proxy lies on a top; otherwise it is at the tip
  std::uint32_t proxy_layer =
      0;                       ///< GOD_OBJECT: the layer of that top, or of the top that the tip last passed
  std::uint32_t tops_met = 0;  ///< GOD_OBJECT: number of layer tops that the tip has crossed
  std::array<double, kMaxLayers> top_place_m;  ///< position along u, minus `x_shift_m`
  double slid_m = 0;  ///< OKAMURA: distance slid in the tissue since the needle last stuck; 0 while it sticks

  // stages, by `stageOf`: 0 at entry
  std::array<StageNumbers, kMaxStages> stage{};

  // membranes, in the model's order
  std::uint32_t membranes_met = 0;       ///< number of membranes met, from the top
  std::uint32_t membranes_ruptured = 0;  ///< bit i: membrane i has ruptured
  std::array<double, kMaxLayers> membrane_place_m;

  // the ring for `speed`: position at tick i at [i & history_mask]; placed last so that the other members
  // share few cache lines
  std::uint64_t history_mask = 0;  ///< the model's
  std::array<double, kHistoryCapacity> x_history_m;

  NeedleState needle;  ///< FEM

  CutMemory cuts;  ///< CUT_MEMORY; apart from `insertions` and `palpation`, the only state that outlives an
                   ///< insertion and affects the next one

  BoneContact bone;  ///< BONE

  Palpation palpation;  ///< PALPATION
};
static_assert(std::is_trivially_copyable_v<SimState>);

/// 64-bit FNV-1a over the meaningful part of the state, for replay and golden tests.
std::uint64_t hashOf(const SimState& state);

}  // namespace needlelab
