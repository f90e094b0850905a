/// A rigid needle in linear elastic tissue: the quasi-static contact of FEM at one tick, with the mesh
/// replaced by its compliance (`NeedleCompliance`). No heap, no lock, no library: a tick may call it.
///
/// The tissue moves by w = C f under the axial forces f of the needle on its stations. Along the shaft the
/// tissue sticks to the needle or slips: |f_j| is at most the friction of the inserted part of station j. The
/// tip pushes (never pulls) the tissue with at most the local layer's cutting force; beyond that it cuts, and
/// the cut stays. Force and displacement of a tick are the solution of this complementarity problem with box
/// bounds, solved implicitly, so that the hand's work is at least the energy stored in the tissue (see
/// `stepNeedle`).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/haptics/scene_spec.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// The tissue's finite-element mesh as the needle feels it: the displacement along u of each piece of the
/// path under an axial force on each piece. Made by common/fem, then shared and never changed.
///
/// The path is cut into stations of equal length; station i is the piece of the surface r = radius_m between
/// the depths i·spacing_m and (i + 1)·spacing_m. Depths run along the surface normal, from the skin.
struct NeedleCompliance {
  double spacing_m = 0;              ///< length of a station
  double radius_m = 0;               ///< r₀ of the surface over which the needle's load is spread
  std::vector<double> depth_m;       ///< middle of each station, 1-kMaxNeedleStations of them
  std::vector<double> give_m_per_N;  ///< C, row-major: mean displacement of i per axial force spread over j.
                                     ///< Symmetric, positive definite

  // origin
  std::int32_t nodes = 0, elements = 0;              ///< size of the mesh: a quarter of the tissue, by
                                                     ///< symmetry
  double assemble_s = 0, factor_s = 0, solve_s = 0;  ///< wall time; solve: all stations
  double one_solve_s = 0;                            ///< one right-hand side
  /// With the needle at full depth, under all friction and the cutting force: the share of elements whose
  /// largest principal strain exceeds 10 %, where linear elasticity does not hold; and the same as a share of
  /// the volume within 5·radius_m of the path, which does not depend on the grading of the mesh.
  double strained_share = 0, strained_near_share = 0;
  std::string source;  ///< a description: mesh, elements, boundary

  [[nodiscard]] std::size_t stations() const { return depth_m.size(); }
  [[nodiscard]] double give(std::size_t i, std::size_t j) const { return give_m_per_N[i * stations() + j]; }
};

/// Integrates a number that is constant in each layer from the skin along the normal; above the skin, the
/// first layer's value applies.
class LayerIntegral {
 public:
  /// Adds a layer below the existing layers.
  void add(double top_m, double rate);
  [[nodiscard]] double upTo(double depth_m) const noexcept;

 private:
  std::array<double, kMaxLayers> top_m_{}, rate_{}, sum_{};
  std::uint32_t count_ = 0;
};

/// Length of a bevel per outer diameter: 1/tan 11°, the long bevel of ISO 7864.
inline constexpr double kBevelPerDiameter = 5.1445540159703102;

/// A needle prepared for the tick. Const after `compileNeedle`; any thread may read.
struct FemNeedle {
  std::shared_ptr<const NeedleCompliance> compliance;
  LayerIntegral cutting_N_m, friction_N;
  std::array<double, kMaxNeedleStations>
      station_friction_N{};      ///< friction of a whole station, for a straight insertion
  double bevel_m = 0;            ///< the cutting force is the mean over this length behind the tip
  double contact_m = 0;          ///< the tip's force is spread over this length around it: the needle's bevel
  double tip_give_m_per_N = 0;   ///< compliance of the tip itself, in series with the tissue's
  double stiffness_N_per_m = 0;  ///< stiffness of a needle that sticks over its whole length: the maximum
};
/// `spec.fem` must be valid and have its compliance.
FemNeedle compileNeedle(const SceneSpec& spec);

/// The needle's place along u, from the entry.
struct NeedlePose {
  double x_m = 0;          ///< tip
  double insertion_m = 0;  ///< greatest length of the shaft that can be in tissue; ≥ 0
  double slant = 1;        ///< c: depth along the normal per length along u, (0, 1]
};

/// Forces on the needle along u: a push into the tissue gives negative forces.
struct NeedleForce {
  double cutting_N = 0;   ///< at the tip, ≤ 0
  double friction_N = 0;  ///< along the shaft
  /// The tip cuts into a layer that is easier to cut, or the cut runs ahead of the needle because tissue
  /// springs back there: the force may change faster than any spring's.
  bool releases = false;
};

/// Steps one tick. The state is that of the needle outside (`NeedleState{}`) or of the previous tick; the
/// first pose is near x = 0. Solves at most `kMaxSolves` small systems: a contact that has not settled by
/// then continues in the next tick (`state.unsettled` counts such ticks).
///
/// Why it only dissipates: with E = ½ fᵀ C f (and the tip's own spring) convex, E_new − E_old ≤ f_newᵀ (w_new
/// − w_old); each station's force times the needle's motion is this term plus its force times its slip, and
/// slip has the force's sign. Work is counted with the force at the end of a tick.
NeedleForce stepNeedle(const FemNeedle& needle, const NeedlePose& pose, NeedleState& state) noexcept;

/// Elastic energy in the tissue, in J.
double storedEnergy(const FemNeedle& needle, const NeedleState& state) noexcept;

/// The tissue's displacement per force of the tip alone at that depth, including the tip's own spring.
double tipGive_m_per_N(const FemNeedle& needle, double depth_m) noexcept;

inline constexpr int kMaxSolves = 40;

}  // namespace needlelab
