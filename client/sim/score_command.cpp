/// `needlelab-sim score`: the measures of a trajectory, equal to the server's for that gesture.
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "client/device/pose_option.h"
#include "client/sim/command.h"
#include "client/sim/tools/closed_loop.h"
#include "client/sim/tools/offline_scene.h"
#include "client/sim/tools/recorded_run.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/range.h"
#include "common/gesture/sample.h"
#include "common/gesture/whole_recording.h"
#include "common/haptics/scene_spec.h"
#include "common/profile/planned_line.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/measures/syringe_events.h"
#include "common/scoring/motion/dtw.h"
#include "common/scoring/motion/part_of_gesture.h"

namespace needlelab {
namespace {

struct ScoreOptions {
  OfflineOptions input;
  std::filesystem::path recorded;                 // instead of a trajectory
  std::vector<std::filesystem::path> references;  // of the same kind
  std::filesystem::path exercise;                 // empty = none
  JsonOption json;
};

// Runs the trajectory through gate and engine, as on a station.
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
      return Error{
          ErrorCode::kFailed,
          fmt::format(
              "row {} of the trajectory: {}; a device would have stopped here, there is no gesture to score",
              i + 1, faultText(tick.fault))};
    const auto due_ns = std::llround(static_cast<double>(tick.tick) * 1e9 / scene.rate_hz);
    samples.push_back(sampleOf(tick, due_ns, 0, 0));
  }
  return samples;
}

struct Scored {
  OfflineScene scene;
  std::vector<GestureSample> samples;
  std::vector<TipPath> references;
  std::vector<std::string> holes;  // in the files, by file
};

// The samples of a recording, or of their CSV. `rate_hz` becomes the first file's rate.
Result<std::vector<GestureSample>> recordedOf(const std::filesystem::path& path, bool damaged,
                                              std::optional<double>& rate_hz, Scored& scored) {
  auto read = readRecordedGesture(path, damaged ? DamagedRecording::kRead : DamagedRecording::kRefuse,
                                  WallColumns::kIgnored, rate_hz);
  if (!read.ok())
    return Error{
        read.error().code,
        read.error().message +
            (damaged || read.error().code != ErrorCode::kCorrupt ? "" : " (--damaged scores what is left)")};
  rate_hz = read->rate_hz;
  for (const std::string& hole : read->holes) scored.holes.push_back(path.string() + ": " + hole);
  if (!read->note.empty()) std::fprintf(stderr, "needlelab-sim: warning: %s\n", read->note.c_str());
  return std::move(read->samples);
}

// The gesture and its references.
Result<Scored> loadScored(const ScoreOptions& options) {
  Scored scored;
  if (!options.recorded.empty()) {
    ASSIGN_OR_RETURN(auto profile, loadProfile(options.input.profile));
    scored.scene.profile = std::move(profile);
    if (!options.input.placement.empty()) {
      ASSIGN_OR_RETURN(const auto X_WL,
                       parsePoseOption(options.input.placement, "--placement", Quantity::kPlacement));
      scored.scene.X_WL = X_WL;
    }
  } else {
    ASSIGN_OR_RETURN(auto scene, loadOffline(options.input));
    scored.scene = std::move(scene);
  }
  std::optional<double> rate_hz = options.input.rate_hz;
  const auto load = [&](const std::filesystem::path& path) -> Result<std::vector<GestureSample>> {
    if (!options.recorded.empty()) {
      auto read = recordedOf(path, options.input.reading.bridges_holes, rate_hz, scored);
      scored.scene.rate_hz = rate_hz.value_or(0);
      return read;
    }
    ASSIGN_OR_RETURN(scored.scene.track, readTrackAt(path, scored.scene.rate_hz, options.input.reading));
    scored.holes.insert(scored.holes.end(), scored.scene.track.holes.begin(), scored.scene.track.holes.end());
    auto samples = gestureOf(scored.scene);
    if (!samples.ok()) return Error{samples.error().code, path.string() + ": " + samples.error().message};
    return samples;
  };
  for (const auto& path : options.references) {
    ASSIGN_OR_RETURN(const auto samples, load(path));
    scored.references.push_back(tipPathOf(samples, scored.scene.rate_hz, scored.scene.X_WL));
    if (scored.references.back().empty())
      return Error{ErrorCode::kInvalidInput,
                   path.string() + ": the tip is never in tissue; nothing to compare with"};
  }
  ASSIGN_OR_RETURN(auto samples,
                   load(options.recorded.empty() ? options.input.trajectory : options.recorded));
  scored.samples = std::move(samples);
  return scored;
}

Result<std::optional<pb::Exercise>> exerciseOf(const std::filesystem::path& path) {
  if (path.empty()) return std::optional<pb::Exercise>();
  ASSIGN_OR_RETURN(const auto text, readWholeFile(path, kMaxProfileBytes));
  ASSIGN_OR_RETURN(auto exercise, parseExercise(text, path.string()));
  if (const Status status = checkRequirements(exercise); !status.ok())
    return Error{status.error().code, path.string() + ": " + status.error().message};
  return std::optional<pb::Exercise>(std::move(exercise));
}

int score(const ScoreOptions& options) {
  if (options.recorded.empty() == options.input.trajectory.empty())
    return failed(
        "score", {ErrorCode::kInvalidInput, "give either --trajectory or --recorded (a device's recording)"});
  const NumberRange rates{kMinRateHz, kMaxRateHz};
  if (options.input.rate_hz && !rates.contains(*options.input.rate_hz))
    return failed("score", outOfRange("--rate in Hz", *options.input.rate_hz, rates));
  std::vector<NamedFile> inputs = {{"--profile", options.input.profile},
                                   {"--trajectory", options.input.trajectory},
                                   {"--recorded", options.recorded},
                                   {"--exercise", options.exercise}};
  for (const auto& path : options.references) inputs.push_back({"--reference", path});
  if (const Status status = checkOutputs(inputs, {{"--json", options.json.file}}); !status.ok())
    return failed("score", status.error());
  const auto scored = loadScored(options);
  if (!scored.ok()) return failed("score", scored.error());
  const OfflineScene& scene = scored->scene;
  printWarnings(scene);
  for (const std::string& hole : scored->holes) std::fprintf(stderr, "damaged: %s\n", hole.c_str());
  if (!options.recorded.empty())
    for (const std::string& part : partOfGesture(scored->samples, scene.rate_hz))
      std::fprintf(stderr, "needlelab-sim: warning: %s\n", part.c_str());
  const auto spec = sceneSpecOf(scene.profile, scene.X_WL);
  if (!spec.ok()) return failed("score", spec.error());
  const auto tip = [&](std::size_t i) { return tipOf(scored->samples[i]); };
  warnOfDirection("score", spec->limb, scored->samples.size(), tip,
                  options.recorded.empty() ? QuaternionOrder::kUnsure : QuaternionOrder::kSure);
  warnOfNoContact(spec->limb, scored->samples.size(), tip);
  const auto exercise = exerciseOf(options.exercise);
  if (!exercise.ok()) return failed("score", exercise.error());
  if (exercise->has_value()) {
    if (const Status fits = checkPlan(**exercise, scene.profile, ""); !fits.ok())
      return failed("score", {fits.error().code, options.exercise.string() + ": " + fits.error().message});
  }
  const pb::Exercise* required = exercise->has_value() ? &**exercise : nullptr;
  const auto measures =
      scoreGesture(scored->samples, scene.rate_hz, scene.profile, scene.X_WL, required, scored->references);
  const auto events = syringeEvents(scored->samples, scene.rate_hz, scene.profile, scene.X_WL);
  if (!options.json.wanted) {
    std::fputs(scoreText(measures).c_str(), stdout);
    for (const pb::SyringeEvent& event : events) std::printf("\n%s", eventText(event).c_str());
    if (!events.empty()) std::fputs("\n", stdout);
    if (!scored->holes.empty())
      std::printf("incomplete: measures of a gesture with %zu %s (--damaged)\n", scored->holes.size(),
                  scored->holes.size() == 1 ? "gap" : "gaps");
    return kExitDone;
  }
  const auto rows = nlohmann::ordered_json::parse(scoreJson(measures));
  nlohmann::ordered_json more = {{"events", nlohmann::ordered_json::parse(eventsJson(events))},
                                 {"definition_version", kScoreDefinitionVersion}};
  if (options.input.reading.bridges_holes) {
    more["holes"] = scored->holes;
    more["incomplete"] = !scored->holes.empty();
  }
  if (const Status status = writeJson(options.json, rows, more); !status.ok())
    return failed("score", status.error());
  return kExitDone;
}

}  // namespace

void addScoreCommand(CLI::App& app, SimCommand& chosen) {
  auto options = std::make_shared<ScoreOptions>();
  CLI::App* command = app.add_subcommand("score", "Gives the measures of a trajectory in a scene");
  addOfflineOptions(*command, options->input);
  command->get_option("--trajectory")->required(false);
  command->add_option(
      "--recorded", options->recorded,
      "instead of a trajectory: a session's recording, or its samples as CSV (session export --every-tick); nothing is "
      "recomputed, so that the measures are the server's");
  command->get_option("--damaged")
      ->description(
          "also scores what is left of damaged recordings, and trajectories with gaps (a tracker that lost sight), which "
          "straight lines bridge; lists all gaps and marks the measures as incomplete; without it they are refused");
  command->add_option("--reference", options->references,
                      "a gesture to compare with, of the same kind; may be given several times");
  command->add_option("--exercise", options->exercise, "an exercise's JSON: its requirements are checked");
  addJsonOption(*command, options->json);
  command->callback([options, &chosen] { chosen = [options] { return score(*options); }; });
}

}  // namespace needlelab
