#include "client/sim/stability/scan_model.h"

#include <memory>

#include "common/fem/needle_mesh.h"
#include "common/haptics/models/like_for_like.h"
#include "common/haptics/models/needle_compliance.h"

namespace needlelab {
namespace {

void stiffen(SceneSpec& fem, double factor) {
  for (FemLayerSpec& layer : fem.fem.layers) layer.young_Pa *= factor;
  auto scaled = std::make_shared<NeedleCompliance>(*fem.fem.compliance);
  for (double& give : scaled->give_m_per_N) give /= factor;
  fem.fem.compliance = std::move(scaled);
}

}  // namespace

Result<ScannedModel> ScannedModel::prepare(const SceneSpec& scene, AxialModel model,
                                           const PlantOptions& plant, const NudgeOptions& options) {
  ScannedModel scanned(scene, likeForLike(scene, model));
  if (model != AxialModel::kFem) return scanned;

  if (const Status status = addCompliance(scanned.scene_); !status.ok()) return status.error();
  // how stiff it feels depends on how deep it is: towards the wall's own stiffness in a few steps
  constexpr int kSteps = 4;
  const double wanted = scene.tracking_wall.stiffness_N_per_m;
  for (int step = 0; step < kSteps; ++step) {
    const auto run = nudge(engineSource(), scanned.scene_, wanted, plant, options);
    if (!run.ok()) return run.error();
    scanned.felt_N_per_m_ = run->outcome.wall_N_per_m;
    if (!(scanned.felt_N_per_m_ > 0))
      return Error{ErrorCode::kFailed, "the mesh is felt to have no stiffness in this scene"};
    if (step + 1 < kSteps) stiffen(scanned.scene_, wanted / scanned.felt_N_per_m_);
  }
  return scanned;
}

SceneSpec ScannedModel::with(double stiffness_N_per_m) const {
  if (model() == AxialModel::kFem) {
    SceneSpec fem = scene_;
    stiffen(fem, stiffness_N_per_m / felt_N_per_m_);
    return fem;
  }
  SceneSpec wall = wall_;
  wall.tracking_wall.stiffness_N_per_m = stiffness_N_per_m;
  return likeForLike(wall, model());
}

double ScannedModel::damping_Ns_per_m() const {
  return model() == AxialModel::kVoigt ? scene_.voigt.damping_Ns_per_m : 0;
}
std::string_view stiffnessParameter(AxialModel model) {
  switch (model) {
    case AxialModel::kEnhancedTrackingWall:
    case AxialModel::kTrackingWall:
      return "tracking_wall.stiffness_n_per_m";
    case AxialModel::kStatistical:
    case AxialModel::kPrecomputed:
      return "tracking_wall.stiffness_n_per_m, which renders the table";
    case AxialModel::kDirect:
      return "direct.stiffness_n_per_m";
    case AxialModel::kVoigt:
      return "voigt.stiffness_n_per_m, damping_ns_per_m at 5";
    case AxialModel::kGodObject:
      return "god_object.stiffness_n_per_m";
    case AxialModel::kFirstOrder:
      return "first_order.stiffness_n_per_m of the layer, up to puncture";
    case AxialModel::kFem:
      return "fem: Young's modulus of all layers, as the stiffness that is felt at this depth";
  }
  return "";
}

}  // namespace needlelab
