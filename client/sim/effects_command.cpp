/// `needlelab-sim effects`: what each live effect adds to a tick.
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "client/effect_cost/tick_cost.h"
#include "client/sim/command.h"
#include "client/sim/effects_study.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files/files.h"
#include "common/base/program.h"

namespace needlelab {
namespace {

struct EffectsOptions {
  std::filesystem::path profile, out;
  double rate_hz = 1000;
  bool instructions = false, no_instructions = false, count_only = false;
  JsonOption json;
};

// The command to run this program on the same scene under callgrind.
std::vector<std::string> countingCommand(const EffectsOptions& options) {
  std::vector<std::string> command = {ownProgram(), "effects", "--count-only", "--rate",
                                      std::to_string(options.rate_hz)};
  if (!options.profile.empty()) command.insert(command.end(), {"--profile", options.profile.string()});
  return command;
}

// With --instructions counting must work; without it counts are optional.
Status count(const EffectsOptions& options, const SceneSpec& scene, std::vector<EffectSetCost>& sets) {
  if (options.no_instructions || (!options.instructions && !hasValgrind())) return {};
  if (::isatty(STDERR_FILENO) != 0) std::fprintf(stderr, "counting instructions under callgrind ...\n");
  Status status = countEffectSets(countingCommand(options), ticksOfGesture(scene, options.rate_hz), sets);
  if (status.ok() || options.instructions) return status;
  std::fprintf(stderr, "needlelab-sim effects: no instruction counts: %s\n", status.error().message.c_str());
  return {};
}

nlohmann::ordered_json rowsOf(const std::vector<EffectSetCost>& sets) {
  auto rows = nlohmann::ordered_json::array();
  const auto rounded = [](double ns) { return std::round(ns * 100) / 100; };
  for (const EffectSetCost& set : sets)
    rows.push_back(
        {{"scene", set.scene},
         {"effects", effectNames(set.effects)},
         {"median_ns", rounded(set.timing.median_ns)},
         {"p99_ns", rounded(set.timing.p99_ns)},
         {"instructions", set.instructions ? nlohmann::ordered_json(std::round(*set.instructions * 10) / 10)
                                           : nlohmann::ordered_json(nullptr)}});
  return rows;
}

int effects(const EffectsOptions& options) {
  const auto scenes = effectsScenes(options.profile);
  if (!scenes.ok()) return failed("effects", scenes.error());
  if (options.count_only) {
    const Status status = runSetsForCounting(*scenes, options.rate_hz);
    return status.ok() ? kExitDone : failed("effects", status.error());
  }
  if (!options.out.empty()) {
    std::error_code made;
    std::filesystem::create_directories(options.out, made);
    if (made)
      return failed("effects", {ErrorCode::kInvalidInput, "--out " + options.out.string() +
                                                              ": cannot make the folder: " + made.message()});
  }
  if (const Status status =
          checkFolderOutputs({{"--profile", options.profile}}, {"--out", options.out},
                             {"effects.csv", "effects_marginal.csv", "effects.png"}, options.json);
      !status.ok())
    return failed("effects", status.error());

  const bool terminal = ::isatty(STDERR_FILENO) != 0;
  auto sets = timeEffectSets(*scenes, options.rate_hz, [&](double share) {
    if (terminal) std::fprintf(stderr, "\rtiming %3.0f %%%s", share * 100, share >= 1 ? "\n" : "");
  });
  if (!sets.ok()) return failed("effects", sets.error());
  if (const Status status = count(options, scenes->front().spec, *sets); !status.ok())
    return failed("effects", status.error());

  if (!options.out.empty()) {
    if (const Status status = drawEffects(*sets, options.out); !status.ok())
      return failed("effects", status.error());
    if (!hasGnuplot())
      std::fprintf(stderr,
                   "needlelab-sim effects: gnuplot is not on the PATH: table only (Debian: gnuplot-nox)\n");
  }
  if (!options.json.wanted || !options.json.file.empty()) std::printf("%s", effectsTable(*sets).c_str());
  if (options.json.wanted)
    if (const Status status = writeJson(options.json, rowsOf(*sets)); !status.ok())
      return failed("effects", status.error());
  return kExitDone;
}

}  // namespace

void addEffectsCommand(CLI::App& app, SimCommand& chosen) {
  auto options = std::make_shared<EffectsOptions>();
  CLI::App* command = app.add_subcommand(
      "effects",
      "What a tick costs with no effect, with each, without each and with all, in ns and in instructions");
  command->add_option("--profile", options->profile,
                      "scene to measure; without it the paper's six layers with all effects, and a body");
  command->add_option("--rate", options->rate_hz, "haptic rate in Hz, 50 to 40000")->capture_default_str();
  command->add_option("--out", options->out, "folder for effects.csv, effects_marginal.csv and effects.png");
  CLI::Option* must = command->add_flag("--instructions", options->instructions,
                                        "fail when instructions cannot be counted (they are counted "
                                        "whenever valgrind is there)");
  command->add_flag("--no-instructions", options->no_instructions, "do not count: quicker")->excludes(must);
  command->add_flag("--count-only", options->count_only)->group("");
  addJsonOption(*command, options->json);
  command->callback([options, &chosen] { chosen = [options] { return effects(*options); }; });
}

}  // namespace needlelab
