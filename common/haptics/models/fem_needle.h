/// A rigid needle in linear elastic tissue: the quasi-static contact of FEM at one tick, with the mesh
/// replaced by its compliance (needle_compliance.h). No heap, no lock, no library: a tick may call it.
///
/// The tissue moves by w = C f under the axial forces f that the needle puts on its stations. Along the shaft
/// it sticks to the needle or slips: |f_j| is at most the friction of the inserted part of station j. At the
/// tip it is pushed (never pulled) with at most the cutting force of the layer there; beyond that it is cut,
/// and the cut stays. Force and displacement of a tick are the solution of this complementarity problem with
/// box bounds, taken implicitly, so that the work of the hand is at least what the tissue stores: see
/// `stepNeedle`.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "common/haptics/limits.h"
#include "common/haptics/models/needle_compliance.h"
#include "common/haptics/scene_spec.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// ∫ of a number that is constant in each layer, from the skin along the normal; above the skin as in the
/// first.
class LayerIntegral {
 public:
  /// Adds a layer below the others.
  void add(double top_m, double rate);
  [[nodiscard]] double upTo(double depth_m) const noexcept;

 private:
  std::array<double, kMaxLayers> top_m_{}, rate_{}, sum_{};
  std::uint32_t count_ = 0;
};

/// Ready for the tick. Const after `compileNeedle`; any thread may read.
struct FemNeedle {
  std::shared_ptr<const NeedleCompliance> compliance;
  LayerIntegral cutting_N_m, friction_N;
  std::array<double, kMaxNeedleStations> station_friction_N{};  ///< of a whole station, straight in
  double bevel_m = 0;            ///< the cutting force is the mean over this length behind the tip
  double tip_give_m_per_N = 0;   ///< of the tip itself, in series with the tissue's
  double stiffness_N_per_m = 0;  ///< of the needle stuck over its whole length: the greatest there is
};
/// `spec.fem` must be valid and have its compliance.
FemNeedle compileNeedle(const SceneSpec& spec);

/// Where the needle is, along u from the entry.
struct NeedlePose {
  double x_m = 0;          ///< tip
  double insertion_m = 0;  ///< most length of the shaft that can be in tissue; ≥ 0
  double slant = 1;        ///< c: depth along the normal per length along u, (0, 1]
};

/// Forces on the needle along u, so that a push into the tissue is answered by negative ones.
struct NeedleForce {
  double cutting_N = 0;   ///< at the tip, ≤ 0
  double friction_N = 0;  ///< along the shaft
  /// The tip cuts into a layer that is softer to cut, or the cut runs ahead of the needle because tissue
  /// springs back there: the force may change faster than by any spring.
  bool releases = false;
};

/// One tick. The state is that of the needle outside (`NeedleState{}`) or of the tick before; the first pose
/// is near x = 0. At most `kMostSolves` small systems are solved: what is not settled by then is settled in
/// the next tick (`state.unsettled` counts such ticks).
///
/// Why it only dissipates: with E = ½ fᵀ C f (and the tip's own spring) convex, E_new − E_old ≤ f_newᵀ (w_new
/// − w_old); each station's force times the needle's motion is that plus its force times its slip, and slip
/// has the force's sign. Work is counted with the force at the end of a tick.
NeedleForce stepNeedle(const FemNeedle& needle, const NeedlePose& pose, NeedleState& state) noexcept;

/// Elastic energy in the tissue, in J.
double storedEnergy(const FemNeedle& needle, const NeedleState& state) noexcept;

/// How far the tip alone moves the tissue per force at that depth, the tip's own spring included.
double tipGive_m_per_N(const FemNeedle& needle, double depth_m) noexcept;

inline constexpr int kMostSolves = 40;

}  // namespace needlelab
