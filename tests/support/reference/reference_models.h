/// The axial models' independent judge: slow, literal transcriptions of FORCE_MODEL.md, "Axial models", one
/// function per model.
#pragma once

#include <optional>
#include <vector>

#include "common/haptics/scene_spec.h"
#include "tests/support/reference/reference_layers.h"
#include "tests/support/reference/reference_stop.h"

namespace needlelab::test {

/// A model's inputs for one tick inside the tissue (FORCE_MODEL.md, "Contact").
struct ModelTick {
  bool entry = false;
  double x_m = 0;                           ///< u·(p − P0), after this tick's turn
  double moved_m = 0;                       ///< change of x by that turn
  double depth_m = 0;                       ///< δ
  double slant = 1;                         ///< c
  double insertion_m = 0;                   ///< d_t
  const ReferenceLayers* layers = nullptr;  ///< along u
  double speed_mps = 0;                     ///< v
  Vec3 p_W_m, u_W;                          ///< the tip, and u
  double entry_way_m = 0;                   ///< at entry: u·(p − the place of entry)
};

/// Along u, signed.
struct ModelForce {
  double cutting_N = 0, attracted_N = 0, friction_N = 0, puncture_N = 0;
};

/// Steps the axial model of a scene without PUNCTURE (FEM has its own reference). Uses libm and the heap
/// freely. The spec must be valid.
class ReferenceModel {
 public:
  ReferenceModel(SceneSpec scene, double rate_hz) : scene_(std::move(scene)), rate_hz_(rate_hz) {}
  ModelForce step(const ModelTick& tick);

 private:
  struct Top {
    double place_m = 0;  ///< along u
    bool through = false;
  };

  [[nodiscard]] bool lists(Effect effect) const { return (scene_.effects & bitOf(effect)) != 0; }
  [[nodiscard]] double topOf(std::size_t layer) const;
  [[nodiscard]] std::size_t layerAt(double depth_m) const;
  [[nodiscard]] double statisticalTarget(double depth_m) const;
  ModelForce wall(const ModelTick& tick, double cut_m, double attracted_m);
  ModelForce direct(const ModelTick& tick) const;
  ModelForce voigt(const ModelTick& tick) const;
  ModelForce godObject(const ModelTick& tick);
  ModelForce firstOrder(const ModelTick& tick);
  ModelForce threeForces(const ModelTick& tick);
  double karnopp(const ModelTick& tick, double slid_m, double kinetic_N, double static_N,
                 double viscous_N_per_mps) const;
  void meetTops(const ModelTick& tick);
  [[nodiscard]] double openTo(double x_m) const;
  /// Negative; `force_N(layer, z)` at the stretch z > 0 of its top, `max_N(layer)` where it is pierced.
  template <class Force, class Most>
  double heldByTops(double x_m, const Force& force_N, const Most& max_N);
  /// Negative; `cutting_N(layer)`.
  template <class Cutting>
  double cutTo(double x_c, double depth_m, const Cutting& cutting_N);

  SceneSpec scene_;
  double rate_hz_;
  int insertion_ = -1;
  // of the previous tick
  double x_past_ = 0, depth_past_ = 0;
  // walls and stop
  double wall_ = 0, friction_wall_ = 0;
  std::optional<ReferenceStop> stop_;
  // tops of layers that were met, and the one holding the god object's proxy
  std::vector<Top> tops_;
  std::optional<std::size_t> proxy_on_;
  std::size_t proxy_last_ = 0;
  // OKAMURA, DAHL: the friction spring's length, and the distance since the needle last stuck
  double spring_ = 0, slid_ = 0;
};

}  // namespace needlelab::test
