#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <system_error>

#include "client/device/hand/hand_plan.h"
#include "client/device/recording/recording_device.h"
#include "client/sim/accuracy/study.h"
#include "common/haptics/engine.h"

namespace needlelab {
namespace {

constexpr double kFineRate_hz = kReplayFactor * kStationRate_hz;
constexpr std::size_t kHalfMean = 5 * kReplayFactor;  // half of 10 ms
constexpr double kBall_m = 0.04;                      // maximum radius: limits the depth to a needle's length

std::vector<Vec3> smoothed(const std::vector<Pose>& poses) {
  std::vector<Vec3> sums(poses.size() + 1), path_m;
  for (std::size_t i = 0; i < poses.size(); ++i) sums[i + 1] = sums[i] + poses[i].p;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::size_t half = std::min({kHalfMean, i, poses.size() - 1 - i});
    path_m.push_back((sums[i + half + 1] - sums[i - half]) * (1.0 / static_cast<double>(2 * half + 1)));
  }
  return path_m;
}

double greatestSpeed_mps(const std::vector<RecordedHand>& hands) {
  double way_m = 0;
  for (const RecordedHand& hand : hands)
    for (std::size_t i = 1; i < hand.path_m.size(); ++i)
      way_m = std::max(way_m, norm(hand.path_m[i] - hand.path_m[i - 1]));
  return way_m * kFineRate_hz;
}

Vec3 read(Vec3 p_m) {
  const auto step = [](double x_m) { return kStationEncoder_m * std::floor(x_m / kStationEncoder_m + 0.5); };
  return {step(p_m.x), step(p_m.y), step(p_m.z)};
}

}  // namespace

Result<std::vector<RecordedHand>> recordedHands(const std::filesystem::path& data) {
  std::vector<RecordedHand> hands;
  if (data.empty()) return hands;
  for (const char* name : {"backward", "downward", "lateral_left", "virtuose_x_backward"}) {
    const auto file = data / "virtuose" / (std::string(name) + ".csv");
    std::error_code unreadable;  // treat as missing
    if (!std::filesystem::is_regular_file(file, unreadable)) continue;
    ASSIGN_OR_RETURN(const auto track, readPoseTrack(file));
    RecordedHand hand{name, smoothed(resamplePoses(track, kFineRate_hz)), {}, {}};
    const Vec3 start = hand.path_m.front();
    const Vec3 far = *std::max_element(hand.path_m.begin(), hand.path_m.end(),
                                       [&](Vec3 a, Vec3 b) { return norm(a - start) < norm(b - start); });
    if (norm(far - start) < 0.005) continue;  // a hand at rest
    hand.limb = {far, std::min(kBall_m, 0.6 * norm(far - start))};
    hand.needle = orientationAlong(far - start);
    hands.push_back(std::move(hand));
  }
  return hands;
}

Result<ForceError> replayError(SceneSpec scene, const RecordedHand& hand) {
  scene.limb = hand.limb;
  ASSIGN_OR_RETURN(const auto coarse, compile(scene, kStationRate_hz));
  ASSIGN_OR_RETURN(const auto fine, compile(scene, kFineRate_hz));
  SimState coarse_state{}, fine_state{};
  StepReport coarse_report, fine_report;
  ForceError error;
  for (std::size_t i = 0; i < hand.path_m.size(); ++i) {
    step(fine, {hand.path_m[i], hand.needle}, fine_state, fine_report);
    if (i % kReplayFactor == 0)
      step(coarse, {read(hand.path_m[i]), hand.needle}, coarse_state, coarse_report);
    if (signedDepth(fine.limb, hand.path_m[i]) > 0)
      error.add(axialForce_N(coarse_report), axialForce_N(fine_report));
  }
  return error;
}

Result<AccuracyRows> replayRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                std::vector<std::string>& notes) {
  ASSIGN_OR_RETURN(const auto hands, recordedHands(options.data));
  if (hands.empty()) {
    notes.push_back(
        "replay: " + (options.data / "virtuose").string() +
        " has no recorded hands: set NEEDLELAB_DATA (or --data) to the folder that holds virtuose");
    return AccuracyRows{};
  }
  ASSIGN_OR_RETURN(const auto scene, studyScene());
  ASSIGN_OR_RETURN(const auto models, studyModels(scene));
  AccuracyRows rows;
  for (const StudyModel& study : models) {
    if (study.stations > 0 && study.stations != kStationCounts[std::size(kStationCounts) - 1]) continue;
    progress(axialModelName(study.model),
             static_cast<double>(rows.size()) / static_cast<double>(models.size()));
    AccuracyRow row;
    row.comparator = Comparator::kReplay;
    row.scene = "six layers around each hand's farthest point";
    row.model = axialModelName(study.model);
    if (study.stations == 0) row.variant = study.variant;
    row.against = "itself at 16 kHz with exact encoders, along the same hands";
    row.rate_hz = kStationRate_hz;
    row.encoder_m = kStationEncoder_m;
    if (study.stations > 0) row.stations = study.stations;
    std::vector<ForceError> errors;
    for (const RecordedHand& hand : hands) {
      ASSIGN_OR_RETURN(const auto error, replayError(study.spec, hand));
      if (error.count() > 0) errors.push_back(error);
    }
    setError(row, errors);
    row.cannot_show = fmt::format(
        "whether the law is right, and what a hand does that feels the force: these hands moved freely, up "
        "to {:.2f} m/s",
        greatestSpeed_mps(hands));
    if (const std::string assumed = frictionAssumption(scene, study.model); !assumed.empty())
      row.cannot_show += ". " + assumed;
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace needlelab
