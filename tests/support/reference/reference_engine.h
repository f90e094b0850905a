/// The engine's independent judge: a slow, literal transcription of common/haptics/FORCE_MODEL.md, written
/// from the text alone.
///
/// Where page and code once agreed by habit: a second reader of the paper found that page and engine had left
/// the paper, or each other, together, so that agreeing proved nothing.
/// - u turned toward p − P0, instead of following the needle's axis.
/// - The freedom to re-aim had a peak at 10 mm: f_turn was a line in d, k a curve.
/// - The tilt was limited from u, so it was 2α in all.
/// - Friction's wall had no stop; a rest after a withdrawal pulled in; crosswise movement counted as rest.
/// - The end of a cut had no floor. On bone, friction's wall counted where SHAFT_FRICTION was not live.
/// - H jumped from h to δ past the middle of a round limb.
/// - A membrane slid along with the needle under the skin, and a new hole was free.
/// - The stiffnesses of tissue and membrane were added.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "common/haptics/engine.h"
#include "common/haptics/scene_spec.h"
#include "tests/support/reference/reference_cut_memory.h"
#include "tests/support/reference/reference_layers.h"
#include "tests/support/reference/reference_stop.h"

namespace needlelab::test {

/// Steps the same ticks as `needlelab::step`, without its precomputed tables, caches and cheap trigonometry.
/// Uses the heap and libm freely. The spec must be valid (it is not validated here).
class ReferenceEngine {
 public:
  ReferenceEngine(SceneSpec scene, double rate_hz, Defect planted = Defect::kNone);

  /// One tick, in FORCE_MODEL.md's "Order of a tick"; but the orientation limit comes after the forces, none
  /// of which changes what it needs. Fills every field of the report as the header describes it.
  StepReport step(const TipSample& sample);

  /// The trajectory's direction, while inside.
  [[nodiscard]] std::optional<Vec3> direction() const;
  /// c, while inside.
  [[nodiscard]] std::optional<double> slant() const;
  /// θ_l, while inside.
  [[nodiscard]] std::optional<double> tiltLimit() const;
  /// The flags of the last tick that depend on a comparison decided by rounding (β, P0's way near the
  /// skin and room left on the cone, for the turn; k|e| with f_max; the sum with max_force_n; θ with θ_l):
  /// another rounding of the same numbers may set them differently, with the same forces.
  [[nodiscard]] std::uint32_t undecidedFlags() const { return undecided_; }
  /// Ticks of this insertion whose turn the cone limited: FORCE_MODEL.md ("Change of trajectory") lets each
  /// of them be off by 1e-12 rad.
  /// With CUT_MEMORY also those of earlier insertions.
  [[nodiscard]] int coneBoundTicks() const {
    return cone_bound_ticks_before_ + (insertion_ ? insertion_->cone_bound_ticks : 0);
  }
  /// CUT_MEMORY: in some tick the wall was on the side of an old cut, where rounding decides whether the
  /// insertion gets its own track (FORCE_MODEL.md, "Memory of the cut").
  [[nodiscard]] bool tracksUndecided() const { return cuts_.undecided(); }

 private:
  /// A membrane met in this insertion.
  struct Membrane {
    bool met = false, ruptured = false;
    double place_m = 0;  ///< s
  };

  /// The state that an exit resets.
  struct Insertion {
    explicit Insertion(ReferenceStop rule) : stop(std::move(rule)) {}
    Vec3 p_entry;            ///< P0
    Vec3 normal;             ///< n
    Vec3 u, u0;              ///< trajectory direction now and at entry
    Vec3 aim;                ///< m, the axis with a lag
    ReferenceLayers layers;  ///< along u
    bool through = false, past_middle = false;
    Vec3 hole;  ///< where the skin was pierced
    int layer = -1;
    std::vector<double> x_past;  ///< x at ticks k_entry − 1 (zero), k_entry, …; moved by each turn
    double depth_past = 0;       ///< δ at the previous tick; 0 at P0 for the entry tick
    // tracking wall
    double wall = 0;    ///< w
    double spring = 0;  ///< K_t of the previous tick
    ReferenceStop stop;
    // shaft friction
    double friction_wall = 0;                 ///< w_f
    double x_c_past = 0;                      ///< x_c at the previous tick, for kFrictionBySign
    double dead = 0, k_past = 0, e_past = 0;  ///< for kFixtureForgets
    // orientation limit
    double tilt_limit = 0;  ///< θ_l
    int cone_bound_ticks = 0;
    std::vector<Membrane> membranes;
    double turned_by = 0;  ///< change of x by the moves of P0 and u in this tick
  };

  /// Values derived from the pose, p and u; recomputed after a turn.
  struct Geometry {
    double x = 0, d_t = 0, k = 0;
    Vec3 e;
  };

  [[nodiscard]] std::int64_t inTicks(double duration_s) const;
  [[nodiscard]] bool live(Effect effect) const;
  [[nodiscard]] double depthAt(Vec3 p) const;
  [[nodiscard]] Vec3 normalAt(Vec3 p) const;
  [[nodiscard]] double topOf(std::size_t layer) const;
  [[nodiscard]] int layerAt(double depth) const;
  [[nodiscard]] double lateralStiffness(const ReferenceLayers& layers, double d_t) const;
  [[nodiscard]] double energy(double k, double e) const;
  [[nodiscard]] ReferenceLayers layersAlong(Vec3 p_entry, Vec3 normal, Vec3 u) const;
  [[nodiscard]] double cone(double d_t) const;
  [[nodiscard]] Geometry geometry(const Insertion& in, Vec3 u, Vec3 p) const;
  [[nodiscard]] Vec3 entryDirection(Vec3 axis, Vec3 normal) const;

  [[nodiscard]] bool wallRelaxes() const;
  [[nodiscard]] double springOf(const Insertion& in) const;
  static double undecidedBelow(const Insertion& in);
  void enter(Vec3 p, double depth, Vec3 axis);
  void moveLine(Insertion& in, Geometry& g, Vec3 p_entry, Vec3 normal, Vec3 u, Vec3 p) const;
  void followMembranes(Insertion& in, const Geometry& g, double depth, bool near_skin);
  bool followNearSkin(Insertion& in, Geometry& g, Vec3 p, double depth, Vec3 axis);
  bool turn(Insertion& in, Geometry& g, Vec3 p, Vec3 axis);
  Vec3 clamp(Insertion& in, const Geometry& g, StepReport& out);
  double speed(Insertion& in, double x) const;
  double meetMembranes(Insertion& in, const Geometry& g, double depth, bool entry, StepReport& out) const;
  void axial(Insertion& in, double depth, double x_c, StepReport& out) const;
  void friction(Insertion& in, const Geometry& g, double x_c, StepReport& out) const;
  void puncture(const Insertion& in, const Geometry& g, StepReport& out) const;
  double remember(Insertion& in, const Geometry& g, double x_c, bool entry, StepReport& out);
  void tilt(Insertion& in, const Geometry& g, Vec3 axis, StepReport& out);

  SceneSpec scene_;
  double rate_hz_, period_s_;
  Defect planted_;
  bool has_past_ = false;      ///< a tick was stepped before
  bool outside_once_ = false;  ///< the tip has been outside
  Vec3 p_past_;
  double depth_past_ = 0;
  std::optional<Insertion> insertion_;
  ReferenceCutMemory cuts_;
  int cone_bound_ticks_before_ = 0;
  std::uint32_t undecided_ = 0;
};

}  // namespace needlelab::test
