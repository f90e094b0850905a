#include "client/sim/stability/force_source.h"

#include <map>
#include <utility>
#include <vector>

#include "common/fem/needle_mesh.h"

namespace needlelab {
namespace {

class EngineSource final : public ForceSource {
 public:
  explicit EngineSource(SceneModel model) : model_(std::move(model)) {}
  void step(const TipSample& tip, StepReport& report) noexcept override {
    needlelab::step(model_, tip, state_, report);
  }
  [[nodiscard]] double axialStiffness_N_per_m() const noexcept override {
    return model_.axialStiffness_N_per_m();
  }
  [[nodiscard]] double slant() const noexcept override { return state_.inside ? state_.slant : 1; }
  [[nodiscard]] Vec3 trajectory() const noexcept override { return state_.inside ? state_.u_W : Vec3{}; }

 private:
  SceneModel model_;
  SimState state_{};
};

// a mesh takes a second: scenes that differ in nothing it sees share its compliance
class MeshCache {
 public:
  Status complete(SceneSpec& scene) {
    if (scene.axial_model != AxialModel::kFem || scene.fem.compliance) return {};
    std::vector<double> key = {scene.needle_length_m, static_cast<double>(scene.fem.nodes)};
    for (const LayerSpec& layer : scene.layers) key.push_back(layer.thickness_m);
    for (const FemLayerSpec& layer : scene.fem.layers) {
      key.push_back(layer.young_Pa);
      key.push_back(layer.poisson);
    }
    auto& known = known_[key];
    if (!known) {
      if (const Status status = addCompliance(scene); !status.ok()) return status;
      known = scene.fem.compliance;
    }
    scene.fem.compliance = known;
    return {};
  }

 private:
  std::map<std::vector<double>, std::shared_ptr<const NeedleCompliance>> known_;
};

}  // namespace

ForceSourceFactory engineSource() {
  auto meshes = std::make_shared<MeshCache>();
  return [meshes](const SceneSpec& given, double rate_hz) -> Result<std::unique_ptr<ForceSource>> {
    SceneSpec scene = given;
    if (const Status status = meshes->complete(scene); !status.ok()) return status.error();
    auto model = compile(scene, rate_hz);
    if (!model.ok()) return model.error();
    return std::unique_ptr<ForceSource>(std::make_unique<EngineSource>(*std::move(model)));
  };
}

}  // namespace needlelab
