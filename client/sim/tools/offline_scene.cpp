#include "client/sim/tools/offline_scene.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <utility>

#include "client/device/pose_option.h"
#include "common/base/range.h"
#include "common/fem/needle_mesh.h"
#include "common/haptics/geometry.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/scene_spec.h"
#include "common/haptics/surface.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/warnings.h"

namespace needlelab {
namespace {

constexpr double kUsualRate_Hz = 1000;

Result<Pose> poseOr(const std::string& text, const char* option, Quantity reach) {
  if (text.empty()) return Pose{};
  return parsePoseOption(text, option, reach);
}

}  // namespace

TipSample OfflineScene::tip(std::size_t i) const {
  const Pose X_WT = tipFromHandle(track.X_WH[i], X_HT);
  return {X_WT.p, X_WT.q};
}

Result<PoseTrack> readTrackAt(const std::filesystem::path& path, double rate_hz,
                              const TrackReading& reading) {
  ASSIGN_OR_RETURN(auto track, readPoseTrack(path, reading));
  PoseTrack at_ticks;
  at_ticks.holes = std::move(track.holes);
  at_ticks.X_WH = resamplePoses(track, rate_hz);
  at_ticks.plunger = resamplePlunger(track, rate_hz);
  std::size_t row = 0;
  for (std::size_t i = 0; i < at_ticks.X_WH.size(); ++i) {
    const double t_s = track.t_s.front() + static_cast<double>(i) / rate_hz;
    while (row + 1 < track.t_s.size() && track.t_s[row + 1] <= t_s + kOnTick_s) ++row;
    // a row at the tick keeps its own time, bit for bit
    at_ticks.t_s.push_back(std::abs(track.t_s[row] - t_s) <= kOnTick_s ? track.t_s[row] : t_s);
  }
  return at_ticks;
}

Result<OfflineScene> loadOffline(const OfflineOptions& options) {
  const NumberRange rates{kMinRateHz, kMaxRateHz};
  OfflineScene scene;
  scene.rate_hz = options.rate_hz.value_or(kUsualRate_Hz);
  if (!rates.contains(scene.rate_hz)) return outOfRange("--rate in Hz", scene.rate_hz, rates);
  ASSIGN_OR_RETURN(auto X_WL, poseOr(options.placement, "--placement", Quantity::kPlacement));
  ASSIGN_OR_RETURN(auto X_HT, poseOr(options.tool, "--tool", Quantity::kTool));
  scene.X_WL = X_WL;
  scene.X_HT = X_HT;

  ASSIGN_OR_RETURN(auto profile, loadProfile(options.profile));
  scene.profile = std::move(profile);
  if (!options.model.empty()) RETURN_IF_ERROR(chooseModel(scene.profile, options.model));
  auto spec = sceneSpecOf(scene.profile, scene.X_WL);
  if (!spec.ok()) return Error{spec.error().code, options.profile.string() + ": " + spec.error().message};
  if (Status status = addCompliance(*spec); !status.ok())
    return Error{status.error().code, options.profile.string() + ": " + status.error().message};
  auto model = compile(*spec, scene.rate_hz);
  if (!model.ok()) return Error{model.error().code, options.profile.string() + ": " + model.error().message};
  scene.model = *std::move(model);

  if (!options.trajectory.empty()) {
    ASSIGN_OR_RETURN(scene.track, readTrackAt(options.trajectory, scene.rate_hz, options.reading));
  }
  return scene;
}

void addOfflineOptions(CLI::App& app, OfflineOptions& options) {
  app.add_option("--profile", options.profile, "the scene: a profile's JSON")->required();
  app.add_option(
         "--trajectory", options.trajectory,
         "CSV with t_s,px_m,py_m,pz_m,qx,qy,qz,qw and perhaps plunger; straight lines between its rows")
      ->required();
  app.add_option("--lines-above", options.reading.lines_above,
                 "of trajectories: lines above the header, which an instrument writes, 0 to 1000")
      ->check(CLI::Range(0, 1000));
  app.add_flag(
      "--damaged", options.reading.bridges_holes,
      "of trajectories: straight lines bridge their gaps, which are listed (a tracker that lost sight); without it "
      "they are refused");
  app.add_option("--rate", options.rate_hz,
                 "ticks per second, 50 to 40000; 1000 unless a recording says another");
  app.add_option("--model", options.model, "axial model, instead of the profile's");
  app.add_option("--placement", options.placement,
                 "the limb in the device's frame: x,y,z,qx,qy,qz,qw or a JSON file");
  app.add_option(
      "--tool", options.tool,
      "the tip in the handle's frame, when the rows are the handle's: x,y,z,qx,qy,qz,qw or a JSON file");
}

void printWarnings(const OfflineScene& scene) {
  for (const std::string& warning : profileWarnings(scene.profile))
    std::fprintf(stderr, "needlelab-sim: warning: profile %s: %s\n", scene.profile.id().c_str(),
                 warning.c_str());
}

std::uint64_t fnv1a(std::string_view text) {
  std::uint64_t hash = 14695981039346656037u;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211u;
  return hash;
}

void warnOfDirection(const char* command, const Limb& limb, std::size_t rows,
                     const std::function<TipSample(std::size_t)>& tip, QuaternionOrder order) {
  if (const auto warning = needleDirectionWarning(limb, rows, tip, order))
    std::fprintf(stderr, "needlelab-sim %s: warning: %s\n", command, warning->c_str());
}

void warnOfNoContact(const Limb& limb, std::size_t rows, const std::function<TipSample(std::size_t)>& tip) {
  double nearest_m = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < rows && nearest_m < 0; ++i)
    nearest_m = std::max(nearest_m, signedDepth(limb, tip(i).p_WT_m));
  if (nearest_m < 0)
    std::fprintf(
        stderr,
        "needlelab-sim score: warning: the tip never meets the skin; the nearest row is %.3g m above it: do "
        "the units, --tool and --placement fit the trajectory?\n",
        -nearest_m);
}

TipSample tipOf(const GestureSample& sample) {
  return {{sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]},
          {sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]}};
}

}  // namespace needlelab
