#include "client/station/run/summary.h"

#include <fmt/core.h>

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>

#include "common/base/program.h"
#include "common/base/time/clock.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/engine.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/gate/handle_stiffness.h"

namespace needlelab {
namespace {

using Json = nlohmann::ordered_json;

// ns to µs.
double micro(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-3;
}

Json alarmRows(const std::vector<AlarmCount>& alarms) {
  Json rows = Json::array();
  for (const AlarmCount& alarm : alarms)
    rows.push_back({{"alarm", kindOf(alarm.alarm).name}, {"begun", alarm.begun}, {"detail", alarm.detail}});
  return rows;
}

// Flags set in any tick, warnings or events: text → ticks.
Json flagCounts(const ServoStats& servo, bool warnings) {
  Json counts = Json::object();
  for (unsigned bit = 0; bit < servo.flag_ticks.size(); ++bit)
    if (servo.flag_ticks[bit] > 0 && !flagText(bit).empty() && isWarningFlag(bit) == warnings)
      counts[std::string(flagText(bit))] = servo.flag_ticks[bit];
  return counts;
}

// Parses JSON; null for empty or invalid text.
Json parsedOrNull(const std::string& text) {
  if (text.empty()) return nullptr;
  Json value = Json::parse(text, nullptr, false);
  return value.is_discarded() ? Json(nullptr) : value;
}

// per stored sample; 0 without samples
double bytesPerSample(const StationSummary& summary) {
  const std::uint64_t stored = summary.writer.samples - summary.writer.samples_lost;
  return stored == 0 ? 0 : static_cast<double>(summary.writer.chunk_bytes) / static_cast<double>(stored);
}

}  // namespace

// --- texts ---

namespace {

struct FlagText {
  std::uint32_t flag;
  bool warning;
  std::string_view text;
};

constexpr FlagText kFlagTexts[] = {
    {kFlagEntry, false, "entries into the tissue"},
    {kFlagExit, false, "exits from the tissue"},
    {kFlagLayerChange, false, "changes of layer"},
    {kFlagRupture, false, "membranes ruptured"},
    {kFlagTurn, false, "turns of the trajectory"},
    {kFlagClampCapped, true, "clamping force at its maximum"},
    {kFlagForceCapped, true, "force cut to the profile's maximum"},
    {kFlagTorque, false, "torque of the orientation limit"},
    {kFlagNotStepped, true, "tick not computed (bad sample, or after a fault)"},
    {kFlagStartedInside, true,
     "in the tissue, or with the cap on the skin, from the start: no force until it was lifted clear"},
    {kFlagBeyondNeedle, true, "inserted deeper than the needle is long"},
    {kFlagFlatEntry, true, "entries with the needle flat on the skin"},
    {kFlagKeptPath, true, "the body's layers found too late: those before were kept"},
    {kFlagCapped, false, "with the cap on"},
    {kFlagSkipped, true, "layers passed so fast that they were not felt"},
    {kGateSampleRejected, true, "sample of the device rejected"},
    {kGatePeakLimited, true, "force cut to what the device can render"},
    {kGateThermalLimited, true, "force lowered so that the motors stay cool"},
    {kGateSlewLimited, true, "force rising more slowly than computed"},
    {kGateStartRamp, false, "start: force fading in"},
    {kGateFaulted, true, "FAULT: force taken away"},
    {kDeviceEmergencyStop, true, "emergency stop pressed"},
    {kDeviceReleased, false, "no one held the handle: no force"},
    {kDevicePowerOff, true, "motors without power: no force"},
    {kDeviceOverheated, true, "motors too hot"},
    {kDeviceSaturated, true, "device rendered less than it was asked for"},
    {kDeviceOverrun, true, "device could not keep the rate"},
    {kDeviceLost, true, "device lost"},
    {kDeviceTrouble, true, "device reported an error"},
    {kDeviceNotReady, true, "device not ready: no force"},
};

const FlagText* flagRow(unsigned bit) {
  for (const FlagText& row : kFlagTexts)
    if (row.flag == (1u << bit)) return &row;
  return nullptr;
}

}  // namespace

std::string_view flagText(unsigned bit) {
  const FlagText* row = flagRow(bit);
  return row == nullptr ? std::string_view() : row->text;
}

bool isWarningFlag(unsigned bit) {
  const FlagText* row = flagRow(bit);
  return row != nullptr && row->warning;
}

const char* servoEndText(ServoEnd end) {
  switch (end) {
    case ServoEnd::kNotYet:
      return "did not run";
    case ServoEnd::kStopped:
      return "stopped";
    case ServoEnd::kTicksDone:
      return "time is over";
    case ServoEnd::kDeviceFinished:
      return "the device's motion is over";
    case ServoEnd::kFault:
      return "FAULT";
    case ServoEnd::kCrash:
      return "another part of the program died";
  }
  return "?";
}

std::string resultsText(std::int64_t results_from_unix_ns) {
  return "Your result is shown from " + localTime(results_from_unix_ns, TimeForm::kWords) + " on.";
}

std::string stopText(const std::optional<StopCause>& stopped) {
  if (!stopped) return {};
  return (stopped->by.empty() ? std::string("stopped at the window") : "stopped by " + stopped->by) +
         (stopped->reason.empty() ? "" : ": " + stopped->reason);
}

// --- JSON ---

namespace {

Json faultsOf(const StationSummary& s) {
  Json faults = Json::array();
  for (std::size_t i = 0; i < s.servo.fault_note_count; ++i) {
    const FaultNote& note = s.servo.fault_notes[i];
    Json row = {{"reason", faultText(note.fault)},
                {"tick", note.tick},
                {"time_s", static_cast<double>(note.tick) / s.rate_hz},
                {"acknowledged", note.over_tick.has_value()}};
    row["over_s"] = note.over_tick ? Json(static_cast<double>(*note.over_tick) / s.rate_hz) : Json(nullptr);
    faults.push_back(std::move(row));
  }
  return faults;
}

// the parts of a tick's time: in the JSON, and in the text if it has a line
struct TickPart {
  const char* name;
  const char* line;
  LatencyHistogram ServoStats::*times;
};
constexpr TickPart kTickParts[] = {
    {"tick", "tick", &ServoStats::tick},         {"read", "  read", &ServoStats::read},
    {"engine", "  engine", &ServoStats::engine}, {"write", "  write", &ServoStats::write},
    {"record", "  record", &ServoStats::record}, {"device", nullptr, &ServoStats::device}};

// adds one histogram's quantiles as keys NAME_p50_ns …
void putQuantiles(Json& row, const std::string& name, const LatencyHistogram& h) {
  const LatencyQuantiles q = h.quantiles();
  const std::pair<const char*, std::int64_t> all[] = {
      {"_p50_ns", q.p50_ns}, {"_p99_ns", q.p99_ns}, {"_p999_ns", q.p999_ns}, {"_max_ns", q.max_ns}};
  for (const auto& [suffix, ns] : all) row[name + suffix] = ns;
}

Json missRow(const std::optional<Miss>& miss) {
  if (!miss) return nullptr;
  return {{"in_target", miss->in_target},
          {"aside_m", miss->aside_m},
          {"too_deep_m", miss->too_deep_m},
          {"through", miss->through},
          {"towards", miss->towards},
          {"at", miss->at == Miss::At::kInjection ? "injection" : "furthest point"},
          {"words", missText(*miss)}};
}

Json rowOf(const StationSummary& s) {
  Json row = {
      {"session_id", s.session_id},
      {"station", s.station},
      {"trainee", s.trainee},
      {"exercise", s.exercise},
      {"profile", s.profile},
      {"profile_revision", s.profile_revision},
      {"device", s.device},
      {"rate_hz", s.rate_hz},
      {"end", servoEndText(s.servo.end)},
      {"fault", s.servo.fault == Fault::kNone ? Json(nullptr) : Json(faultText(s.servo.fault))},
      {"ticks", s.servo.ticks},
      {"samples", s.servo.samples},
      {"missed_ticks", s.servo.missed_ticks},
      {"samples_lost", s.ring_dropped + s.writer.samples_lost},
      {"lost_from_tick", s.lost_from_tick ? Json(*s.lost_from_tick) : Json(nullptr)},
      {"wakeup_p50_us", micro(s.servo.wakeup.quantile_ns(0.5))},
      {"wakeup_p99_us", micro(s.servo.wakeup.quantile_ns(0.99))},
      {"wakeup_p999_us", micro(s.servo.wakeup.quantile_ns(0.999))},
      {"wakeup_max_us", micro(s.servo.wakeup.max_ns())},
      {"samples_acked", s.samples_acked},
      {"spool_left", s.spool_left},
      {"bytes_per_sample", bytesPerSample(s)},
      {"chunks", s.writer.chunks},
      {"disk_errors", s.writer.disk_errors},
      {"live_frames", s.uplink.live_frames},
      {"live_dropped", s.uplink.live_dropped},
      {"connections", s.uplink.connections},
      {"state", s.state},
      {"axial_model", s.axial_model},
      {"live_effects", s.live_effects},
      {"events", flagCounts(s.servo, false)},
      {"warnings", flagCounts(s.servo, true)},
      {"alarms", alarmRows(s.alarms)},
      {"syringe", parsedOrNull(s.syringe_json)},
      {"score", parsedOrNull(s.score_json)},
      {"score_source", s.score_source.empty() ? Json(nullptr) : Json(s.score_source)},
      {"results_from_unix_ns", s.results_from_unix_ns != 0 ? Json(s.results_from_unix_ns) : Json(nullptr)},
  };
  row["miss"] = missRow(s.miss);
  if (s.uplink.clock) {
    row["clock_offset_ns"] = s.uplink.clock->offset_ns;
    row["clock_round_trip_ns"] = s.uplink.clock->round_trip_ns;
  }
  row["faults"] = faultsOf(s);
  row["fault_count"] = s.servo.faults;
  row["device_notes"] = s.device_notes;
  row["stiffness_share"] = s.shares.lever;
  row["delay_stiffness_share"] = s.shares.delay;
  row["first_fault"] = s.servo.faults == 0 ? Json(nullptr) : Json(faultText(s.servo.first_fault));
  row["fault_ticks"] = s.servo.fault_ticks;
  row["late_wakeups"] = s.servo.late_wakeups;
  for (const TickPart& part : kTickParts) putQuantiles(row, part.name, s.servo.*part.times);
  row["black_box"] = {{"triggers", s.black_box.triggers},
                      {"files", s.black_box.files},
                      {"not_written", s.black_box.not_written},
                      {"not_kept", s.black_box.not_kept},
                      {"ticks_refused", s.black_box.ticks_refused}};
  row["realtime"] = Json::array();
  for (const RtStep& step : s.realtime)
    row["realtime"].push_back({{"name", step.name}, {"ok", step.ok}, {"message", step.message}});
  row["stopped_by"] = s.stopped ? Json(s.stopped->by.empty() ? s.trainee : s.stopped->by) : Json(nullptr);
  row["stop_reason"] = s.stopped ? Json(s.stopped->reason) : Json(nullptr);
  return row;
}

}  // namespace

std::string summaryJson(const StationSummary& s, const std::vector<StationSummary>& earlier) {
  Json rows = Json::array();
  for (const StationSummary& before : earlier) rows.push_back(rowOf(before));
  const Json row = rowOf(s);
  rows.push_back(row);
  Json all = {{"version", programVersion()}, {"machine", machineText()}, {"rows", std::move(rows)}};
  all.update(row);
  return all.dump(1) + "\n";
}

// --- for a person ---

namespace {

// the "words" of each row, one per line, indented
std::string rowTexts(const Json& rows) {
  std::string text;
  for (const Json& row : rows)
    if (row.is_object() && row.contains("words") && row["words"].is_string())
      text += "    " + row["words"].get<std::string>() + "\n";
  return text;
}

// uses of the syringe
std::string syringeLines(const StationSummary& summary) {
  const Json events = parsedOrNull(summary.syringe_json);
  if (!events.is_array()) return {};
  if (events.empty()) return "syringe      not used\n";
  return "syringe\n" + rowTexts(events);
}

// "12 measures, all requirements met", followed by the measures with a requirement
std::string scoreText(const StationSummary& summary) {
  if (summary.results_from_unix_ns != 0) return resultsText(summary.results_from_unix_ns);
  const Json score = parsedOrNull(summary.score_json);
  if (!score.is_array()) return "none";
  return fmt::format("{} measures, computed by the {}\n{}", score.size(), summary.score_source,
                     rowTexts(score));
}

// the lesson's faults, past and present, and the black boxes
std::string faultLines(const StationSummary& s) {
  std::string text;
  if (s.servo.faults > 0)
    text += fmt::format("faults       {}, {} ticks without force; the first: {}\n", s.servo.faults,
                        s.servo.fault_ticks, faultText(s.servo.first_fault));
  for (std::size_t i = 0; i < s.servo.fault_note_count; ++i) {
    const FaultNote& note = s.servo.fault_notes[i];
    text += fmt::format("             at {:.3f} s: {}, {}\n", static_cast<double>(note.tick) / s.rate_hz,
                        faultText(note.fault),
                        note.over_tick ? fmt::format("acknowledged and over at {:.3f} s",
                                                     static_cast<double>(*note.over_tick) / s.rate_hz)
                                       : "not over at the end");
  }
  const BlackBoxCounts& box = s.black_box;
  if (box.triggers > 0)
    text += fmt::format(
        "black box    {} files in {}/black-box, for {} faults and storms of missed ticks; "
        "{} not kept, {} not written\n",
        box.files, s.spool, box.triggers, box.not_kept, box.not_written);
  return text;
}

// wake-up delay of the loop and duration of each tick phase
std::string timingLines(const StationSummary& s) {
  const auto line = [](const char* name, const LatencyHistogram& h, const std::string& more) {
    const LatencyQuantiles q = h.quantiles();
    return fmt::format("{:<12} p50 {:.1f} µs, p99 {:.1f} µs, p99.9 {:.1f} µs, max {:.1f} µs{}\n", name,
                       micro(q.p50_ns), micro(q.p99_ns), micro(q.p999_ns), micro(q.max_ns), more);
  };
  std::string text =
      line("wake-up", s.servo.wakeup, fmt::format("; a tick or more late: {} times", s.servo.late_wakeups));
  for (const TickPart& part : kTickParts)
    if (part.line != nullptr)
      text += line(part.line, s.servo.*part.times, part.times == &ServoStats::tick ? "; of it" : "");
  const char* label = "real time    ";
  for (const std::string& step : rtStepLines(s.realtime)) {
    text += label + step + "\n";
    label = "             ";
  }
  return text;
}

}  // namespace

std::string summaryText(const StationSummary& s) {
  std::string text;
  text += fmt::format("session      {} ({})\n", s.session_id, servoEndText(s.servo.end));
  if (s.stopped) text += "             " + stopText(s.stopped) + "\n";
  if (s.servo.fault != Fault::kNone) text += fmt::format("FAULT        {}\n", faultText(s.servo.fault));
  text += faultLines(s);
  text += fmt::format("samples      {} at {:g} Hz; {} of {} ticks missed; {} lost\n", s.servo.samples,
                      s.rate_hz, s.servo.missed_ticks, s.servo.ticks, s.ring_dropped + s.writer.samples_lost);
  if (s.lost_from_tick)
    text += fmt::format(
        "LOST         {} samples from tick {} on: the spool's disk refused them for too long; the "
        "session is stored as interrupted\n",
        s.ring_dropped + s.writer.samples_lost, *s.lost_from_tick);
  text += timingLines(s);
  text +=
      fmt::format("stored       {:.2f} bytes a sample in {} chunks\n", bytesPerSample(s), s.writer.chunks);
  std::string effects;
  for (const std::string& effect : s.live_effects) effects += (effects.empty() ? "" : ", ") + effect;
  text += "live effects " + (effects.empty() ? "none" : effects) + "\n";
  for (const std::string& note : s.device_notes) text += "device       " + note + "\n";
  if (!s.axial_model.empty()) text += "axial model  " + s.axial_model + "\n";
  for (const bool warnings : {false, true}) {
    const Json counts = flagCounts(s.servo, warnings);
    for (const auto& [flag, ticks] : counts.items())
      text += std::string(warnings ? "warning      " : "event        ") + flag + ": " + ticks.dump() +
              (ticks == 1 ? " tick\n" : " ticks\n");
  }
  if (s.has_server) {
    text += fmt::format("server       {} of {} samples committed, session {}\n", s.samples_acked,
                        s.servo.samples, s.state);
    if (!s.uplink.current_trouble.empty()) text += "             " + s.uplink.current_trouble + "\n";
    if (!s.uplink.server_full.empty()) text += "             " + s.uplink.server_full + "\n";
  }
  if (s.spool_left > 0)
    text += fmt::format(
        "spool        {} chunks wait in {} for the server; they are sent at the next start with --server\n",
        s.spool_left, s.spool);
  else
    text += "spool        " + s.spool + ", nothing waits\n";
  for (const AlarmCount& alarm : s.alarms)
    text += fmt::format("alarm        {}: {}{}\n", kindOf(alarm.alarm).name, alarm.detail,
                        alarm.begun > 1 ? fmt::format(", {} times", alarm.begun) : "");
  text += syringeLines(s);
  if (s.miss) text += "target       " + missText(*s.miss) + " " + missDirectionText(*s.miss) + "\n";
  if (const std::string lowered = stiffnessShareText(s.shares, s.left_out); !lowered.empty())
    text += "stiffness    " + lowered + "\n";
  text += "score        " + scoreText(s);
  if (text.back() != '\n') text += '\n';
  return text;
}

}  // namespace needlelab
