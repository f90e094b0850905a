#include "client/sim/tools/offline_scene.h"

#include <algorithm>
#include <utility>

#include "client/device/pose_option.h"
#include "common/base/range.h"
#include "common/fem/needle_mesh.h"
#include "common/haptics/limits.h"
#include "common/haptics/tool_transform.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

Result<Pose> poseOr(const std::string& text, const char* option) {
  if (text.empty()) return Pose{};
  return parsePoseOption(text, option);
}

}  // namespace

std::vector<std::string> axialModelNames() {
  return {kAxialModelNames.begin(), kAxialModelNames.end()};
}

TipSample OfflineScene::tip(std::size_t i) const {
  const Pose X_WT = tipFromHandle(track.X_WH[i], X_HT);
  return {X_WT.p, X_WT.q};
}

Result<OfflineScene> loadOffline(const OfflineOptions& options) {
  const NumberRange rates{kMinRateHz, kMaxRateHz};
  if (!rates.contains(options.rate_hz)) return outOfRange("--rate in Hz", options.rate_hz, rates);
  OfflineScene scene;
  scene.rate_hz = options.rate_hz;
  auto X_WL = poseOr(options.placement, "--placement");
  if (!X_WL.ok()) return X_WL.error();
  auto X_HT = poseOr(options.tool, "--tool");
  if (!X_HT.ok()) return X_HT.error();
  scene.X_WL = *X_WL;
  scene.X_HT = *X_HT;

  auto profile = loadProfile(options.profile);
  if (!profile.ok()) return profile.error();
  scene.profile = *std::move(profile);
  if (!options.model.empty())
    if (Status status = chooseModel(scene.profile, options.model); !status.ok()) return status.error();
  auto spec = sceneSpecOf(scene.profile, scene.X_WL);
  if (!spec.ok()) return Error{spec.error().code, options.profile.string() + ": " + spec.error().message};
  if (Status status = addCompliance(*spec); !status.ok())
    return Error{status.error().code, options.profile.string() + ": " + status.error().message};
  auto model = compile(*spec, options.rate_hz);
  if (!model.ok()) return Error{model.error().code, options.profile.string() + ": " + model.error().message};
  scene.model = *std::move(model);

  // rows are ticks, whatever their times say
  auto track = readPoseTrack(options.trajectory, TrackTimes::kAnyOrder);
  if (!track.ok()) return track.error();
  scene.track = *std::move(track);
  return scene;
}

}  // namespace needlelab
