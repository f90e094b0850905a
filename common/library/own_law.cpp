/// A law of the user's own instead of a scene's axial model.
#include <fmt/core.h>

#include <memory>
#include <utility>

#include "common/base/range.h"
#include "common/haptics/effects/step_live.h"
#include "common/library/scene_handle.h"

namespace needlelab {
namespace {

constexpr EffectMask kAlong = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted);

/// The axial model of a law from outside (step_live.h).
struct OwnLaw {
  static constexpr EffectMask kRenders = kAlong;
  static constexpr bool kHasWall = false;

  static double apply(const SceneModel& model, SimState& state, const Tick& tick, bool /*stop_begins*/,
                      StepReport& report) {
    const auto& own = static_cast<const LibraryModel&>(model);
    const nl_law_input input{tick.x_m, tick.speed_mps, tick.depth_m, tick.insertion_m,
                             static_cast<std::int32_t>(state.layer)};
    const double force_N = own.law(&input, own.user);
    (force_N < 0 ? report.cutting_N : report.attracted_N) = force_N;
    return force_N;
  }
};
constexpr StepTable kOwnSteps = stepTable<OwnLaw>();

}  // namespace

Result<std::unique_ptr<nl_scene>> sceneWithLaw(const nl_scene& scene, nl_law law, void* user,
                                               double steepest_N_per_m) {
  constexpr NumberRange kSteepest{0, 10'000};
  if (law == nullptr) return Error{ErrorCode::kInvalidInput, "law: is null"};
  if (scene.model->body_spec)
    return Error{ErrorCode::kInvalidInput, "law: a law of your own works in scenes of layers, not in a body"};
  if (!kSteepest.contains(steepest_N_per_m))
    return outOfRange("steepest_n_per_m", steepest_N_per_m, kSteepest);
  // the simplest model stands for the law, so that the other effects do not count on the old one's wall
  auto spec = std::make_shared<SceneSpec>(*scene.spec);
  spec->axial_model = AxialModel::kDirect;
  spec->direct = {};
  for (LayerSpec& layer : spec->layers) layer.wall_stiffness_N_per_m.reset();
  auto compiled = compile(*spec, scene.model->rate_hz);
  if (!compiled.ok()) return compiled.error();
  auto model = std::make_shared<LibraryModel>();
  static_cast<SceneModel&>(*model) = std::move(*compiled);
  model->law = law;
  model->user = user;
  model->axial_stiffness_N_per_m = steepest_N_per_m;
  model->live |= kAlong;
  const StepFunction own = kOwnSteps[model->live & kPlacedEffects];
  if (model->step_function == model->placed_step) model->step_function = own;
  model->placed_step = own;
  return std::make_unique<nl_scene>(nl_scene{std::move(spec), std::move(model)});
}

}  // namespace needlelab
