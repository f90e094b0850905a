/// `needlelab-sim score`: the measures of a trajectory, as the server would give them for that gesture.
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/exit_code.h"
#include "base/output_check.h"
#include "profile/profile.h"
#include "scoring/measures.h"
#include "scoring/syringe_events.h"
#include "sim/closed_loop.h"
#include "sim/command.h"
#include "sim/json_output.h"
#include "sim/offline_cli.h"

namespace needlelab {
namespace {

struct ScoreOptions {
  OfflineOptions input;
  std::filesystem::path exercise;  // empty = none
  JsonOption json;
};

// the trajectory through gate and engine, as a station would have recorded it
Result<std::vector<GestureSample>> gestureOf(const OfflineScene& scene) {
  HapticChain chain(scene.model, DeviceLimits{}, scene.X_HT);
  std::vector<GestureSample> samples;
  samples.reserve(scene.track.X_WH.size());
  ChainTick tick;
  for (std::size_t i = 0; i < scene.track.X_WH.size(); ++i) {
    DeviceReading reading;
    reading.X_WH = scene.track.X_WH[i];
    if (!scene.track.plunger.empty()) reading.plunger = scene.track.plunger[i];
    chain.tick(reading, true, 1, 1.0, tick);
    if (tick.fault != Fault::kNone)
      return Error{ErrorCode::kFailed,
                   "row " + std::to_string(i + 1) + " of the trajectory: " + faultText(tick.fault) +
                       "; a device would have stopped here, there is no gesture to score"};
    const auto due_ns = std::llround(static_cast<double>(tick.tick) * 1e9 / scene.rate_hz);
    samples.push_back(sampleOf(tick, due_ns, 0, 0));
  }
  return samples;
}

Result<std::optional<pb::Exercise>> exerciseOf(const std::filesystem::path& path) {
  if (path.empty()) return std::optional<pb::Exercise>();
  const auto text = readWholeFile(path, kMaxProfileBytes);
  if (!text.ok()) return text.error();
  auto exercise = parseExercise(*text, path.string());
  if (!exercise.ok()) return exercise.error();
  if (const Status status = checkRequirements(*exercise); !status.ok())
    return Error{status.error().code, path.string() + ": " + status.error().message};
  return std::optional<pb::Exercise>(*std::move(exercise));
}

int score(const ScoreOptions& options) {
  if (const Status status = checkOutputs({{"--profile", options.input.profile},
                                          {"--trajectory", options.input.trajectory},
                                          {"--exercise", options.exercise}},
                                         {{"--json", options.json.file}});
      !status.ok())
    return failed("score", status.error());
  const auto scene = loadOffline(options.input);
  if (!scene.ok()) return failed("score", scene.error());
  sayWarnings(*scene);
  const auto samples = gestureOf(*scene);
  if (!samples.ok()) return failed("score", samples.error());
  const auto exercise = exerciseOf(options.exercise);
  if (!exercise.ok()) return failed("score", exercise.error());
  const pb::Exercise* required = exercise->has_value() ? &**exercise : nullptr;
  const auto measures = scoreGesture(*samples, scene->rate_hz, scene->profile, scene->X_WL, required);
  const auto events = syringeEvents(*samples, scene->rate_hz, scene->profile, scene->X_WL);
  if (!options.json.wanted) {
    std::fputs(scoreText(measures).c_str(), stdout);
    for (const pb::SyringeEvent& event : events) std::printf("\n%s", eventText(event).c_str());
    if (!events.empty()) std::fputs("\n", stdout);
    return kExitDone;
  }
  const auto rows = nlohmann::ordered_json::parse(scoreJson(measures));
  const nlohmann::ordered_json more = {{"events", nlohmann::ordered_json::parse(eventsJson(events))}};
  if (const Status status = writeJson(options.json, rows, more); !status.ok())
    return failed("score", status.error());
  return kExitDone;
}

}  // namespace

void addScoreCommand(CLI::App& app, SimCommand& chosen) {
  auto options = std::make_shared<ScoreOptions>();
  CLI::App* command = app.add_subcommand("score", "Gives the measures of a trajectory in a scene");
  addOfflineOptions(*command, options->input);
  command->add_option("--exercise", options->exercise, "an exercise's JSON: its requirements are checked");
  addJsonOption(*command, options->json);
  command->callback([options, &chosen] { chosen = [options] { return score(*options); }; });
}

}  // namespace needlelab
