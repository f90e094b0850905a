// A scene from numbers and a law of one's own, in C++: own_scene. Its laws are formulas written here again.
#include <needlelab/haptics.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

namespace {

int failures = 0;
void expect(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "failed: %s\n", what);
  ++failures;
}

struct Spring {
  double stiffness_n_per_m, most_n;
  int calls = 0;
};
double springLaw(const nl_law_input* input, void* user) {
  auto& spring = *static_cast<Spring*>(user);
  ++spring.calls;
  return -std::min(spring.stiffness_n_per_m * std::max(0.0, input->x_m), spring.most_n);
}

// straight in along −z by 20 mm, and out
nl_pose tipAt(int tick) {
  return {{0, 0, 0.002 - 0.022 * 0.5 * (1 - std::cos(2 * M_PI * tick / 2000))}, {1, 0, 0, 0}};
}

}  // namespace

int main() {
  char error[300] = "";
  nl_layer layers[2] = {nl_default_layer(), nl_default_layer()};
  layers[0].thickness_m = 0.005, layers[0].cutting_force_n = 1.5, layers[0].attracted_force_n = 0.6;
  layers[1].thickness_m = 0.05, layers[1].cutting_force_n = 0.8, layers[1].attracted_force_n = 0.3;
  const char* const effects[] = {"CUTTING", "ATTRACTED"};
  nl_scene_def def = nl_default_scene_def();
  def.layers = layers, def.layer_count = 2, def.effects = effects, def.effect_count = 2;
  nl_scene* const scene = nl_scene_create(&def, 1000, error, sizeof error);
  expect(scene != nullptr, error);
  if (scene == nullptr) return 1;
  expect(nl_scene_stiffness_n_per_m(scene) == def.wall_stiffness_n_per_m, "a device must hold the wall");
  const double inside[3] = {0.1, 0, -0.003};
  expect(std::fabs(nl_scene_depth_m(scene, inside) - 0.003) < 1e-15, "depth under a plane");

  // the wall: never more than each layer cuts; deep in a layer and moving, just that
  nl_engine* const wall = nl_engine_create(scene, error, sizeof error);
  nl_report report{};
  report.size = sizeof report;
  double most_n[2] = {0, 0};
  for (int tick = 0; tick < 2000; ++tick) {
    const nl_pose tip = tipAt(tick);
    nl_wrench wrench;
    nl_step(wall, &tip, &wrench);
    nl_get_report(wall, &report);
    if (report.layer >= 0) most_n[report.layer] = std::max(most_n[report.layer], -report.cutting_n);
  }
  for (int i = 0; i < 2; ++i)
    expect(std::fabs(most_n[i] - layers[i].cutting_force_n) < 1e-9,
           "a layer's cutting force is reached, not passed");

  // a law of one's own: the formula's force in each tick, along the needle
  Spring spring{200, 2.5};
  nl_scene* const sprung =
      nl_scene_with_law(scene, springLaw, &spring, spring.stiffness_n_per_m, error, sizeof error);
  expect(sprung != nullptr, error);
  if (sprung == nullptr) return 1;
  nl_scene_destroy(scene);  // what was made of it stays
  expect(nl_scene_stiffness_n_per_m(sprung) == 200, "a device must hold the law");
  nl_engine* const engine = nl_engine_create(sprung, error, sizeof error);
  int inside_ticks = 0;
  for (int tick = 0; tick < 2000; ++tick) {
    const nl_pose tip = tipAt(tick);
    nl_wrench wrench;
    nl_step(engine, &tip, &wrench);
    const double depth_m = -tip.p_m[2], wanted_n = depth_m > 0 ? std::min(200 * depth_m, 2.5) : 0;
    expect(std::fabs(wrench.force_n[2] - wanted_n) < 1e-12, "the law's force, out of the tissue");
    inside_ticks += depth_m > 0;
  }
  expect(spring.calls == inside_ticks, "the law is called in the tissue only");

  // a caller that was compiled with an older, shorter report
  struct {
    nl_report report;
    double behind;
  } old{};
  old.report.size = offsetof(nl_report, palpation_n);
  old.report.palpation_n = old.behind = 42;
  nl_get_report(engine, &old.report);
  expect(old.report.palpation_n == 42 && old.behind == 42, "nothing is written beyond `size`");
  expect(old.report.layer == -1, "what it knows is written");

  // messages name the field
  layers[1].cutting_force_n = 51;
  expect(nl_scene_create(&def, 1000, error, sizeof error) == nullptr, "51 N are refused");
  expect(std::strstr(error, "layers[1].cutting_force_n") != nullptr, error);
  const char* const wrong[] = {"CUTING"};
  layers[1].cutting_force_n = 1, def.effects = wrong, def.effect_count = 1;
  expect(
      nl_scene_create(&def, 1000, error, sizeof error) == nullptr && std::strstr(error, "CUTING") != nullptr,
      error);
  expect(nl_scene_with_law(sprung, nullptr, nullptr, 0, error, sizeof error) == nullptr,
         "a law that is null");
  char tiny[4];
  expect(nl_scene_create(&def, 7, tiny, sizeof tiny) == nullptr && tiny[3] == '\0',
         "a message is cut to its room");
  nl_engine_destroy(engine), nl_engine_destroy(wall), nl_scene_destroy(sprung);
  return failures == 0 ? 0 : 1;
}
