// What the border to C costs a tick: nl_step of libneedlelab-haptics against SceneEngine::step, by turns in
// one process, on the same stroke through two layers with all effects that a def can list.
#include <needlelab/haptics.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "common/base/time/clock.h"
#include "common/haptics/body/body_engine.h"

namespace needlelab::test {
namespace {

constexpr int kTicks = 200'000, kRounds = 21;

nl_pose tipAt(int tick) {
  const double turn = 2e-4 * std::sin(0.01 * tick);
  return {{1e-4 * std::sin(0.05 * tick), 0, 0.002 - 0.011 * (1 - std::cos(2 * M_PI * tick / 4000))},
          {std::cos(turn), std::sin(turn), 0, 0}};
}

SceneSpec sameSpec(const nl_scene_def& def) {
  SceneSpec spec;
  for (std::uint32_t i = 0; i < def.layer_count; ++i) {
    LayerSpec layer;
    layer.thickness_m = def.layers[i].thickness_m;
    layer.cutting_force_N = def.layers[i].cutting_force_n;
    layer.attracted_force_N = def.layers[i].attracted_force_n;
    layer.lateral_stiffness_N_per_m2 = def.layers[i].lateral_n_per_m2;
    layer.friction_N_per_m = def.layers[i].friction_n_per_m;
    spec.layers.push_back(layer);
  }
  spec.effects = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted) | bitOf(Effect::kClamping) |
                 bitOf(Effect::kShaftFriction);
  return spec;
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + kRounds / 2, values.end());
  return values[kRounds / 2];
}

int run() {
  nl_layer layers[2] = {nl_default_layer(), nl_default_layer()};
  layers[0].thickness_m = 0.005, layers[0].cutting_force_n = 1.5, layers[0].attracted_force_n = 0.6;
  layers[1].thickness_m = 0.05, layers[1].cutting_force_n = 0.8, layers[1].attracted_force_n = 0.3;
  for (nl_layer& layer : layers) layer.lateral_n_per_m2 = 5000, layer.friction_n_per_m = 20;
  const char* const effects[] = {"CUTTING", "ATTRACTED", "CLAMPING", "SHAFT_FRICTION"};
  nl_scene_def def = nl_default_scene_def();
  def.layers = layers, def.layer_count = 2, def.effects = effects, def.effect_count = 4;
  char error[300];
  nl_scene* const scene = nl_scene_create(&def, 1000, error, sizeof error);
  const auto model = compile(sameSpec(def), 1000);
  if (scene == nullptr || !model.ok()) {
    std::fprintf(stderr, "library bench: %s\n", scene == nullptr ? error : model.error().message.c_str());
    return 2;
  }
  std::vector<nl_pose> tips;
  for (int i = 0; i < kTicks; ++i) tips.push_back(tipAt(i));
  std::vector<double> own_ns, library_ns, ratios;
  double own_sum = 0, library_sum = 0;
  for (int round = 0; round < kRounds; ++round) {
    SceneEngine own(*model);
    nl_engine* const library = nl_engine_create(scene, error, sizeof error);
    StepReport report;
    nl_wrench wrench;
    std::int64_t began_ns = steadyNowNs();
    for (const nl_pose& tip : tips) {
      own.step({{tip.p_m[0], tip.p_m[1], tip.p_m[2]}, {tip.q[0], tip.q[1], tip.q[2], tip.q[3]}}, report);
      own_sum += report.wrench_W.force_N.z;
    }
    own_ns.push_back(static_cast<double>(steadyNowNs() - began_ns) / kTicks);
    began_ns = steadyNowNs();
    for (const nl_pose& tip : tips) {
      nl_step(library, &tip, &wrench);
      library_sum += wrench.force_n[2];
    }
    library_ns.push_back(static_cast<double>(steadyNowNs() - began_ns) / kTicks);
    ratios.push_back(library_ns.back() / own_ns.back());
    nl_engine_destroy(library);
  }
  std::printf(
      "a tick of the engine: %.1f ns; through C: %.1f ns; ratio, median of %d rounds: %.3f (%.3f to %.3f)\n",
      median(own_ns), median(library_ns), kRounds, median(ratios),
      *std::min_element(ratios.begin(), ratios.end()), *std::max_element(ratios.begin(), ratios.end()));
  nl_scene_destroy(scene);
  return own_sum == library_sum ? 0 : 1;  // the same bits
}

}  // namespace
}  // namespace needlelab::test

int main() {
  return needlelab::test::run();
}
