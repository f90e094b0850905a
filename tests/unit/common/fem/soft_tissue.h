/// Scenes and meshes for the tests of this folder.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>

#include "common/fem/needle_mesh.h"
#include "tests/support/run_form.h"

namespace needlelab::test {

/// One layer of unlimited depth, with a needle of `length_m`.
inline SceneSpec softBlock(double young_Pa, double poisson, double length_m, double friction_N_per_m = 0,
                           double cutting_N = 0) {
  SceneSpec scene;
  scene.needle_length_m = length_m;
  scene.layers.resize(1);
  scene.layers[0].thickness_m = 1;
  scene.axial_model = AxialModel::kFem;
  scene.effects = bitOf(Effect::kCutting);
  scene.fem.layers.push_back({young_Pa, poisson, friction_N_per_m, cutting_N});
  return scene;
}

inline std::shared_ptr<const NeedleCompliance> complianceOf(const SceneSpec& scene, int nodes, int stations) {
  NeedleMeshOptions options;
  options.nodes = nodes;
  options.stations = stations;
  auto compliance = precomputeCompliance(scene, options);
  if (!compliance.ok()) throw std::runtime_error(compliance.error().message);
  return *compliance;
}

}  // namespace needlelab::test
