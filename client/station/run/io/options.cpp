#include "client/station/run/io/options.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/device/factory/device_factory.h"
#include "client/device/hand/hand_options.h"
#include "client/device/plunger.h"
#include "client/device/pose_option.h"
#include "client/net/link/credentials.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/range.h"
#include "common/base/text/csv_rows.h"
#include "common/base/text/text.h"
#include "common/base/usage/usage.h"
#include "common/haptics/scene_spec.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

// Options to check or convert after parsing.
struct RawOptions {
  std::string server, tool, placement, plunger, on_fault, tone;
  std::optional<std::string> json;
  double keep_days = 14, quota_mib = 4096;
  std::optional<std::string> enrolled;
  std::vector<std::string> screenshots, screenshot_times;
  std::string window_size, monitor, viewing_distance;
  bool list_devices = false, self_test = false, calibrate = false, measure_delay = false;
  bool list_exercises = false;
  bool replace = false;
};

void addServer(CLI::App& app, StationOptions& o, RawOptions& raw) {
  app.option_defaults()->group("Server");
  app.add_option("--server", raw.server,
                 "HOST:PORT of the server, or of several of which any will do: A:7750,B:7750; without it "
                 "everything stays in the spool");
  app.add_option("--ca", o.ca_file, "the server's certificate authority (its tls/ca.crt)");
  app.add_option("--key", o.key_file, "this station's key file, made by needlelab-admin station add");
  app.add_option("--enrolled", raw.enrolled,
                 "server, CA and key are those that --enrol has kept in DIR; default: " +
                     defaultEnrolmentFolder().string())
      ->type_name("DIR")
      ->expected(0, 1)
      ->default_str("");
  app.add_option("--station", o.station, "this station's name; default: the one in the key file");
}

void addLesson(CLI::App& app, StationOptions& o) {
  app.option_defaults()->group("Lesson");
  app.add_option("--trainee", o.trainee, "who practises; default, without a server: guest");
  app.add_option("--exercise", o.exercise,
                 "what: the id of an exercise on the server or in the cache; without both, of a built-in one "
                 "(--list-exercises)");
  app.add_option("--profile", o.profile_file, "practise with this profile (JSON) instead of an exercise");
  app.add_option(
         "--code-file", o.code_file,
         "with --headless: the first line is the trainee's code (PIN or badge), for a server that asks; "
         "default: asks at the terminal")
      ->type_name("FILE");
  app.add_option("--model", o.model,
                 "axial force model instead of the profile's, e.g. ENHANCED_TRACKING_WALL");
  app.add_option("--seconds", o.seconds, "end after so long; default: when the device or the exercise ends")
      ->check(CLI::Range(0.001, 86'400.0));
  app.add_flag("--headless", o.headless, "no window: the lesson begins at once");
}

void addWindow(CLI::App& app, StationOptions& o, RawOptions& raw) {
  app.option_defaults()->group("Window");
  app.add_flag("--start", o.window.start,
               "the first lesson begins at once; else the window first shows who practises what");
  app.add_flag("--no-quit{false}", o.window.may_quit,
               "students cannot quit: no button does, nor the window's own; SIGTERM still ends the program");
  app.add_option("--screenshot", raw.screenshots,
                 "PNG of the window; may be given several times, each with an --at. Without a display the "
                 "lesson begins at once, is drawn without one, and the program ends with it")
      ->type_name("FILE");
  app.add_option("--at", raw.screenshot_times,
                 "of each --screenshot: seconds into the lesson, or start or end for those screens")
      ->type_name("S");
  app.add_option("--monitor", raw.monitor,
                 "the diagonal of the monitor's picture, in inches: the letters' sizes come from it and from "
                 "the distance; default: 24in")
      ->type_name("Nin");
  app.add_option("--viewing-distance", raw.viewing_distance,
                 "from the trainee's eyes to the monitor, in metres; default: 2m")
      ->type_name("Nm");
  app.add_flag("--windowed", o.window.windowed,
               "a window of the last size instead of the full screen, for a desk");
  app.add_option("--window", raw.window_size, "a window of this size in pixels, e.g. 1280x720")
      ->type_name("WxH");
  app.add_option("--font-scale", o.window.font_scale,
                 "larger or smaller letters, 1 is ordinary; default: as last used")
      ->check(CLI::Range(0.8, 2.5));
  app.add_option("--frame-log", o.window.frame_log,
                 "CSV of what each frame showed: its screen, the lesson's newest sample; for measurements")
      ->type_name("FILE");
  app.add_option("--text-log", o.window.text_log,
                 "JSON lines of the words that the window shows, when they change")
      ->type_name("FILE");
}

void addDevice(CLI::App& app, StationOptions& o, RawOptions& raw) {
  app.option_defaults()->group("Device");
  app.add_option("--device", o.device, "one of: " + deviceKindsText())->capture_default_str();
  app.add_option(
      "--plunger", raw.plunger,
      "buttons that press the plunger and draw it back, where the device has buttons; default: 0,1");
  app.add_flag("--uncapped", o.uncapped, "a lesson with PALPATION begins with the needle's cap off");
  app.add_flag(
      "--passivity-control", o.passivity_control,
      "always reduce a force that would give the hand more energy than it put in; without this option only "
      "where device and scene are not proven safe");
  app.add_option("--tool", raw.tool, "the tip in the handle's frame: x,y,z,qx,qy,qz,qw (m), or a JSON file");
  app.add_option("--placement", raw.placement,
                 "the limb in the device's base frame: x,y,z,qx,qy,qz,qw (m), or a JSON file");
  app.add_option(
         "--on-fault", raw.on_fault,
         "when the force was taken away: end the lesson, or wait until the needle is outside and Enter "
         "is pressed (or SIGUSR1 sent); default: wait at a terminal, else end")
      ->check(CLI::IsMember({"end", "wait"}));
  app.add_option("--rehearse-fault", o.rehearse_fault_s,
                 "take the force away once after so many seconds, as in a fault, so that staff can practise "
                 "what to do; the recording says so")
      ->type_name("S")
      ->check(CLI::Range(0.0, 86'400.0));
  app.add_option("--tone", raw.tone,
                 "which alarms sound: danger (fault, hazard, bone), all, off; through the sound card, else "
                 "the terminal's bell")
      ->check(CLI::IsMember({"danger", "all", "off"}))
      ->default_str("danger");
}

void addRealTime(CLI::App& app, StationOptions& o) {
  app.option_defaults()->group("Real time");
  app.add_option("--rate", o.rate_hz, "ticks per second")
      ->check(CLI::Range(kMinRateHz, kMaxRateHz))
      ->capture_default_str();
  app.add_option("--cpu", o.cpu,
                 "the core that the haptic thread stays on; default: the last one, where there are two "
                 "or more and FIFO priority is permitted")
      ->check(CLI::Range(0, 1023));
  app.add_option(
         "--spin-us", o.spin_us,
         "microseconds before each tick in which the haptic thread polls the clock instead of sleeping: "
         "less late, but it costs a share of a core (80 at 1 kHz: 8 %)")
      ->check(CLI::Range(0.0, 200.0))
      ->capture_default_str();
}

void addSpool(CLI::App& app, StationOptions& o, RawOptions& raw) {
  app.option_defaults()->group("Spool");
  app.add_option("--spool", o.spool,
                 "folder that keeps samples until the server has them; default: " + defaultSpool().string());
  app.add_option("--spool-keep", raw.keep_days,
                 "days that sessions stay in the spool after the server has them")
      ->check(CLI::Range(0.0, 36'500.0))
      ->capture_default_str();
  app.add_option(
         "--spool-quota", raw.quota_mib,
         "MiB above which sessions that the server has leave the spool earlier; other sessions are never "
         "deleted, but a warning says in time how many hours of lessons still fit")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str();
  app.add_option("--drain", o.drain_s, "seconds to wait at the end until the server has everything")
      ->check(CLI::Range(0.0, 86'400.0))
      ->capture_default_str();
}

void addSummary(CLI::App& app, RawOptions& raw) {
  app.option_defaults()->group("Summary");
  app.add_option(
         "--json", raw.json,
         "the closing summary (or what a check found) as JSON, to a file or, without one, to standard output")
      ->expected(0, 1)
      ->default_str("");
}

void addModes(CLI::App& app, StationOptions& o, RawOptions& raw) {
  app.option_defaults()->group("Instead of a lesson (the device gets no force, but by --measure-delay)");
  auto* list = app.add_flag("--list-devices", raw.list_devices,
                            "which devices this computer has, and what each of them needs");
  auto* test = app.add_flag("--self-test", raw.self_test,
                            "check device, computer and server before a lesson; --seconds: default 5");
  auto* pivot = app.add_flag("--calibrate", raw.calibrate,
                             "find the needle's tip in the handle's frame by pivoting in a dimple; "
                             "--seconds: default 30");
  auto* delay =
      app.add_flag("--measure-delay", raw.measure_delay,
                   "find how late the device renders a force, and keep it for its lessons: it pushes "
                   "the held handle by at most 0.5 N for 10 s");
  app.add_option(
         "--enrol", o.bundle,
         "make this computer a station: log in with the file from needlelab-admin station enrol, and keep "
         "its contents in the folder of --enrolled")
      ->type_name("FILE")
      ->excludes(list)
      ->excludes(test)
      ->excludes(pivot)
      ->excludes(delay);
  list->excludes(test)->excludes(pivot)->excludes(delay);
  delay->excludes(test)->excludes(pivot);
  test->excludes(pivot);
  app.add_flag("--list-exercises", raw.list_exercises,
               "what can be practised: the exercises in the cache and, with --server, the server's; with "
               "--trainee what is assigned, step by step")
      ->excludes(list)
      ->excludes(test)
      ->excludes(pivot);
  app.add_option("--out", o.tool_out, "--calibrate: the tool file to write, for --tool");
  app.add_flag("--replace", raw.replace, "allow --out to overwrite an existing file");
  app.add_option("--axis", o.axis,
                 "--calibrate: where the needle's direction comes from: from-tip (the line from the handle's "
                 "origin to the tip), given (the orientation in --tool), or hub:FILE (an earlier "
                 "calibration of the needle's hub)")
      ->capture_default_str();
}

// adds all options; `o` and `raw` must outlive `app`
void addStationOptions(CLI::App& app, StationOptions& o, RawOptions& raw) {
  app.set_version_flag("--version", programText("station"));
  addServer(app, o, raw);
  addLesson(app, o);
  addWindow(app, o, raw);
  addDevice(app, o, raw);
  addRealTime(app, o);
  addModes(app, o, raw);
  addSpool(app, o, raw);
  addSummary(app, raw);
  addHandOptions(app, o.hand);
}

/// --enrolled: server, CA and key from its folder.
Status takeEnrolment(StationOptions& options, RawOptions& raw) {
  options.enrolled =
      raw.enrolled && !raw.enrolled->empty() ? *raw.enrolled : defaultEnrolmentFolder().string();
  if (options.mode == StationMode::kEnrol || !raw.enrolled) return {};
  if (!raw.server.empty() || !options.ca_file.empty() || !options.key_file.empty())
    return Error{ErrorCode::kInvalidInput,
                 "--enrolled replaces --server, --ca and --key: give only one or the other"};
  const EnrolmentFiles files = enrolmentFilesIn(options.enrolled);
  const auto server = readWholeFile(files.server, 8000);
  if (!server.ok())
    return Error{ErrorCode::kInvalidInput, "--enrolled: " + options.enrolled.string() +
                                               " holds no enrolment (" + server.error().message +
                                               "); make one with --enrol FILE"};
  const std::string_view line = withoutMark(*server);
  raw.server = line.substr(0, line.find_first_of("\r\n"));
  options.ca_file = files.ca;
  options.key_file = files.key;
  return {};
}

constexpr int kMinWidth_px = 640, kMinHeight_px = 360, kMaxSide_px = 8192;

// accepts a number and nothing else
bool readNumber(const std::string& text, double& value) {
  const auto number = numberOf(text);
  value = number.value_or(value);
  return number.has_value();
}
bool readNumber(const std::string& text, int& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

/// Parses a length with its unit, `unit_m` long, within [least, most].
Status readLength(const char* option, const std::string& text, const char* unit, double unit_m, double min_m,
                  double max_m, double& length_m) {
  if (text.empty()) return {};
  double number = 0;
  const bool has_unit = text.ends_with(unit);
  if (has_unit && readNumber(text.substr(0, text.size() - std::strlen(unit)), number) &&
      number * unit_m >= min_m * (1 - 1e-9) && number * unit_m <= max_m * (1 + 1e-9)) {
    length_m = number * unit_m;
    return {};
  }
  return Error{ErrorCode::kInvalidInput,
               fmt::format("{} '{}', allowed is a length from {:g}{} to {:g}{}", option, text, min_m / unit_m,
                           unit, max_m / unit_m, unit)};
}

Status takeWindow(WindowOptions& window, const RawOptions& raw) {
  const auto usage = [](const std::string& text) { return Error{ErrorCode::kInvalidInput, text}; };
  RETURN_IF_ERROR(readLength("--monitor", raw.monitor, "in", kInch_m, kMinDiagonal_m, kMaxDiagonal_m,
                             window.viewing.diagonal_m));
  RETURN_IF_ERROR(readLength("--viewing-distance", raw.viewing_distance, "m", 1, kMinDistance_m,
                             kMaxDistance_m, window.viewing.distance_m));
  if (raw.screenshots.size() != raw.screenshot_times.size())
    return usage(fmt::format("each --screenshot FILE needs its --at S: there are {} and {}",
                             raw.screenshots.size(), raw.screenshot_times.size()));
  for (std::size_t i = 0; i < raw.screenshots.size(); ++i) {
    PictureRequest picture{raw.screenshots[i], PictureRequest::When::kLesson, 0};
    const std::string& at = raw.screenshot_times[i];
    if (at == "start")
      picture.when = PictureRequest::When::kStart;
    else if (at == "end")
      picture.when = PictureRequest::When::kEnd;
    else if (!readNumber(at, picture.at_s) || !(picture.at_s >= 0 && picture.at_s <= 86'400))
      return usage("--at '" + at + "', allowed is a number of seconds from 0 to 86400, start, or end");
    window.pictures.push_back(std::move(picture));
  }
  if (raw.window_size.empty()) return {};
  const std::size_t x = raw.window_size.find('x');
  window.size_given = x != std::string::npos && readNumber(raw.window_size.substr(0, x), window.width_px) &&
                      readNumber(raw.window_size.substr(x + 1), window.height_px) &&
                      window.width_px >= kMinWidth_px && window.height_px >= kMinHeight_px &&
                      window.width_px <= kMaxSide_px && window.height_px <= kMaxSide_px;
  if (!window.size_given)
    return usage("--window '" + raw.window_size +
                 "', allowed is WIDTHxHEIGHT in pixels from 640x360 to 8192x8192");
  window.windowed = true;
  return {};
}

// checks beyond CLI11's
Status complete(StationOptions& options, const RawOptions& raw) {
  const std::string &server = raw.server, &tool = raw.tool, &placement = raw.placement;
  const auto usage = [](const std::string& text) { return Error{ErrorCode::kInvalidInput, text}; };
  // CLI11 compares with the range's ends and accepts NaN
  const std::pair<const char*, double> numbers[] = {
      {"--rate", options.rate_hz},  {"--seconds", options.seconds},  {"--spin-us", options.spin_us},
      {"--drain", options.drain_s}, {"--spool-keep", raw.keep_days}, {"--spool-quota", raw.quota_mib}};
  for (const auto& [name, value] : numbers)
    if (std::isnan(value)) return usage(std::string(name) + " is not a number");
  if (options.mode != StationMode::kCalibrate && !options.tool_out.empty())
    return usage("--out is the tool file that --calibrate writes: add --calibrate, or omit --out");
  // a window can ask a person, unless it starts by itself or has no display
  const bool asked_now = options.mode == StationMode::kLesson && (options.headless || options.window.start);
  if (!server.empty()) {
    ASSIGN_OR_RETURN(options.servers, parseEndpoints(server));
    if (options.ca_file.empty()) return usage("--server needs --ca FILE, the server's tls/ca.crt");
    if (options.key_file.empty())
      return usage("--server needs --key FILE, made by needlelab-admin station add");
    if (options.trainee.empty() && asked_now)
      return usage("--server needs --trainee NAME: whose lesson is it?");
  }
  if (options.exercise.empty() && options.profile_file.empty() && asked_now)
    return usage(
        "there is nothing to practise: give --exercise ID, or --profile FILE for a profile of your own" +
        std::string(options.headless ? "" : "; without --start the window asks"));
  if (!options.code_file.empty() && !(options.mode == StationMode::kLesson && options.headless))
    return usage("--code-file needs --headless: the window has a field for the code");
  if (!options.code_file.empty() && server.empty())
    return usage("--code-file needs a server, which asks for the code: give --server or --enrolled");
  options.trainee_given = !options.trainee.empty();
  if (!options.exercise.empty() && !options.profile_file.empty())
    return usage("--exercise and --profile exclude each other: an exercise has its own profile");
  if (!tool.empty()) {
    // in millimetres, every force would act on the handle with a lever of a hundred metres
    ASSIGN_OR_RETURN(options.X_HT, parsePoseOption(tool, "--tool"));
    options.tool_given = true;
  }
  if (!placement.empty()) {
    ASSIGN_OR_RETURN(options.X_WL, parsePoseOption(placement, "--placement", Quantity::kPlacement));
  }
  options.keep.age_s = static_cast<std::int64_t>(raw.keep_days * 86'400);
  options.keep.quota_bytes = static_cast<std::uint64_t>(raw.quota_mib * 1024 * 1024);
  if (options.spool.empty()) options.spool = defaultSpool();
  // without a key, the station gets its name only when its sessions are uploaded
  if (!options.station.empty()) RETURN_IF_ERROR(checkName("--station", options.station));
  if (options.trainee.empty()) options.trainee = kGuestName;
  RETURN_IF_ERROR(checkName("--trainee", options.trainee));
  return {};
}

}  // namespace

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

ParsedOptions parseStationOptions(int argc, const char* const* argv) {
  ParsedOptions parsed;
  StationOptions& o = parsed.options;
  RawOptions raw;
  CLI::App app{
      "The trainee's program: runs the haptic loop, records every tick, and sends it to the server.\n"
      "Without a server it works on: samples wait in the spool, exercises come from the cache. A computer that "
      "never had a server has built-in exercises.",
      "needlelab-station"};
  addStationOptions(app, o, raw);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    parsed.exit_code = endOfParsing(app, error, argc, argv);
    return parsed;
  }
  if (raw.list_devices) o.mode = StationMode::kListDevices;
  if (raw.self_test) o.mode = StationMode::kSelfTest;
  if (raw.calibrate) o.mode = StationMode::kCalibrate;
  if (raw.measure_delay) o.mode = StationMode::kMeasureDelay;
  if (raw.list_exercises) o.mode = StationMode::kListExercises;
  if (!o.bundle.empty()) o.mode = StationMode::kEnrol;
  o.json = app.count("--json") > 0;
  if (raw.json) o.json_file = *raw.json;
  o.hand_plan_given = app.count("--hand-plan") > 0;
  if (!raw.tone.empty())
    o.tone = raw.tone == "all"   ? ToneChoice::kAll
             : raw.tone == "off" ? ToneChoice::kOff
                                 : ToneChoice::kDanger;
  if (!raw.on_fault.empty()) o.on_fault = raw.on_fault == "wait" ? FaultPolicy::kWait : FaultPolicy::kEnd;
  std::vector<NamedFile> outputs = {{"--json", o.json_file},
                                    {"--out", o.tool_out},
                                    {"--frame-log", o.window.frame_log},
                                    {"--text-log", o.window.text_log}};
  for (const std::string& picture : raw.screenshots) outputs.push_back({"--screenshot", picture});
  if (const Status status = checkOutputs({{"--profile", o.profile_file},
                                          {"--code-file", o.code_file},
                                          {"--key", o.key_file},
                                          {"--ca", o.ca_file}},
                                         outputs);
      !status.ok()) {
    std::cerr << "needlelab-station: " << status.error().message << "\n";
    parsed.exit_code = exitCodeOf(status.error());
    return parsed;
  }
  auto status = requireNewFile({"--out", o.tool_out}, raw.replace);
  if (status.ok()) status = takeEnrolment(o, raw);
  if (status.ok()) status = takeWindow(o.window, raw);
  if (status.ok()) status = complete(o, raw);
  if (status.ok() && !raw.plunger.empty()) status = parsePlungerOption(raw.plunger, o.plunger);
  if (!status.ok()) {
    std::cerr << "needlelab-station: " << status.error().message << "\n";
    parsed.exit_code = exitCodeOf(status.error());
  }
  return parsed;
}

}  // namespace needlelab
