/// A scene rendered by one axial model with a stiffness that is asked for.
#pragma once

#include <string_view>

#include "client/sim/stability/scan_nudge.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

inline constexpr double kMaxProfileStiffness_N_per_m = 10'000;  ///< of a profile (DESIGN §4)

/// What "K" is: K_t of the tracking wall and of the models that it renders (STATISTICAL, and PRECOMPUTED,
/// whose table rises with K_t too), the section's stiffness of DIRECT, VOIGT and GOD_OBJECT, the stiffness up
/// to puncture of FIRST_ORDER: all by likeForLike from K_t. FEM has no such number: its E and its compliance
/// are scaled until a nudge feels K.
class ScannedModel {
 public:
  /// `scene` is the wall's. For FEM the mesh is solved here, and nudges with `plant` and `options` find out
  /// what it is felt to have; kFailed when that is nothing.
  static Result<ScannedModel> prepare(const SceneSpec& scene, AxialModel model, const PlantOptions& plant,
                                      const NudgeOptions& options);

  [[nodiscard]] SceneSpec with(double stiffness_N_per_m) const;
  [[nodiscard]] AxialModel model() const { return scene_.axial_model; }
  /// B of VOIGT, 0 of the others. In N·s/m.
  [[nodiscard]] double damping_Ns_per_m() const;

 private:
  explicit ScannedModel(SceneSpec wall, SceneSpec scene) : wall_(std::move(wall)), scene_(std::move(scene)) {}
  SceneSpec wall_, scene_;
  double felt_N_per_m_ = 0;  // FEM: of `scene_` as it is
};

/// What is K of a model, for a table's caption.
std::string_view stiffnessParameter(AxialModel model);

}  // namespace needlelab
