/// Stops of the reference engine and the reference models: a literal transcription of FORCE_MODEL.md, "Stop"
/// and step 2 of "Tracking wall", written from the text alone. Uses libm.
#pragma once

#include <cstdint>

#include "common/haptics/scene_spec.h"
#include "common/haptics/sim_state.h"

namespace needlelab::test {

/// A fault planted in the reference, one at a time: a hard case that such an engine passes proves nothing. In
/// the source each is marked `planted`.
enum class Defect : std::uint8_t {
  kNone,
  kLiteralEq4,        ///< stop: m·i is added to the previous wall, m = (x − ω)/n kept
  kRampIgnoresZ,      ///< stop: the ramp moves by m for n ticks, whatever z is by then
  kRampWithoutCap,    ///< stop: the wall may move faster than 1.5·v_stop
  kShortSpeedWindow,  ///< v over 20 ms instead of 100 ms
  kNoStopHysteresis,  ///< a stop ends at v_stop instead of 2·v_stop
  kRestsAcross,       ///< crosswise movement counts as rest
  kCreepThrough,  ///< the wall follows a slow needle through the whole stop, which the stretch does not end
  kEndsByWay,     ///< a stop ends after 0.4 mm of travel
  kAttractedNotFaded,  ///< Δ_att = f_att/K_t up to the exit
  kEntryAtTip,         ///< P0 = the first sample inside, not the point where the surface was crossed
  kEntersFromInside,   ///< a first sample inside begins an insertion
  kLengthAlongU,       ///< d_t = max(0, x), at most δ/c
  kFixtureForgets,     ///< a dead radius grows with k, so that a deviation made at small depth is not felt
  kTurnsOnlyDeep,      ///< u turns at 45°, however shallow
  kTurnsFreely,        ///< u turns at once, however deep
  kTurnsPastAxis,      ///< u turns toward the tip, wherever the axis points
  kEntryJumpsAt80,     ///< a needle tilted by more than 80° enters along −n
  kExitAnywhere,       ///< a needle that leaves a round limb on the far side counts as outside
  kTurnLeavesWalls,    ///< a turn moves neither walls, membranes nor past x
  kMembranePulls,      ///< what pulls keeps its force while the needle presses a membrane
  kMembranesSlide,     ///< a move of P0 leaves the membranes' stretch
  kFrictionPushes,     ///< friction's wall does not relax in a stop
  kFrictionBySign,     ///< shaft friction of full size opposing the last move, no spring
  kAlphaWithoutState,  ///< torque above α(d_t), without θ_l
  kCutToTip,           ///< memory: a track is as long as the maximum x, not w
  kCutWithoutSides,    ///< memory: a needle that leaves a track sideways stays in it
  kCutKeptInTurn,      ///< memory: a turn does not change the own track's length
  kCutsKeptApart,      ///< memory: an insertion that lengthens a track gets another one
  kHoleEverywhere,     ///< memory: a membrane with a hole is open wherever it is met
  kHoleLeavesWalls,    ///< memory: the walls do not follow when a membrane opens
};

/// One insertion's stops. Call `step`, then `wallMove`, once per tick.
class ReferenceStop {
 public:
  /// `wall_relaxes`: for the four models, with CUTTING or ATTRACTED live.
  ReferenceStop(const TrackingWallSpec& spec, double rate_hz, bool wall_relaxes,
                Defect planted = Defect::kNone);

  /// A turn of u moves all remembered x.
  void move(double by_m);
  void step(double x_m, double z_m, double speed_mps, Vec3 p_W_m, Vec3 u_W);
  /// How far the wall moves, along u; 0 outside a stop.
  double wallMove(double z_m, double rejection_m) { return move(wall_, z_m, z_m > 0 ? rejection_m : 0); }
  /// … and friction's wall.
  double frictionMove(double z_m) { return move(friction_, z_m, 0); }

  [[nodiscard]] Phase phase() const { return phase_; }

 private:
  [[nodiscard]] double inTicks(double duration_s) const;
  [[nodiscard]] bool ends(double x_m, double z_m, double speed_mps, bool left_band) const;
  /// How one wall relaxes.
  struct Wall {
    bool ramp = false;
    double since_closed = 0;  ///< ticks since the ramp first closed the gap, including that one
    double m = 0;             ///< m of eq. 5
    double left = 0;          ///< the ramp's remaining travel
    double z0 = 0;            ///< z0 of EXPONENTIAL
  };
  double move(Wall& wall, double z_m, double rest_m) const;
  double ramp(Wall& wall, double z_m, double rest_m) const;
  bool movesAcross(Vec3 p_W_m, Vec3 u_W, bool slow);

  TrackingWallSpec spec_;
  double rate_hz_, period_s_;
  bool wall_relaxes_;
  Defect planted_;
  Phase phase_ = Phase::kInserting;
  double ticks_ = 0;  ///< k − k_entry + 1
  double lo_ = 0, hi_ = 0, z_min_ = 0;
  double quiet_ = 0, slow_ = 0;
  bool inward_ = true, armed_ = false, stopped_ = false;
  double i_ = 0;        ///< ticks of the stop before this one
  double begin_m_ = 0;  ///< x where the stop began, for kEndsByWay
  Wall wall_, friction_;
  Vec3 across_from_W_m_;
  double across_ticks_ = 0;  ///< since it was set
  bool slow_before_ = false;
};

}  // namespace needlelab::test
