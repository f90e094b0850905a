#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "client/station/run/summary_parts.h"
#include "common/base/program.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/force_gate.h"

namespace needlelab {
namespace {

using Json = SummaryJson;

double tenths(double number) {
  return std::round(number * 10) / 10;
}

// name → ns of each live effect
Json costsOf(const std::optional<EffectCosts>& costs) {
  if (!costs) return nullptr;
  Json by_name = Json::object();
  for (const EffectCost& cost : costs->effects)
    by_name[std::string(effectName(cost.effect))] = tenths(cost.ns);
  return by_name;
}

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

// the quantiles of one histogram as keys NAME_p50_UNIT …; those that are there already are not changed
void putQuantiles(Json& row, const std::string& name, const LatencyHistogram& h) {
  const LatencyQuantiles q = h.quantiles();
  const std::pair<const char*, std::int64_t> all[] = {
      {"_p50_ns", q.p50_ns}, {"_p99_ns", q.p99_ns}, {"_p999_ns", q.p999_ns}, {"_max_ns", q.max_ns}};
  for (const auto& [suffix, ns] : all) row[name + suffix] = ns;
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
      {"tick_p50_ns", s.servo.tick.quantile_ns(0.5)},
      {"tick_p99_ns", s.servo.tick.quantile_ns(0.99)},
      {"tick_p999_ns", s.servo.tick.quantile_ns(0.999)},
      {"tick_max_ns", s.servo.tick.max_ns()},
      {"engine_p50_ns", s.servo.engine.quantile_ns(0.5)},
      {"engine_p99_ns", s.servo.engine.quantile_ns(0.99)},
      {"device_p50_ns", s.servo.device.quantile_ns(0.5)},
      {"device_p99_ns", s.servo.device.quantile_ns(0.99)},
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
      {"effect_costs_ns", costsOf(s.effect_costs)},
      {"engine_tick_ns", s.effect_costs ? Json(tenths(s.effect_costs->tick_ns)) : Json(nullptr)},
      {"events", flagCounts(s.servo, false)},
      {"warnings", flagCounts(s.servo, true)},
      {"syringe", parsedOrNull(s.syringe_json)},
      {"score", parsedOrNull(s.score_json)},
      {"score_source", s.score_source.empty() ? Json(nullptr) : Json(s.score_source)},
  };
  if (s.uplink.clock) {
    row["clock_offset_ns"] = s.uplink.clock->offset_ns;
    row["clock_round_trip_ns"] = s.uplink.clock->round_trip_ns;
  }
  row["faults"] = faultsOf(s);
  row["fault_count"] = s.servo.faults;
  row["device_notes"] = s.device_notes;
  row["first_fault"] = s.servo.faults == 0 ? Json(nullptr) : Json(faultText(s.servo.first_fault));
  row["fault_ticks"] = s.servo.fault_ticks;
  row["late_wakeups"] = s.servo.late_wakeups;
  putQuantiles(row, "engine", s.servo.engine);
  putQuantiles(row, "device", s.servo.device);
  putQuantiles(row, "read", s.servo.read);
  putQuantiles(row, "write", s.servo.write);
  putQuantiles(row, "record", s.servo.record);
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
  Json all = {{"version", NEEDLELAB_VERSION}, {"machine", machineText()}, {"rows", std::move(rows)}};
  all.update(row);
  return all.dump(1) + "\n";
}

}  // namespace needlelab
