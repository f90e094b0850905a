#include <nlohmann/json.hpp>
#include <string>

#include "client/station/run/summary_parts.h"
#include "common/base/text.h"
#include "common/haptics/force_gate.h"

namespace needlelab {
namespace {

using Json = SummaryJson;

// the "words" of each row, one a line, indented
std::string rowWords(const Json& rows) {
  std::string text;
  for (const Json& row : rows)
    if (row.is_object() && row.contains("words") && row["words"].is_string())
      text += "    " + row["words"].get<std::string>() + "\n";
  return text;
}

// what was done with the syringe
std::string syringeLines(const StationSummary& summary) {
  const Json events = parsedOrNull(summary.syringe_json);
  if (!events.is_array()) return {};
  if (events.empty()) return "syringe      not used\n";
  return "syringe\n" + rowWords(events);
}

// "12 measures, all requirements met", with the measures that have a requirement
std::string scoreWords(const StationSummary& summary) {
  const Json score = parsedOrNull(summary.score_json);
  if (!score.is_array()) return "none";
  return std::to_string(score.size()) + " measures, computed by the " + summary.score_source + "\n" +
         rowWords(score);
}

// faults that were there, over by now or not, and what is kept of them
std::string faultLines(const StationSummary& s) {
  std::string text;
  const auto count = [](std::uint64_t n) { return static_cast<unsigned long long>(n); };
  if (s.servo.faults > 0)
    text += formatted("faults       %llu, %llu ticks without force; the first: %s\n", count(s.servo.faults),
                      count(s.servo.fault_ticks), faultText(s.servo.first_fault));
  for (std::size_t i = 0; i < s.servo.fault_note_count; ++i) {
    const FaultNote& note = s.servo.fault_notes[i];
    text += formatted(
        "             at %.3f s: %s, %s\n", static_cast<double>(note.tick) / s.rate_hz, faultText(note.fault),
        note.over_tick
            ? formatted("acknowledged and over at %.3f s", static_cast<double>(*note.over_tick) / s.rate_hz)
                  .c_str()
            : "not over at the end");
  }
  const BlackBoxCounts& box = s.black_box;
  if (box.triggers > 0)
    text += formatted(
        "black box    %llu files in %s/black-box, for %llu faults and storms of missed ticks; "
        "%llu not kept, %llu not written\n",
        count(box.files), s.spool.c_str(), count(box.triggers), count(box.not_kept), count(box.not_written));
  return text;
}

// how late the loop woke, and what its ticks took, phase by phase
std::string timingLines(const StationSummary& s) {
  const auto line = [](const char* name, const LatencyHistogram& h, const std::string& more) {
    const LatencyQuantiles q = h.quantiles();
    return formatted("%-12s p50 %.1f µs, p99 %.1f µs, p99.9 %.1f µs, max %.1f µs%s\n", name, micro(q.p50_ns),
                     micro(q.p99_ns), micro(q.p999_ns), micro(q.max_ns), more.c_str());
  };
  const auto late = static_cast<unsigned long long>(s.servo.late_wakeups);
  std::string text = line("wake-up", s.servo.wakeup, formatted("; a tick or more late: %llu times", late));
  text += line("tick", s.servo.tick, "; of it");
  text += line("  read", s.servo.read, "");
  text += line("  engine", s.servo.engine, "");
  text += line("  write", s.servo.write, "");
  text += line("  record", s.servo.record, "");
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
  const auto count = [](std::uint64_t n) { return static_cast<unsigned long long>(n); };
  text += formatted("session      %s (%s)\n", s.session_id.c_str(), servoEndText(s.servo.end));
  if (s.stopped) text += "             " + stopText(s.stopped) + "\n";
  if (s.servo.fault != Fault::kNone) text += formatted("FAULT        %s\n", faultText(s.servo.fault));
  text += faultLines(s);
  text += formatted("samples      %llu at %g Hz; %llu of %llu ticks missed; %llu lost\n",
                    count(s.servo.samples), s.rate_hz, count(s.servo.missed_ticks), count(s.servo.ticks),
                    count(s.ring_dropped + s.writer.samples_lost));
  if (s.lost_from_tick)
    text += formatted(
        "LOST         %llu samples from tick %llu on: the spool's disk refused them for too long; the "
        "session is stored as interrupted\n",
        count(s.ring_dropped + s.writer.samples_lost), count(*s.lost_from_tick));
  text += timingLines(s);
  text += formatted("stored       %.2f bytes a sample in %llu chunks\n", bytesPerSample(s),
                    count(s.writer.chunks));
  std::string effects;
  for (const std::string& effect : s.live_effects) effects += (effects.empty() ? "" : ", ") + effect;
  text += "live effects " + (effects.empty() ? "none" : effects) + "\n";
  for (const std::string& note : s.device_notes) text += "device       " + note + "\n";
  if (s.effect_costs) text += "their cost   " + effectCostsText(*s.effect_costs) + "\n";
  if (!s.axial_model.empty()) text += "axial model  " + s.axial_model + "\n";
  for (const bool warnings : {false, true}) {
    const Json counts = flagCounts(s.servo, warnings);
    for (const auto& [words, ticks] : counts.items())
      text += std::string(warnings ? "warning      " : "event        ") + words + ": " + ticks.dump() +
              (ticks == 1 ? " tick\n" : " ticks\n");
  }
  if (s.has_server) {
    text += formatted("server       %llu of %llu samples committed, session %s\n", count(s.samples_acked),
                      count(s.servo.samples), s.state.c_str());
    if (!s.uplink.current_trouble.empty()) text += "             " + s.uplink.current_trouble + "\n";
  }
  if (s.spool_left > 0)
    text += "spool        " + std::to_string(s.spool_left) + " chunks wait in " + s.spool +
            " for the server; they are sent at the next start with --server\n";
  else
    text += "spool        " + s.spool + ", nothing waits\n";
  text += syringeLines(s);
  text += "score        " + scoreWords(s);
  if (text.back() != '\n') text += '\n';
  return text;
}

}  // namespace needlelab
