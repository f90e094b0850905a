#include "client/station/run/lesson/demonstration.h"

#include <fmt/core.h>

#include <cmath>
#include <utility>

#include "client/device/hand/simulated_device.h"
#include "client/device/haptic_chain.h"
#include "client/station/run/lesson/memory_follower.h"
#include "common/profile/planned_line.h"

namespace needlelab {
namespace {

constexpr double kSpeed_mps = 0.012, kHold_s = 4;  // slow enough to be followed
constexpr double kExpert = 1;

}  // namespace

PlannedInsertion insertionOf(const StationLesson& lesson, const Pose& X_WL) {
  auto line_W = lesson.exercise ? plannedLineOf(*lesson.exercise, X_WL) : std::nullopt;
  if (line_W) line_W = onSkin(*line_W, lesson.scene.limb).value_or(*line_W);
  return plannedInsertion(lesson.scene, targetsOf(lesson.profile, X_WL), line_W);
}

Result<Demonstration> demonstrationOf(const StationLesson& lesson, const Pose& X_WL, bool capped) {
  const SceneModel& model = lesson.model;
  const PlannedInsertion way = insertionOf(lesson, X_WL);
  PlanStyle style;
  style.insertion_speed_mps = kSpeed_mps;
  style.approach_m = kSteeredStart_m;
  style.hold_s = kHold_s;
  style.aspirate = true;
  HandPlan plan = insertionPlan(way.entry_W_m, way.direction_W, way.depth_m, style);
  if (capped) plan = withCapTakenOff(plan, lesson.scene, way.landmark_W_m);
  SimulatedDeviceOptions options;
  options.hand = handOf(skillOf(kExpert), 1);
  SimulatedDevice device(options, std::move(plan));
  RETURN_IF_ERROR(device.open(model.rate_hz));
  HapticChain chain(model, device.info(), {});
  if (capped) chain.beginCapped();
  MemoryFollower follower(model);

  Demonstration made;
  const auto ticks_per_piece = static_cast<std::size_t>(std::llround(made.piece_s * model.rate_hz));
  DeviceReading reading;
  ChainTick tick;
  for (DeviceRead read = device.read(reading); read != DeviceRead::kFinished; read = device.read(reading)) {
    device.write(chain.tick(reading, read == DeviceRead::kFresh, 1, 1.0, tick));
    if (tick.fault != Fault::kNone)
      return Error{ErrorCode::kFailed, fmt::format("the force was taken away: {}", faultText(tick.fault))};
    if (made.pieces.empty() || made.pieces.back().samples.size() >= ticks_per_piece)
      made.pieces.emplace_back();
    Demonstration::Piece& piece = made.pieces.back();
    const auto time_ns = std::llround(static_cast<double>(tick.tick) * 1e9 / model.rate_hz);
    follower.follow(piece.samples.emplace_back(sampleOf(tick, time_ns, 0, 0)));
    if (piece.samples.size() < ticks_per_piece) continue;
    piece.cut_memory = follower.cutsDue();
    piece.paths = follower.pathsDue();
  }
  return made;
}

}  // namespace needlelab
