#include "station/options.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <utility>

#include "base/exit_code.h"
#include "base/output_check.h"
#include "base/text_rules.h"
#include "device/hand_cli.h"
#include "device/plunger_option.h"
#include "device/pose_option.h"
#include "device_factory/device_factory.h"
#include "haptics/limits.h"
#include "station/station_key.h"
#include "wire/version.h"

namespace needlelab {
namespace {

std::filesystem::path defaultSpool() {
  const char* state = std::getenv("XDG_STATE_HOME");
  const char* home = std::getenv("HOME");
  std::filesystem::path base = "/var/lib";
  if (state != nullptr && *state != '\0')
    base = state;
  else if (home != nullptr && *home != '\0')
    base = std::filesystem::path(home) / ".local" / "state";
  return base / "needlelab" / "spool";
}

// what CLI11 cannot check by itself
Status complete(StationOptions& options, const std::string& server, const std::string& tool,
                const std::string& placement, double keep_days, double quota_mib) {
  const auto usage = [](const std::string& text) { return Error{ErrorCode::kInvalidInput, text}; };
  // CLI11 compares with the range's ends, and lets not-a-number through
  const std::pair<const char*, double> numbers[] = {
      {"--rate", options.rate_hz},  {"--seconds", options.seconds}, {"--spin-us", options.spin_us},
      {"--drain", options.drain_s}, {"--spool-keep", keep_days},    {"--spool-quota", quota_mib}};
  for (const auto& [name, value] : numbers)
    if (std::isnan(value)) return usage(std::string(name) + " is not a number");
  if (options.mode != StationMode::kCalibrate && !options.tool_out.empty())
    return usage("--out is the tool file that --calibrate writes; add --calibrate, or leave --out away");
  if (!server.empty()) {
    auto endpoint = parseEndpoint(server);
    if (!endpoint.ok()) return endpoint.error();
    options.server = *endpoint;
    if (options.ca_file.empty()) return usage("--server needs --ca FILE, the server's tls/ca.crt");
    if (options.key_file.empty())
      return usage("--server needs --key FILE, made by needlelab-admin station add");
    if (options.trainee.empty() && options.mode == StationMode::kLesson)
      return usage("--server needs --trainee NAME: whose lesson is it?");
  }
  if (options.mode == StationMode::kLesson && options.exercise.empty() && options.profile_file.empty())
    return usage(
        "there is nothing to practise: give --exercise ID, or --profile FILE for a profile of your own");
  if (!options.exercise.empty() && !options.profile_file.empty())
    return usage("--exercise and --profile exclude each other: an exercise has its own profile");
  if (!tool.empty()) {
    auto pose = parsePoseOption(tool, "--tool");
    if (!pose.ok()) return pose.error();
    options.X_HT = *pose;
    options.tool_given = true;
  }
  if (!placement.empty()) {
    auto pose = parsePoseOption(placement, "--placement");
    if (!pose.ok()) return pose.error();
    options.X_WL = *pose;
  }
  options.keep.age_s = static_cast<std::int64_t>(keep_days * 86'400);
  options.keep.quota_bytes = static_cast<std::uint64_t>(quota_mib * 1024 * 1024);
  if (options.spool.empty()) options.spool = defaultSpool();
  // without a key the station has no name yet: it gets one when its sessions are uploaded
  if (!options.station.empty())
    if (auto valid = checkName("--station", options.station); !valid.ok()) return valid;
  if (options.trainee.empty()) options.trainee = "guest";
  if (auto valid = checkName("--trainee", options.trainee); !valid.ok()) return valid;
  return {};
}

}  // namespace

ParsedOptions parseStationOptions(int argc, const char* const* argv) {
  ParsedOptions parsed;
  StationOptions& o = parsed.options;
  std::string server, tool, placement, plunger;
  std::optional<std::string> json;
  double keep_days = 14, quota_mib = 4096;
  bool list_devices = false, self_test = false, calibrate = false, list_exercises = false;

  CLI::App app{
      "The trainee's program: runs the haptic loop, records every tick, and sends it to the server.\n"
      "Without a server it works on: samples wait in the spool, exercises come from the cache.",
      "needlelab-station"};
  app.set_version_flag("--version", programText("station"));
  app.add_option("--server", server, "HOST:PORT of the server; without it everything stays in the spool");
  app.add_option("--ca", o.ca_file, "the server's certificate authority (its tls/ca.crt)");
  app.add_option("--key", o.key_file, "this station's key file, made by needlelab-admin station add");
  app.add_option("--station", o.station, "this station's name; default: the one in the key file");
  app.add_option("--trainee", o.trainee, "who practises; default, without a server: guest");
  app.add_option("--exercise", o.exercise, "what: the id of an exercise on the server or in the cache");
  app.add_option("--profile", o.profile_file, "practise with this profile (JSON) instead of an exercise");
  app.add_option("--model", o.model,
                 "axial force model in place of the profile's, e.g. ENHANCED_TRACKING_WALL");
  app.add_option("--device", o.device, "one of: " + deviceKinds())->capture_default_str();
  app.add_option(
      "--plunger", plunger,
      "buttons that press the plunger and draw it back, where the device has buttons; default: 0,1");
  app.add_option("--tool", tool, "the tip in the handle's frame: x,y,z,qx,qy,qz,qw (m), or a JSON file");
  app.add_option("--placement", placement,
                 "the limb in the device's base frame: x,y,z,qx,qy,qz,qw (m), or a JSON file");
  app.add_option("--rate", o.rate_hz, "ticks per second")
      ->check(CLI::Range(kMinRateHz, kMaxRateHz))
      ->capture_default_str();
  app.add_option("--seconds", o.seconds, "end after so long; default: when the device or the exercise ends")
      ->check(CLI::Range(0.001, 86'400.0));
  app.add_option("--cpu", o.cpu, "the core that the haptic thread stays on; default: the system chooses")
      ->check(CLI::Range(0, 1023));
  app.add_option(
         "--spin-us", o.spin_us,
         "microseconds before each tick that the haptic thread watches the clock in place of sleeping: "
         "less late, but it costs a share of a core (80 at 1 kHz: 8 %)")
      ->check(CLI::Range(0.0, 200.0))
      ->capture_default_str();
  app.add_flag("--headless", o.headless, "no window");
  const char* modes = "Instead of a lesson (the device gets no force)";
  auto* list = app.add_flag("--list-devices", list_devices,
                            "which devices this computer has, and what each of them needs");
  auto* test = app.add_flag("--self-test", self_test,
                            "check device, computer and server before a lesson; --seconds: default 5");
  auto* pivot = app.add_flag("--calibrate", calibrate,
                             "find the needle's tip in the handle's frame by pivoting in a dimple; "
                             "--seconds: default 30");
  list->excludes(test)->excludes(pivot)->group(modes);
  test->excludes(pivot)->group(modes);
  pivot->group(modes);
  app.add_flag("--list-exercises", list_exercises,
               "what can be practised: the exercises in the cache and, with --server, the server's")
      ->excludes(list)
      ->excludes(test)
      ->excludes(pivot)
      ->group(modes);
  app.add_option("--out", o.tool_out, "--calibrate: the tool file to write, for --tool")->group(modes);
  app.add_option("--axis", o.axis,
                 "--calibrate: where the needle's direction comes from: from-tip (the line from the handle's "
                 "origin to the tip), given (the orientation in --tool), or hub:FILE (an earlier "
                 "calibration of the needle's hub)")
      ->capture_default_str()
      ->group(modes);
  app.add_option("--spool", o.spool,
                 "folder that keeps samples until the server has them; default: " + defaultSpool().string());
  app.add_option("--spool-keep", keep_days, "days that sessions stay in the spool after the server has them")
      ->check(CLI::Range(0.0, 36'500.0))
      ->capture_default_str();
  app.add_option(
         "--spool-quota", quota_mib,
         "MiB above which sessions that the server has leave the spool earlier; what it has not is never "
         "deleted, but a warning says in time how many hours of lessons still fit")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str();
  app.add_option("--drain", o.drain_s, "seconds to wait at the end until the server has everything")
      ->check(CLI::Range(0.0, 86'400.0))
      ->capture_default_str();
  app.add_option(
         "--json", json,
         "the closing summary (or what a check found) as JSON, to a file or, without one, to standard output")
      ->expected(0, 1)
      ->default_str("");
  addHandOptions(app, o.hand);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const int code = app.exit(error);
    parsed.exit_code = code == 0 ? kExitDone : kExitInvalid;
    return parsed;
  }
  if (list_devices) o.mode = StationMode::kListDevices;
  if (self_test) o.mode = StationMode::kSelfTest;
  if (calibrate) o.mode = StationMode::kCalibrate;
  if (list_exercises) o.mode = StationMode::kListExercises;
  o.json = app.count("--json") > 0;
  if (json) o.json_file = *json;
  if (const Status status =
          checkOutputs({{"--profile", o.profile_file}, {"--key", o.key_file}, {"--ca", o.ca_file}},
                       {{"--json", o.json_file}, {"--out", o.tool_out}});
      !status.ok()) {
    std::cerr << "needlelab-station: " << status.error().message << "\n";
    parsed.exit_code = exitCodeOf(status.error());
    return parsed;
  }
  auto status = complete(o, server, tool, placement, keep_days, quota_mib);
  if (status.ok() && !plunger.empty()) status = parsePlungerOption(plunger, o.plunger);
  if (!status.ok()) {
    std::cerr << "needlelab-station: " << status.error().message << "\n";
    parsed.exit_code = exitCodeOf(status.error());
  }
  return parsed;
}

}  // namespace needlelab
