#include "client/station/run/option_list.h"

#include <cstdlib>

#include "client/device/factory/device_factory.h"
#include "client/device/hand_cli.h"
#include "client/net/credentials.h"
#include "common/haptics/limits.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

constexpr const char* kServer = "Server";
constexpr const char* kLesson = "Lesson";
constexpr const char* kWindow = "Window";
constexpr const char* kDevice = "Device";
constexpr const char* kRealTime = "Real time";
constexpr const char* kSpool = "Spool";
constexpr const char* kSummary = "Summary";
constexpr const char* kModes = "Instead of a lesson (the device gets no force)";

void addServer(CLI::App& app, StationOptions& o, RawOptions& raw) {
  app.add_option("--server", raw.server, "HOST:PORT of the server; without it everything stays in the spool")
      ->group(kServer);
  app.add_option("--ca", o.ca_file, "the server's certificate authority (its tls/ca.crt)")->group(kServer);
  app.add_option("--key", o.key_file, "this station's key file, made by needlelab-admin station add")
      ->group(kServer);
  app.add_option("--enrolled", raw.enrolled,
                 "server, CA and key are those that --enrol has kept in DIR; default: " +
                     defaultEnrolmentFolder().string())
      ->type_name("DIR")
      ->expected(0, 1)
      ->default_str("")
      ->group(kServer);
  app.add_option("--station", o.station, "this station's name; default: the one in the key file")
      ->group(kServer);
}

void addLesson(CLI::App& app, StationOptions& o) {
  app.add_option("--trainee", o.trainee, "who practises; default, without a server: guest")->group(kLesson);
  app.add_option("--exercise", o.exercise, "what: the id of an exercise on the server or in the cache")
      ->group(kLesson);
  app.add_option("--profile", o.profile_file, "practise with this profile (JSON) instead of an exercise")
      ->group(kLesson);
  app.add_option("--model", o.model,
                 "axial force model in place of the profile's, e.g. ENHANCED_TRACKING_WALL")
      ->group(kLesson);
  app.add_option("--seconds", o.seconds, "end after so long; default: when the device or the exercise ends")
      ->check(CLI::Range(0.001, 86'400.0))
      ->group(kLesson);
  app.add_flag("--headless", o.headless, "no window: the lesson begins at once")->group(kLesson);
}

void addWindow(CLI::App& app, StationOptions& o, RawOptions& raw) {
  app.add_flag("--start", o.window.start,
               "the first lesson begins at once; else the window first shows who practises what")
      ->group(kWindow);
  app.add_option("--screenshot", raw.screenshots,
                 "PNG of the window; may be given several times, each with an --at. Without a display the "
                 "lesson begins at once, is drawn without one, and the program ends with it")
      ->type_name("FILE")
      ->group(kWindow);
  app.add_option("--at", raw.screenshot_times,
                 "of each --screenshot: seconds into the lesson, or start or end for those screens")
      ->type_name("S")
      ->group(kWindow);
  app.add_option("--window", raw.window_size,
                 "the window's size in pixels, e.g. 1280x720; default: as it was left")
      ->type_name("WxH")
      ->group(kWindow);
  app.add_option("--font-scale", o.window.font_scale,
                 "larger or smaller letters, 1 is ordinary; default: as it was left")
      ->check(CLI::Range(0.8, 2.5))
      ->group(kWindow);
}

void addDevice(CLI::App& app, StationOptions& o, RawOptions& raw) {
  app.add_option("--device", o.device, "one of: " + deviceKinds())->capture_default_str()->group(kDevice);
  app.add_option(
         "--plunger", raw.plunger,
         "buttons that press the plunger and draw it back, where the device has buttons; default: 0,1")
      ->group(kDevice);
  app.add_option("--tool", raw.tool, "the tip in the handle's frame: x,y,z,qx,qy,qz,qw (m), or a JSON file")
      ->group(kDevice);
  app.add_option("--placement", raw.placement,
                 "the limb in the device's base frame: x,y,z,qx,qy,qz,qw (m), or a JSON file")
      ->group(kDevice);
  app.add_option(
         "--on-fault", raw.on_fault,
         "when the force was taken away: end the lesson, or wait until the needle is outside and Enter "
         "is pressed (or SIGUSR1 sent); default: wait at a terminal, else end")
      ->check(CLI::IsMember({"end", "wait"}))
      ->group(kDevice);
}

void addRealTime(CLI::App& app, StationOptions& o) {
  app.add_option("--rate", o.rate_hz, "ticks per second")
      ->check(CLI::Range(kMinRateHz, kMaxRateHz))
      ->capture_default_str()
      ->group(kRealTime);
  app.add_option("--cpu", o.cpu,
                 "the core that the haptic thread stays on; default: the last one, where there are two "
                 "or more and FIFO priority is permitted")
      ->check(CLI::Range(0, 1023))
      ->group(kRealTime);
  app.add_option(
         "--spin-us", o.spin_us,
         "microseconds before each tick that the haptic thread watches the clock in place of sleeping: "
         "less late, but it costs a share of a core (80 at 1 kHz: 8 %)")
      ->check(CLI::Range(0.0, 200.0))
      ->capture_default_str()
      ->group(kRealTime);
}

void addSpool(CLI::App& app, StationOptions& o, RawOptions& raw) {
  app.add_option("--spool", o.spool,
                 "folder that keeps samples until the server has them; default: " + defaultSpool().string())
      ->group(kSpool);
  app.add_option("--spool-keep", raw.keep_days,
                 "days that sessions stay in the spool after the server has them")
      ->check(CLI::Range(0.0, 36'500.0))
      ->capture_default_str()
      ->group(kSpool);
  app.add_option(
         "--spool-quota", raw.quota_mib,
         "MiB above which sessions that the server has leave the spool earlier; what it has not is never "
         "deleted, but a warning says in time how many hours of lessons still fit")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str()
      ->group(kSpool);
  app.add_option("--drain", o.drain_s, "seconds to wait at the end until the server has everything")
      ->check(CLI::Range(0.0, 86'400.0))
      ->capture_default_str()
      ->group(kSpool);
}

void addSummary(CLI::App& app, RawOptions& raw) {
  app.add_option(
         "--json", raw.json,
         "the closing summary (or what a check found) as JSON, to a file or, without one, to standard output")
      ->expected(0, 1)
      ->default_str("")
      ->group(kSummary);
}

void addModes(CLI::App& app, StationOptions& o, RawOptions& raw) {
  auto* list = app.add_flag("--list-devices", raw.list_devices,
                            "which devices this computer has, and what each of them needs");
  auto* test = app.add_flag("--self-test", raw.self_test,
                            "check device, computer and server before a lesson; --seconds: default 5");
  auto* pivot = app.add_flag("--calibrate", raw.calibrate,
                             "find the needle's tip in the handle's frame by pivoting in a dimple; "
                             "--seconds: default 30");
  app.add_option(
         "--enrol", o.bundle,
         "make this computer a station: log in by the file that needlelab-admin station enrol made, and keep "
         "what is in it in the folder of --enrolled")
      ->type_name("FILE")
      ->excludes(list)
      ->excludes(test)
      ->excludes(pivot)
      ->group(kModes);
  list->excludes(test)->excludes(pivot)->group(kModes);
  test->excludes(pivot)->group(kModes);
  pivot->group(kModes);
  app.add_flag("--list-exercises", raw.list_exercises,
               "what can be practised: the exercises in the cache and, with --server, the server's")
      ->excludes(list)
      ->excludes(test)
      ->excludes(pivot)
      ->group(kModes);
  app.add_option("--out", o.tool_out, "--calibrate: the tool file to write, for --tool")->group(kModes);
  app.add_option("--axis", o.axis,
                 "--calibrate: where the needle's direction comes from: from-tip (the line from the handle's "
                 "origin to the tip), given (the orientation in --tool), or hub:FILE (an earlier "
                 "calibration of the needle's hub)")
      ->capture_default_str()
      ->group(kModes);
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

}  // namespace needlelab
