#include "client/device/hand_cli.h"

#include <cmath>
#include <string>

#include "client/device/skilled_hand.h"

namespace needlelab {
namespace {

// CLI::Range lets `nan` pass; this does not
CLI::Validator within(double low, double high, bool low_allowed = true) {
  char range[64];
  std::snprintf(range, sizeof range, "%s%g to %g", low_allowed ? "" : "above ", low, high);
  const std::string allowed = range;
  return CLI::Validator(
      [low, high, low_allowed, allowed](std::string& text) -> std::string {
        double value = 0;
        const bool number = CLI::detail::lexical_cast(text, value);
        if (number && value <= high && (low_allowed ? value >= low : value > low)) return {};
        return "value " + text + ", allowed is " + allowed;
      },
      allowed);
}

// CLI11 2.1 turns -1 into 2^64 − 1
const CLI::Validator kDigits(
    [](std::string& text) -> std::string {
      const bool ok = !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
      return ok ? "" : "value " + text + ", allowed is a whole number from 0 on";
    },
    "from 0 on");

}  // namespace

void addHandOptions(CLI::App& app, HandOptions& o) {
  const auto add = [&](const char* name, auto& value, const char* text) {
    return app.add_option(name, value, text)->capture_default_str()->group("Simulated hand");
  };
  o.correction_per_s = kCommandLineCorrection_per_s;
  o.aspirate = true;
  add("--hand-plan", o.plan,
      "target[:NAME], retry[:NAME], depth[:METRES], rest, a CSV file of tip poses, or, in a window, pointer: "
      "mouse and keys move it");
  auto* skill = app.add_option_function<double>(
                       "--hand-skill",
                       [&o](double level) {
                         const HandSkill hand = skillOf(level);
                         o.skill = level;
                         o.tremor_m = hand.tremor_m;
                         o.speed_mps = hand.speed_mps;
                       },
                       "from 0, a beginner, to 1, an expert: tremor, speed, aim, overshoot and smoothness of "
                       "an attempt at the target")
                    ->group("Simulated hand")
                    ->check(within(0, 1));
  add("--hand-speed-m-s", o.speed_mps, "speed of insertion and withdrawal")
      ->check(within(0, 0.5, false))
      ->excludes(skill);
  add("--hand-hold-s", o.hold_s, "time at the target")->check(within(0, 600, false));
  app.add_flag("--hand-aspirate,!--hand-no-aspirate", o.aspirate,
               "draws the plunger back at the target before it injects; that is the default")
      ->group("Simulated hand");
  add("--hand-repeat", o.repeat, "how often the plan is done; 0 = until stopped")->check(kDigits);
  add("--hand-correction", o.correction_per_s,
      "share of the error that the aim makes up for in a second; 0 = none")
      ->check(within(0, 20));
  add("--hand-tremor-m", o.tremor_m, "tremor in 8-12 Hz, peak per axis")
      ->check(within(0, 0.005))
      ->excludes(skill);
  add("--hand-seed", o.seed, "seed of the tremor")->check(kDigits);
  add("--hand-stiffness", o.stiffness_N_per_m, "in N/m")->check(within(0, 10'000));
  add("--hand-damping", o.damping_Ns_per_m, "in N·s/m")->check(within(0, 100));
  add("--hand-rotational-stiffness", o.rotational_stiffness_Nm_per_rad, "in N·m/rad")->check(within(0, 100));
  add("--hand-rotational-damping", o.rotational_damping_Nms_per_rad, "in N·m·s/rad")->check(within(0, 5));
}

}  // namespace needlelab
