/// `needlelab-sim stiffness`: what a device holds along the needle, and what profiles ask of it
/// (FORCE_MODEL.md, "Stiffnesses").
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/device/falcon/falcon_geometry.h"
#include "client/device/hand/hand_options.h"
#include "client/sim/command.h"
#include "client/sim/stability/loop/stiffness_theory.h"
#include "client/sim/tools/offline_scene.h"
#include "common/base/program.h"
#include "common/haptics/axial_entry.h"
#include "common/haptics/body/path_stack.h"
#include "common/haptics/gate/handle_stiffness.h"
#include "common/haptics/surface.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

constexpr std::array<int, 5> kDelays_ticks = {1, 2, 3, 4, 6};
constexpr double kPeriod_s = 1e-3;

/// A device, alone or with that grip. A Virtuose's limits are the defaults.
struct Holder {
  const char *name, *json_name;
  DeviceLimits limits;
  double grip_Ns_per_m;

  [[nodiscard]] double most_N_per_m(int delay_ticks, double taken_Ns_per_m = 0) const {
    return passiveStiffnessLimit(limits.damping_Ns_per_m + grip_Ns_per_m - taken_Ns_per_m, kPeriod_s,
                                 delay_ticks);
  }
  /// The longest delay at which it holds the scene; empty: none.
  [[nodiscard]] std::optional<int> holds_ticks(const SceneModel& model) const {
    const double at_once = model.axialStiffness_N_per_m();
    if (at_once > limits.max_stiffness_N_per_m) return std::nullopt;
    const double own = model.isLive(Effect::kCutting) ? model.axial_damping_Ns_per_m : 0.0;
    std::optional<int> longest;
    for (const int delay : kDelays_ticks)
      if (at_once <= most_N_per_m(delay, own) * (1 + 1e-9)) longest = delay;
    return longest;
  }
};
constexpr std::array<Holder, 4> kHolders = {
    {{"Virtuose", "virtuose", {}, 0},
     {"Virtuose and grip", "virtuose_grip", {}, kLightestGrip_Ns_per_m},
     {"Falcon", "falcon", falcon::kLimits, 0},
     {"Falcon and grip", "falcon_grip", falcon::kLimits, kLightestGrip_Ns_per_m}}};

struct StiffnessRow {
  std::string profile;
  AlongStiffness along;
  std::array<std::optional<int>, kHolders.size()> holds_ticks;
  std::optional<double> pull_m;
};

/// How far a needle in to this depth is drawn back until all attraction and friction pull it, the friction of
/// that depth. `way_m`: its inserted length.
double pullIn(const SceneModel& model, double depth_m, double way_m) {
  double wall_m = 0, friction_N = 0;
  for (std::uint32_t i = 0; i < model.layer_count; ++i) {
    const CompiledLayer& layer = model.layers[i];
    if (layer.top_m >= depth_m) break;
    wall_m = layer.cut_stretch_m + layer.attracted_stretch_m;
    friction_N +=
        layer.friction_N_per_m * (std::min(layer.bottom_m, depth_m) - layer.top_m) * way_m / depth_m;
  }
  if (!model.isLive(Effect::kShaftFriction)) return wall_m;
  return std::max(wall_m, 2 * friction_N / model.friction_stiffness_N_per_m);
}

/// On the straight way from the profile's entry to its deepest target. Empty: the model pulls by other
/// numbers than the layers', or no needle goes in there.
std::optional<double> pullAfter(const OfflineScene& scene) {
  const SceneModel& model = scene.model;
  if (!axialEntry(model.axial_model).follows_layers) return std::nullopt;
  Vec3 target_m;
  double depth_m = 0;
  for (const pb::Target& target : scene.profile.targets()) {
    const Vec3 center_m = vectorOf(target.center_m());
    const double below_m = target.has_center_m() ? depthBelowSkin(model.limb, center_m) : 0;
    if (below_m <= depth_m) continue;
    target_m = center_m;
    depth_m = below_m;
  }
  const Vec3 in{0, 0, -1};
  const Vec3 entry_m = markedEntry(model.limb, {}).value_or(closestSkin(model.limb, target_m, in));
  const Vec3 out = surfaceNormal(model.limb, entry_m, in);
  const Vec3 way_m = depth_m > 0 ? target_m - entry_m : out * (-0.5 * model.needle_length_m);
  if (depth_m == 0) depth_m = norm(way_m);
  if (model.body_spec == nullptr) return pullIn(model, depth_m, norm(way_m));
  PathAsk ask;
  ask.p_tip_W_m = entry_m + out * 1e-3;
  ask.axis_W = normalized(way_m);
  PathLayers path;
  const auto stack = findPath(model, ask, path) ? compilePath(model, path) : nullptr;
  if (stack == nullptr) return std::nullopt;
  return pullIn(stack->model, -dot(path.normal_W, way_m), norm(way_m));
}

std::string delayText(const std::optional<int>& ticks) {
  return ticks ? std::to_string(*ticks) : "–";
}

void printTables(const std::vector<StiffnessRow>& rows) {
  std::printf("| N/m, at a delay of | 1 tick | 2 | 3 | 4 | 6 |\n|---|--:|--:|--:|--:|--:|\n");
  for (const Holder& holder : kHolders) {
    std::printf("| %s, %.1f N·s/m |", holder.name, holder.limits.damping_Ns_per_m + holder.grip_Ns_per_m);
    for (const int delay : kDelays_ticks) std::printf(" %.0f |", holder.most_N_per_m(delay));
    std::printf("\n");
  }
  std::printf(
      "\n| N/m | tissue | membrane | fixture | hub | bone or cap | at once | Virtuose, ticks | Falcon, ticks | "
      "pull after, mm |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  for (const StiffnessRow& row : rows) {
    std::printf("| `%s` |", row.profile.c_str());
    for (const double own : {row.along.tissue_N_per_m, row.along.membrane_N_per_m, row.along.fixture_N_per_m,
                             row.along.hub_N_per_m, row.along.alone_N_per_m})
      std::printf(" %s |", own > 0 ? fmt::format("{:.0f}", own).c_str() : "–");
    std::printf(" **%.0f** |", std::ceil(row.along.atOnce() - 1e-6) + 0.0);  // no −0
    for (std::size_t i = 0; i < kHolders.size(); i += 2)
      std::printf(" %s, %s |", delayText(row.holds_ticks[i]).c_str(),
                  delayText(row.holds_ticks[i + 1]).c_str());
    std::printf(" %s |\n", row.pull_m > 0.0 ? fmt::format("{:.1f}", 1e3 * *row.pull_m).c_str() : "–");
  }
}

Status printJson(const std::vector<StiffnessRow>& rows) {
  const auto orNull = [](const auto& value) {
    return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json();
  };
  auto limits = nlohmann::ordered_json::object();
  for (const Holder& holder : kHolders)
    for (const int delay : kDelays_ticks) limits[holder.json_name].push_back(holder.most_N_per_m(delay));
  auto profiles = nlohmann::ordered_json::array();
  for (const StiffnessRow& row : rows) {
    nlohmann::ordered_json& one = profiles.emplace_back();
    one = {{"profile", row.profile},
           {"tissue_n_per_m", row.along.tissue_N_per_m},
           {"membrane_n_per_m", row.along.membrane_N_per_m},
           {"fixture_n_per_m", row.along.fixture_N_per_m},
           {"hub_n_per_m", row.along.hub_N_per_m},
           {"bone_or_cap_n_per_m", row.along.alone_N_per_m},
           {"at_once_n_per_m", row.along.atOnce()},
           {"pull_after_m", orNull(row.pull_m)}};
    for (std::size_t i = 0; i < kHolders.size(); ++i)
      one[std::string(kHolders[i].json_name) + "_holds_ticks"] = orNull(row.holds_ticks[i]);
  }
  return writeJson({true, {}}, profiles, {{"delays_ticks", kDelays_ticks}, {"limits_n_per_m", limits}});
}

int stiffness(const std::vector<std::filesystem::path>& profiles, bool json) {
  std::vector<StiffnessRow> rows;
  for (const std::filesystem::path& path : profiles) {
    OfflineOptions options;  // 1000 Hz
    options.profile = path;
    const auto scene = loadOffline(options);
    if (!scene.ok()) return failed("stiffness", scene.error());
    StiffnessRow& row = rows.emplace_back();
    row.profile = scene->profile.id();
    row.along = alongStiffness(scene->model);
    row.pull_m = pullAfter(*scene);
    for (std::size_t i = 0; i < kHolders.size(); ++i)
      row.holds_ticks[i] = kHolders[i].holds_ticks(scene->model);
  }
  if (!json) {
    printTables(rows);
    return kExitDone;
  }
  const Status status = printJson(rows);
  return status.ok() ? kExitDone : failed("stiffness", status.error());
}

}  // namespace

void addStiffnessCommand(CLI::App& app, SimCommand& chosen) {
  struct Options {
    std::vector<std::filesystem::path> profiles;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "stiffness", "What the devices hold along the needle at 1 kHz, and what acts at once in profiles");
  command->add_option("PROFILE", options->profiles, "profiles, a row each")->required();
  // no FILE: it would swallow a profile
  command->add_flag("--json", options->json, "JSON instead of tables");
  command->callback(
      [options, &chosen] { chosen = [options] { return stiffness(options->profiles, options->json); }; });
}

}  // namespace needlelab
