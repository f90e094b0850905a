// Judges the facts of a self-test. All limits are here.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <system_error>

#include "client/station/run/checks/self_test.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {
namespace {

// compares a number with two limits: good up to `ok`, usable up to `warning`, failed above
Verdict upTo(double value, double ok, double warning) {
  if (!std::isfinite(value)) return Verdict::kFailed;
  return value <= ok ? Verdict::kOk : value <= warning ? Verdict::kWarning : Verdict::kFailed;
}

Check number(std::string name, double value, std::string unit, Verdict verdict, std::string found,
             std::string limit, std::string advice) {
  Check check{std::move(name), verdict, std::move(found), std::move(limit), {}, value, std::move(unit)};
  if (verdict != Verdict::kOk) check.advice = std::move(advice);
  return check;
}

// rounds to mm, in m, without a negative zero
double toMillimetre(double value_m) {
  return std::round(value_m * 1e3) / 1e3 + 0.0;
}

double microseconds(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-3;
}

constexpr ConditionText kConditions[] = {
    {kDeviceEmergencyStop, Verdict::kFailed, "the emergency stop is pressed", "release it"},
    {kDeviceLost, Verdict::kFailed, "the device is unplugged, or its link is broken",
     "check plug, cable and daemon"},
    {kDeviceOverheated, Verdict::kFailed, "the motors are too hot", "let them cool for ten minutes"},
    {kDeviceTrouble, Verdict::kFailed, "the device reports an error",
     "switch it off and on; see its own words below"},
    {kDeviceNotReady, Verdict::kFailed, "the device is not ready", "see its own words below"},
    {kDevicePowerOff, Verdict::kWarning, "the motors have no power", "press the power button at the device"},
    {kDeviceReleased, Verdict::kOk, "no one holds the handle", ""},
    {kDeviceSaturated, Verdict::kWarning, "the motors were asked for more than they can give",
     "nothing was asked of them here: switch the device off and on"},
    {kDeviceOverrun, Verdict::kWarning, "the device could not keep the rate", "give a lower --rate"},
};

void judgeConditions(const DeviceFacts& f, std::vector<Check>& checks) {
  bool any = false;
  for (const ConditionText& row : kConditions) {
    unsigned bit = 0;
    while ((1u << bit) != row.flag) ++bit;
    const std::uint64_t ticks = f.loop.condition_ticks[bit];
    if (ticks == 0) continue;
    any = true;
    const double share =
        100 * static_cast<double>(ticks) / static_cast<double>(std::max<std::uint64_t>(1, f.loop.ran));
    checks.push_back(number("condition", share, "%", row.verdict,
                            fmt::format("{}, in {:.3g} % of the time", row.found, share), "", row.advice));
  }
  if (!any) checks.push_back({"condition", Verdict::kOk, "no emergency stop, no alarm, power on", "", ""});
  if (!f.status.empty())
    checks.push_back(
        {"device says", f.loop.last_condition != 0 ? Verdict::kWarning : Verdict::kOk, f.status, "", ""});
}

void judgeCommunication(const DeviceFacts& f, std::vector<Check>& checks) {
  const ZeroForceStats& s = f.loop;
  const double period_us = 1e6 / f.rate_hz;
  if (s.ran == 0) {
    checks.push_back({"communication", Verdict::kFailed, "no tick ran", "",
                      "try again; a recording must last longer than this test"});
    return;
  }
  const double fresh = 100 * static_cast<double>(s.fresh) / static_cast<double>(s.ran);
  // a device with its own clock, such as the Falcon, sometimes has no new reading at a tick
  const Verdict enough = fresh >= 80 ? Verdict::kOk : fresh >= 50 ? Verdict::kWarning : Verdict::kFailed;
  checks.push_back(
      number("communication", fresh, "%", enough,
             fmt::format("{:.2f} % of {} readings were fresh", fresh, s.ran), "at least 80 %",
             "check cable and plug; give a lower --rate; close other programs that use the device"));
  const auto silence = static_cast<double>(s.longest_silence);
  checks.push_back(number(
      "longest silence", silence, "ticks", upTo(silence, 2, 5), fmt::format("{:g} ticks", silence),
      "at most 2; after 20 ms the force is taken away", "as above: the device must answer every tick"));
  const double p99_us = microseconds(s.exchange.quantile_ns(0.99));
  checks.push_back(
      number("exchange time", p99_us, "µs", upTo(p99_us, 0.5 * period_us, 0.9 * period_us),
             fmt::format("p50 {:.1f}, p99 {:.1f}, max {:.1f} µs", microseconds(s.exchange.quantile_ns(0.5)),
                         p99_us, microseconds(s.exchange.max_ns())),
             fmt::format("p99 at most half a period, {:g} µs", 0.5 * period_us),
             "give a lower --rate; close other programs"));
  const double missed =
      100 * static_cast<double>(s.missed) / static_cast<double>(std::max<std::uint64_t>(1, s.ticks));
  checks.push_back(number(
      "rate", missed, "%", upTo(missed, 0.1, 1),
      fmt::format("{:.1f} Hz of {:g} Hz: {} of {} ticks missed",
                  s.seconds > 0 ? static_cast<double>(s.ran) / s.seconds : 0, f.rate_hz, s.missed, s.ticks),
      "at most 0.1 % missed",
      "close other programs; see the rows of real time below; a virtual machine is not suitable as a "
      "station"));
  const double late_us = microseconds(s.wakeup.quantile_ns(0.99));
  checks.push_back(
      number("wake-up", late_us, "µs", upTo(late_us, 0.2 * period_us, period_us),
             fmt::format("p50 {:.1f}, p99 {:.1f}, max {:.1f} µs late",
                         microseconds(s.wakeup.quantile_ns(0.5)), late_us, microseconds(s.wakeup.max_ns())),
             fmt::format("p99 at most a fifth of a period, {:g} µs", 0.2 * period_us), "as for the rate"));
}

void judgePose(const DeviceFacts& f, std::vector<Check>& checks) {
  const ZeroForceStats& s = f.loop;
  if (s.fresh == 0) {
    checks.push_back({"pose", Verdict::kFailed, "none came", "", "see condition and communication"});
    return;
  }
  const auto bad = static_cast<double>(s.bad_poses);
  checks.push_back(number("pose", bad, "readings", bad == 0 ? Verdict::kOk : Verdict::kFailed,
                          bad == 0 ? "all finite, all rotations proper"
                                   : fmt::format("{:g} readings were not finite or no rotation", bad),
                          "", "switch the device off and on; if it stays, have it repaired"));
  if (s.bad_poses == s.fresh) return;
  const Vec3 tip = f.last_X_WH * f.X_HT.p;
  checks.push_back(number(
      "place", f.farthest_m, "m", upTo(f.farthest_m, 1.5, 1.5),
      fmt::format("tip at {:.3f}, {:.3f}, {:.3f} m; the handle within {:.3f} m of the base frame's origin",
                  toMillimetre(tip.x), toMillimetre(tip.y), toMillimetre(tip.z), f.farthest_m),
      "at most 1.5 m", "no haptic device reaches so far: its zero is lost; home or restart it"));
  // noise at rest cannot be measured on a moving handle
  if (f.moved_m > 5e-3)
    checks.push_back(number("noise at rest", f.noise_m, "m", Verdict::kWarning,
                            fmt::format("the handle was moved by {:.1f} mm meanwhile", 1e3 * f.moved_m),
                            "at most 0.05 mm RMS", "put it down or hold it still, and test again"));
  else
    checks.push_back(
        number("noise at rest", f.noise_m, "m", upTo(f.noise_m, 5e-5, 5e-4),
               fmt::format("{:.4f} mm RMS, the handle moved by {:.2f} mm", 1e3 * f.noise_m, 1e3 * f.moved_m),
               "at most 0.05 mm RMS",
               "leave the handle alone and test again; if it stays, the force will feel rough"));
  const double fault = f.info->limits.fault_speed_mps;
  checks.push_back(
      number("speed at rest", s.greatest_speed_mps, "m/s", upTo(s.greatest_speed_mps, 0.1 * fault, fault),
             fmt::format("at most {:.3f} m/s as the device reports it", s.greatest_speed_mps),
             fmt::format("its fault threshold is {:g} m/s", fault), "leave the handle alone and test again"));
}

void judgeLimits(const DeviceFacts& f, std::vector<Check>& checks) {
  const DeviceInfo& i = *f.info;
  const DeviceLimits& l = i.limits;
  if (i.renders_force) {
    checks.push_back({"force limits", Verdict::kOk,
                      fmt::format("{:g} N peak, {:g} N continuous, {:g} N/m at most", l.peak_force_N,
                                  l.continuous_force_N, l.max_stiffness_N_per_m),
                      "", ""});
    checks.push_back(
        i.renders_torque
            ? Check{"torque limits", Verdict::kOk,
                    fmt::format("{:g} N·m peak, {:g} N·m continuous, {:g} N·m/rad at most", l.peak_torque_Nm,
                                l.continuous_torque_Nm, l.max_rotational_stiffness_Nm_per_rad),
                    "", ""}
            : Check{"torque limits", Verdict::kWarning, "the device renders no torque", "",
                    "lessons run without the orientation limit; nothing to do"});
  } else {
    checks.push_back({"force limits", Verdict::kWarning,
                      "the device renders no force: the hand feels nothing", "",
                      "for lessons with force use another --device"});
  }
  if (!i.has_orientation)
    checks.push_back(
        {"orientation", Verdict::kWarning, "the device does not report how its handle is turned", "",
         "the needle enters along the skin's inward normal and points where its tip goes; nothing to do"});
  if (f.hardware && i.has_orientation)
    checks.push_back(f.tool_given
                         ? Check{"tool", Verdict::kOk, "given with --tool", "", ""}
                         : Check{"tool", Verdict::kWarning,
                                 "none given: the tip is taken to be the handle's origin", "",
                                 "run --calibrate --out TOOL.json once, then give --tool TOOL.json"});
}

void judgeDevice(const DeviceFacts& f, std::vector<Check>& checks) {
  if (!f.trouble.empty()) {
    checks.push_back(
        {"device", Verdict::kFailed, f.trouble, "", "needlelab-station --list-devices shows what there is"});
    return;
  }
  checks.push_back({"device", Verdict::kOk, f.info->name, "", ""});
  judgeConditions(f, checks);
  judgeCommunication(f, checks);
  judgePose(f, checks);
  judgeLimits(f, checks);
  for (const RtStep& step : f.realtime) {
    const bool right =
        step.name == "memory lock" || step.name == "FIFO priority" || step.name == "idle states";
    checks.push_back(
        {step.name, step.ok ? Verdict::kOk : Verdict::kWarning, step.message, "",
         step.ok || !right
             ? ""
             : "give this user the rights for real time: sudo usermod -aG needlelab USER, log out and "
               "in again; without that group see BRINGUP.md, step 2"});
  }
}

void judgeComputer(const MachineFacts& f, std::vector<Check>& checks) {
  checks.push_back({"computer", Verdict::kOk, f.text, "", ""});
  checks.push_back(
      number("clock", f.clock_resolution_ns, "ns", upTo(f.clock_resolution_ns, 1000, 50'000),
             fmt::format("{:g} ns fine, {:.0f} ns a look{}", f.clock_resolution_ns, f.clock_cost_ns,
                         f.clock_source.empty() ? "" : (", source " + f.clock_source)),
             "at most 1 µs", "choose a better clock source in /sys/devices/system/clocksource"));
  if (f.clock_source == "hpet" || f.clock_source == "acpi_pm")
    checks.back().verdict = Verdict::kWarning,
    checks.back().advice = "this clock source is slow; the kernel gave up the processor's own, see dmesg";
  checks.push_back(number("cores", f.cores, "cores", f.cores >= 2 ? Verdict::kOk : Verdict::kWarning,
                          std::to_string(f.cores), "at least 2",
                          "on one core the loop and everything else are in each other's way"));
}

// a monitor's size is only a suggestion: some report another one's, or none
void judgeMonitor(const MonitorFacts& f, std::vector<Check>& checks) {
  if (!f.wanted) return;
  constexpr double kUnlike = 0.1;
  const auto isLike = [&](const MonitorSize& m) {
    return std::abs(m.diagonal_m - f.viewing.diagonal_m) <= kUnlike * f.viewing.diagonal_m;
  };
  const auto inches = [](double m) { return fmt::format("{:.3g}in", m / kInch_m); };
  const std::string given = inches(f.viewing.diagonal_m);
  if (f.found.empty()) {
    checks.push_back({"monitor", Verdict::kNotChecked, "none says its size; letters are for " + given, "",
                      "measure the diagonal of its picture; if it is another: --monitor"});
  } else {
    std::string said;
    for (const MonitorSize& m : f.found)
      said += (said.empty() ? "" : ", ") + m.plug + " says " + inches(m.diagonal_m);
    const bool like = std::ranges::any_of(f.found, isLike);
    checks.push_back({"monitor", like ? Verdict::kOk : Verdict::kWarning, said + "; letters are for " + given,
                      "within 10 %",
                      like ? ""
                           : "measure the diagonal of its picture, and start the station with --monitor " +
                                 inches(f.found.front().diagonal_m) + " if it is that"});
  }
  const double share = headingShare(f.viewing);
  checks.push_back(
      number("letters", 100 * share, "%", share <= kMaxHeadingShare ? Verdict::kOk : Verdict::kWarning,
             fmt::format("{:.0f}′ at {:g} m take {:.1f} % of the window's height", kHeadingArcmin,
                         f.viewing.distance_m, 100 * share),
             fmt::format("at most {:.1f} %", 100 * kMaxHeadingShare),
             "names are cut and plots are missing: a larger monitor, or nearer to it; then --monitor and "
             "--viewing-distance"));
}

void judgeDisk(const DiskFacts& f, double rate_hz, std::vector<Check>& checks) {
  if (!f.trouble.empty()) {
    checks.push_back(
        {"spool", Verdict::kFailed, f.trouble, "", "give --spool a folder that this user can write to"});
    return;
  }
  constexpr double kBytesPerSample = 8;  // tests/bench/README.md
  const double hours = f.free_bytes / (kBytesPerSample * rate_hz * 3600);
  const double mib = f.free_bytes / (1024.0 * 1024);
  checks.push_back(
      number("spool", f.free_bytes, "B",
             mib >= 1024  ? Verdict::kOk
             : mib >= 100 ? Verdict::kWarning
                          : Verdict::kFailed,
             fmt::format("{:.1f} GiB free for {}, {:.0f} hours of lessons", mib / 1024, f.folder, hours),
             "at least 1 GiB", "make room, or give --spool a folder on a larger disk"));
  checks.push_back(number(
      "disk", f.sync_max_s, "s", upTo(f.sync_max_s, 0.2, 1),
      fmt::format("a sync takes {:.1f} ms, {:.1f} ms at most", 1e3 * f.sync_median_s, 1e3 * f.sync_max_s),
      "at most 200 ms",
      "slower than a lesson wants: what a power cut may take grows beyond 1 s; use a local disk for "
      "--spool"));
}

void judgeEngine(const EngineFacts& f, double rate_hz, std::vector<Check>& checks) {
  if (!f.trouble.empty()) {
    checks.push_back({"engine", Verdict::kFailed, f.trouble, "", "the program is damaged: build it again"});
    return;
  }
  const double share = f.tick_median_ns * rate_hz * 1e-9;
  checks.push_back(
      number("engine", f.tick_median_ns, "ns", upTo(share, 0.05, 0.5),
             fmt::format("{:.0f} ns a tick for the heaviest of {} sample scenes ({}), {:.3f} % of a period",
                         f.tick_median_ns, f.scenes, f.heaviest, 100 * share),
             "at most 5 %", "give a lower --rate, or use a faster computer"));
}

/// `of`: for the checks' names; empty for the only server. `verdict`: if the server does not accept the
/// station.
void judgeServer(const ServerFacts& f, const std::string& of, Verdict verdict, std::vector<Check>& checks) {
  if (!f.trouble.empty()) {
    checks.push_back(
        {"server" + of, verdict, f.address + ": " + f.trouble, "",
         "lessons run without it and wait in the spool; check address, network, --ca and --key"});
    return;
  }
  checks.push_back(number("server" + of, f.connect_s, "s", upTo(f.connect_s, 1, 5),
                          fmt::format("{}, {}: TLS and key accepted in {:.0f} ms as {}", f.address, f.program,
                                      1e3 * f.connect_s, f.name),
                          "within 1 s", "the network or the server is slow"));
  checks.push_back(number("network" + of, f.round_trip_s, "s", upTo(f.round_trip_s, 0.1, 1),
                          fmt::format("{:.1f} ms there and back", 1e3 * f.round_trip_s), "at most 100 ms",
                          "what the instructor sees comes late; the lesson itself does not suffer"));
  checks.push_back(number("time of day" + of, f.clock_offset_s, "s",
                          upTo(std::abs(f.clock_offset_s), 2, 86'400.0 * 365),
                          fmt::format("{:.2f} s {} the server's", std::abs(f.clock_offset_s),
                                      f.clock_offset_s >= 0 ? "behind" : "ahead of"),
                          "within 2 s", "set up NTP (systemd-timesyncd) on this computer and on the server"));
}

void judgeServers(const std::vector<ServerFacts>& servers, std::vector<Check>& checks) {
  if (servers.empty()) {
    checks.push_back(
        {"server", Verdict::kNotChecked, "give --server, --ca and --key to have it checked", "", ""});
    return;
  }
  const bool any_accepts =
      std::any_of(servers.begin(), servers.end(), [](const ServerFacts& f) { return f.trouble.empty(); });
  for (const ServerFacts& f : servers)
    judgeServer(f, servers.size() == 1 ? std::string() : " " + f.address,
                any_accepts ? Verdict::kWarning : Verdict::kFailed, checks);
}

// the last row leads to the measurement
void judgeDelay(const DeviceFacts& f, std::vector<Check>& checks) {
  if (!f.trouble.empty() || !f.info || !f.info->renders_force || (f.delay.ok() && f.delay->is_known)) return;
  if (!f.delay.ok())
    checks.push_back({"delay", Verdict::kFailed, f.delay.error().message, "", ""});
  else
    checks.push_back(
        {"delay", Verdict::kNotChecked,
         fmt::format("not measured: lessons assume that a force is {:g} ticks late", f.delay->ticks), "",
         "hold the handle and run needlelab-station --device " + f.spec +
             " --measure-delay: it takes a minute"});
}

}  // namespace

std::span<const ConditionText> conditionTexts() {
  return kConditions;
}

std::vector<Check> judge(const SelfTestFacts& facts) {
  std::vector<Check> checks;
  judgeDevice(facts.device, checks);
  judgeComputer(facts.machine, checks);
  judgeMonitor(facts.monitor, checks);
  judgeEngine(facts.engine, facts.device.rate_hz, checks);
  judgeDisk(facts.disk, facts.device.rate_hz, checks);
  judgeServers(facts.servers, checks);
  judgeDelay(facts.device, checks);
  return checks;
}

namespace {

constexpr std::size_t kBlockBytes = 128;
constexpr std::string_view kHeader("\x00\xFF\xFF\xFF\xFF\xFF\xFF\x00", 8);
constexpr std::size_t kWidth_cm = 21, kHeight_cm = 22;
// in the first detailed timing at 54: the low bytes, and the high four bits of both
constexpr std::size_t kWidth_mm = 66, kHeight_mm = 67, kHigh_mm = 68;

int byteAt(std::string_view edid, std::size_t at) {
  return static_cast<unsigned char>(edid[at]);
}

}  // namespace

std::optional<double> edidDiagonal_m(std::string_view edid) {
  if (edid.size() < kBlockBytes || !edid.starts_with(kHeader)) return std::nullopt;
  const int high = byteAt(edid, kHigh_mm);
  const int width_mm = byteAt(edid, kWidth_mm) | (high & 0xF0) << 4,
            height_mm = byteAt(edid, kHeight_mm) | (high & 0x0F) << 8;
  if (width_mm > 0 && height_mm > 0) return 1e-3 * std::hypot(width_mm, height_mm);
  const int width_cm = byteAt(edid, kWidth_cm), height_cm = byteAt(edid, kHeight_cm);
  if (width_cm > 0 && height_cm > 0) return 1e-2 * std::hypot(width_cm, height_cm);
  return std::nullopt;
}

std::vector<MonitorSize> connectedMonitors(const std::filesystem::path& drm) {
  std::vector<MonitorSize> found;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(drm, none)) {
    const std::string name = entry.path().filename();  // "card0-HDMI-A-1"
    const std::size_t dash = name.find('-');
    if (!name.starts_with("card") || dash == std::string::npos) continue;
    // the kernel reports no size for this file; it is empty if nothing is connected
    std::string edid(kBlockBytes, 0);
    std::ifstream file(entry.path() / "edid", std::ios::binary);
    file.read(edid.data(), static_cast<std::streamsize>(edid.size()));
    edid.resize(static_cast<std::size_t>(file.gcount()));
    if (const auto diagonal_m = edidDiagonal_m(edid)) found.push_back({name.substr(dash + 1), *diagonal_m});
  }
  std::ranges::sort(found, {}, &MonitorSize::plug);
  return found;
}

}  // namespace needlelab
