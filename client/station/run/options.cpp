#include "client/station/run/options.h"

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <iostream>
#include <utility>

#include "client/device/plunger_option.h"
#include "client/device/pose_option.h"
#include "client/net/credentials.h"
#include "client/station/run/option_list.h"
#include "common/base/files.h"
#include "common/base/program.h"
#include "common/base/range.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr double kLongestTool_m = 1;

/// --enrolled: server, CA and key from its folder.
Status takeEnrolment(StationOptions& options, RawOptions& raw) {
  options.enrolled =
      raw.enrolled && !raw.enrolled->empty() ? *raw.enrolled : defaultEnrolmentFolder().string();
  if (options.mode == StationMode::kEnrol || !raw.enrolled) return {};
  if (!raw.server.empty() || !options.ca_file.empty() || !options.key_file.empty())
    return Error{ErrorCode::kInvalidInput,
                 "--enrolled takes the place of --server, --ca and --key: leave these away"};
  const EnrolmentFiles files = enrolmentFilesIn(options.enrolled);
  const auto server = readWholeFile(files.server, 1000);
  if (!server.ok())
    return Error{ErrorCode::kInvalidInput, "--enrolled: " + options.enrolled.string() +
                                               " holds no enrolment (" + server.error().message +
                                               "); make one with --enrol FILE"};
  raw.server = server->substr(0, server->find('\n'));
  options.ca_file = files.ca;
  options.key_file = files.key;
  return {};
}

constexpr int kLeastWidth_px = 640, kLeastHeight_px = 360, kMostSide_px = 8192;

// a number, and nothing else
template <typename Number>
bool readNumber(const std::string& text, Number& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

Status takeWindow(WindowOptions& window, const RawOptions& raw) {
  const auto usage = [](const std::string& text) { return Error{ErrorCode::kInvalidInput, text}; };
  if (raw.screenshots.size() != raw.screenshot_times.size())
    return usage("each --screenshot FILE needs its --at S: there are " +
                 std::to_string(raw.screenshots.size()) + " and " +
                 std::to_string(raw.screenshot_times.size()));
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
                      window.width_px >= kLeastWidth_px && window.height_px >= kLeastHeight_px &&
                      window.width_px <= kMostSide_px && window.height_px <= kMostSide_px;
  if (!window.size_given)
    return usage("--window '" + raw.window_size +
                 "', allowed is WIDTHxHEIGHT in pixels from 640x360 to 8192x8192");
  return {};
}

// what CLI11 cannot check by itself
Status complete(StationOptions& options, const RawOptions& raw) {
  const std::string &server = raw.server, &tool = raw.tool, &placement = raw.placement;
  const auto usage = [](const std::string& text) { return Error{ErrorCode::kInvalidInput, text}; };
  // CLI11 compares with the range's ends, and lets not-a-number through
  const std::pair<const char*, double> numbers[] = {
      {"--rate", options.rate_hz},  {"--seconds", options.seconds},  {"--spin-us", options.spin_us},
      {"--drain", options.drain_s}, {"--spool-keep", raw.keep_days}, {"--spool-quota", raw.quota_mib}};
  for (const auto& [name, value] : numbers)
    if (std::isnan(value)) return usage(std::string(name) + " is not a number");
  if (options.mode != StationMode::kCalibrate && !options.tool_out.empty())
    return usage("--out is the tool file that --calibrate writes; add --calibrate, or leave --out away");
  // a window can ask a person; one that begins by itself, or that nobody sees, cannot
  const bool asked_now = options.mode == StationMode::kLesson && (options.headless || options.window.start);
  if (!server.empty()) {
    auto endpoint = parseEndpoint(server);
    if (!endpoint.ok()) return endpoint.error();
    options.server = *endpoint;
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
  options.trainee_given = !options.trainee.empty();
  if (!options.exercise.empty() && !options.profile_file.empty())
    return usage("--exercise and --profile exclude each other: an exercise has its own profile");
  if (!tool.empty()) {
    auto pose = parsePoseOption(tool, "--tool");
    if (!pose.ok()) return pose.error();
    // millimetres taken for metres: every force would reach the handle with a lever of a hundred metres
    if (const double length_m = std::hypot(pose->p.x, pose->p.y, pose->p.z); !(length_m <= kLongestTool_m))
      return usage(
          "--tool: the tip lies " + numberText(length_m) +
          " m from the handle's origin, allowed is at most 1 m; give metres, as in 0,0,0.142,0,0,0,1");
    options.X_HT = *pose;
    options.tool_given = true;
  }
  if (!placement.empty()) {
    auto pose = parsePoseOption(placement, "--placement");
    if (!pose.ok()) return pose.error();
    options.X_WL = *pose;
  }
  options.keep.age_s = static_cast<std::int64_t>(raw.keep_days * 86'400);
  options.keep.quota_bytes = static_cast<std::uint64_t>(raw.quota_mib * 1024 * 1024);
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
  RawOptions raw;
  CLI::App app{
      "The trainee's program: runs the haptic loop, records every tick, and sends it to the server.\n"
      "Without a server it works on: samples wait in the spool, exercises come from the cache.",
      "needlelab-station"};
  addStationOptions(app, o, raw);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const int code = app.exit(error);
    parsed.exit_code = code == 0 ? kExitDone : kExitInvalid;
    return parsed;
  }
  if (raw.list_devices) o.mode = StationMode::kListDevices;
  if (raw.self_test) o.mode = StationMode::kSelfTest;
  if (raw.calibrate) o.mode = StationMode::kCalibrate;
  if (raw.list_exercises) o.mode = StationMode::kListExercises;
  if (!o.bundle.empty()) o.mode = StationMode::kEnrol;
  o.json = app.count("--json") > 0;
  if (raw.json) o.json_file = *raw.json;
  o.hand_plan_given = app.count("--hand-plan") > 0;
  if (!raw.on_fault.empty()) o.on_fault = raw.on_fault == "wait" ? FaultPolicy::kWait : FaultPolicy::kEnd;
  std::vector<NamedFile> outputs = {{"--json", o.json_file}, {"--out", o.tool_out}};
  for (const std::string& picture : raw.screenshots) outputs.push_back({"--screenshot", picture});
  if (const Status status =
          checkOutputs({{"--profile", o.profile_file}, {"--key", o.key_file}, {"--ca", o.ca_file}}, outputs);
      !status.ok()) {
    std::cerr << "needlelab-station: " << status.error().message << "\n";
    parsed.exit_code = exitCodeOf(status.error());
    return parsed;
  }
  auto status = takeEnrolment(o, raw);
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
