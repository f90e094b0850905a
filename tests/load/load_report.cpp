#include "tests/load/load_report.h"

#include <fmt/core.h>

#include <algorithm>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "tests/bench/result_folder.h"

namespace needlelab::test {
namespace {

using Json = nlohmann::ordered_json;

double ms(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-6;
}

template <typename T>
Json orNull(const std::optional<T>& value) {
  return value ? Json(*value) : Json();
}

Json processesJson(const LoadResult& r) {
  Json list = Json::array();
  for (const ProcessUse& use : r.processes)
    list.push_back({{"name", use.name},
                    {"cpu_s", orNull(use.cpu_s)},
                    {"disk_bytes", orNull(use.disk_bytes)},
                    {"log_bytes", orNull(use.log_bytes)},
                    {"sent_bytes", orNull(use.sent_bytes)},
                    {"received_bytes", orNull(use.received_bytes)},
                    {"messages_out", orNull(use.messages_out)},
                    {"messages_in", orNull(use.messages_in)}});
  return list;
}

// The time in which 200 stations fill what is filled once: connections' buffers, SQLite's pages, the C
// library's per-thread caches. On a quiet machine the live heap grew by 450 KiB in the first 5 min, then by
// 14 KiB/min, and after 10 min by 7 (README.md).
constexpr double kWarmUp_s = 600;
constexpr double kLeastJudged_s = 300;
// resident in addition to the live heap: program, libraries, stacks, mapped files, and what malloc holds
// between blocks
constexpr double kMostBesideHeap_KiB = 64 * 1024;

// rows of the last server, after its warm-up
std::span<const ServerRow> judgedRows(const LoadResult& result) {
  // until the first station ends
  const auto ended = std::find_if(result.rows.begin(), result.rows.end(),
                                  [&](const ServerRow& row) { return row.time_s > result.options.seconds; });
  const std::span<const ServerRow> rows(result.rows.begin(), ended);
  if (rows.empty()) return {};
  const auto born = std::find_if(rows.begin(), rows.end(),
                                 [&](const ServerRow& row) { return row.starts == rows.back().starts; });
  // if its life is too short to be judged, the last part is shown
  const double from_s = born->time_s + std::min(kWarmUp_s, (rows.back().time_s - born->time_s) / 2);
  const auto first =
      std::find_if(born, rows.end(), [&](const ServerRow& row) { return row.time_s >= from_s; });
  return rows.subspan(static_cast<std::size_t>(first - rows.begin()));
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Finding zero(const std::string& what, std::uint64_t value) {
  return {what, std::to_string(value), "= 0", value == 0 ? Verdict::kGood : Verdict::kBad};
}

Finding said(const std::string& what, std::string value) {
  return {what, std::move(value), "", Verdict::kGood};
}

// a lost connection returns within a second: most of the time all are connected
Finding steadyHandles(std::span<const ServerRow> rows) {
  const std::size_t third = std::max<std::size_t>(1, rows.size() / 3);
  std::vector<double> first, last;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i < third) first.push_back(static_cast<double>(rows[i].server.handles));
    if (i + third >= rows.size()) last.push_back(static_cast<double>(rows[i].server.handles));
  }
  const double before = median(first), after = median(last);
  return {"handles of the server, median of the first and the last third",
          fmt::format("{:.0f}, {:.0f}", before, after), "constant",
          after <= before + 1 ? Verdict::kGood : Verdict::kBad};
}

Finding besideHeap(const std::vector<double>& rss_KiB, const std::vector<double>& live_KiB, SoakForm form) {
  Finding beside{"resident memory of the server beside its live heap, median", "unknown", "", Verdict::kGood};
  if (form == SoakForm::kNightly) beside.limit = fmt::format("< {:.0f} MiB", kMostBesideHeap_KiB / 1024);
  const double KiB = live_KiB.empty() ? kMostBesideHeap_KiB : median(rss_KiB) - median(live_KiB);
  if (!live_KiB.empty()) beside.value = fmt::format("{:.1f} MiB", KiB / 1024);
  if (form == SoakForm::kNightly && KiB >= kMostBesideHeap_KiB) beside.verdict = Verdict::kBad;
  return beside;
}

std::string samplesCsv(const std::vector<ServerRow>& rows) {
  std::string text = "time_s,rss_kib,anon_kib,handles,threads,cpu_s,starts,data_bytes,live_kib\n";
  for (const ServerRow& row : rows)
    text += fmt::format("{:.3f},{},{},{},{},{:.2f},{},{},{}\n", row.time_s, row.server.rss_KiB,
                        row.server.anon_KiB, row.server.handles, row.server.threads, row.server.cpu_s,
                        row.starts, row.data_bytes, row.live_KiB);
  return text;
}

}  // namespace

Json loadJson(const LoadResult& r) {
  const LatencyQuantiles live = r.viewers.live.quantiles(), ack = r.stations.ack.quantiles(),
                         late = r.stations.late.quantiles(), elsewhere = r.viewers.elsewhere.quantiles();
  const Difference& d = r.stored.samples;
  return {
      {"stations", r.options.stations},
      {"viewers", r.options.viewers},
      {"seconds", r.options.seconds},
      {"samples_sent", r.stations.samples_sent},
      {"samples_acked", r.stations.samples_acked},
      {"samples_stored", d.stored},
      {"lost", d.lost},
      {"duplicated", d.duplicated},
      {"live_p50_ms", ms(live.p50_ns)},
      {"live_p99_ms", ms(live.p99_ns)},
      {"live_dropped_frames", r.stations.live_frames - std::min(r.stations.live_frames, r.viewers.frames)},
      {"ack_p99_ms", ms(ack.p99_ns)},
      {"server_cpu_s", r.server_cpu_s},
      {"generator_cpu_s", r.generator_cpu_s},
      {"bytes_per_sample",
       d.stored > 0 ? static_cast<double>(r.stored.chunk_bytes) / static_cast<double>(d.stored) : 0},
      // in addition to the fields that all results have
      {"different", d.different},
      {"foreign", d.foreign},
      {"samples_made", r.samples_made},
      {"sessions_closed", r.stations_closed},
      {"sessions_not_complete", r.stored.not_complete},
      {"sessions_stray", r.stored.stray},
      {"live_p999_ms", ms(live.p999_ns)},
      {"live_max_ms", ms(live.max_ns)},
      {"live_elsewhere_p50_ms", ms(elsewhere.p50_ns)},
      {"live_elsewhere_p99_ms", ms(elsewhere.p99_ns)},
      {"live_frames_elsewhere", r.viewers.elsewhere.total()},
      {"live_frames_sent", r.stations.live_frames},
      {"live_frames_seen", r.viewers.frames},
      {"live_gaps", r.viewers.gaps},
      {"live_told_dropped", r.viewers.told},
      {"live_corrupt", r.viewers.corrupt},
      {"ack_p50_ms", ms(ack.p50_ns)},
      {"ack_max_ms", ms(ack.max_ns)},
      {"late_p50_ms", ms(late.p50_ns)},
      {"late_p99_ms", ms(late.p99_ns)},
      {"late_max_ms", ms(late.max_ns)},
      {"streamed_s", r.streamed_s},
      {"station_s", r.stationSeconds()},
      {"connect_s", r.connect_s},
      {"drain_s", r.drain_s},
      {"check_s", r.check_s},
      {"server_rss_kib", r.server_rss_KiB},
      {"server_handles", r.server_handles},
      {"database_bytes", r.database_bytes},
      {"database_disk", r.database_disk},
      {"servers", r.options.servers},
      {"stations_at", r.stations_at},
      {"processes", processesJson(r)},
      {"connections", r.stations.connections},
      {"reconnects",
       r.stations.connections - std::min<std::uint64_t>(r.stations.connections, r.options.stations)},
      {"chunks_resent", r.stations.chunks_resent},
      {"unsent_peak_chunks", r.stations.unsent_peak},
      {"cuts", r.cuts},
      {"server_kills", r.kills},
      {"viewer_pauses", r.pauses},
      {"seed", r.options.seed},
      {"interrupted", r.interrupted},
      {"good", r.good()},
      {"faults", r.stored.faults},
      {"troubles", r.troubles},
      {"version", programVersion()},
      {"machine", machineText()},
      {"when", r.when},
  };
}

std::string loadText(const LoadResult& r) {
  const Json json = loadJson(r);
  std::string text;
  for (const auto& [key, value] : json.items()) {
    if (value.is_array())
      for (const Json& one : value) text += fmt::format("{:<24}{}\n", key, one.dump());
    else if (!value.is_null())
      text +=
          fmt::format("{:<24}{}\n", key,
                      value.is_number_float() ? fmt::format("{:.6g}", value.get<double>()) : value.dump());
  }
  if (r.stations.late.quantile_ns(0.99) > 10'000'000)
    text += "THE GENERATOR DID NOT KEEP UP: the latencies hold its own lateness\n";
  return text + (r.good() ? "verdict: good\n" : "verdict: BAD\n");
}

SoakForm soakForm(const LoadOptions& options) {
  const double last_server_s = options.seconds * (options.faults ? 1 - kKillShare : 1);
  return last_server_s < kWarmUp_s + kLeastJudged_s ? SoakForm::kShort : SoakForm::kNightly;
}

std::vector<Finding> judgeLoad(const LoadResult& r, const SoakLimits& limits) {
  const Difference& d = r.stored.samples;
  std::vector<Finding> findings = {
      zero("samples lost", d.lost),
      zero("samples stored twice", d.duplicated),
      zero("samples stored with another value", d.different),
      zero("samples stored that no one made", d.foreign),
      zero("sessions not closed as complete",
           r.options.stations - std::min<std::uint64_t>(r.options.stations, r.stations_closed) +
               r.stored.not_complete),
      zero("sessions or chunks that no station made", r.stored.stray),
  };
  for (const auto* words : {&r.stored.faults, &r.troubles})
    for (const std::string& text : *words)
      findings.push_back({"reported trouble", text, "none", Verdict::kBad});

  const auto rows = judgedRows(r);
  if (!rows.empty()) {
    std::vector<double> time_s, rss_KiB, live_s, live_KiB;
    for (const ServerRow& row : rows) {
      time_s.push_back(row.time_s);
      rss_KiB.push_back(static_cast<double>(row.server.rss_KiB));
      if (row.live_KiB == 0) continue;
      live_s.push_back(row.time_s);
      live_KiB.push_back(static_cast<double>(row.live_KiB));
    }
    // Resident memory cannot be judged by its slope: it keeps the pages of the largest burst so far, and
    // surviving small blocks spread over more of them (README.md)
    findings.push_back(flatMemory("live heap of the server", live_s, live_KiB, soakForm(r.options), limits));
    findings.push_back(
        flatMemory("resident memory of the server", time_s, rss_KiB, SoakForm::kShort, limits));
    findings.push_back(besideHeap(rss_KiB, live_KiB, soakForm(r.options)));
    findings.push_back(steadyHandles(rows));
    findings.push_back(
        said("memory of the server at the end", fmt::format("{:.1f} MiB", rss_KiB.back() / 1024)));
  }
  const auto number = [](std::uint64_t n) { return std::to_string(n); };
  findings.push_back(said("samples made, stored", number(r.samples_made) + ", " + number(d.stored)));
  findings.push_back(said("faults: connections cut, server killed, viewers stopped",
                          number(r.cuts) + ", " + number(r.kills) + ", " + number(r.pauses)));
  findings.push_back(said("chunks sent again", number(r.stations.chunks_resent)));
  findings.push_back(
      said("capture to viewer, p50 / p99",
           fmt::format("{:.1f} / {:.1f} ms", static_cast<double>(r.viewers.live.quantile_ns(0.5)) * 1e-6,
                       static_cast<double>(r.viewers.live.quantile_ns(0.99)) * 1e-6)));
  findings.push_back(said(
      "due to acknowledged, p50 / p99 / most",
      fmt::format("{:.0f} / {:.0f} / {:.0f} ms", static_cast<double>(r.stations.ack.quantile_ns(0.5)) * 1e-6,
                  static_cast<double>(r.stations.ack.quantile_ns(0.99)) * 1e-6,
                  static_cast<double>(r.stations.ack.max_ns()) * 1e-6)));
  return findings;
}

Status writeSoak(const LoadResult& result, const std::vector<Finding>& findings,
                 const std::filesystem::path& out) {
  std::error_code error;
  std::filesystem::create_directories(out, error);
  if (error) return Error{ErrorCode::kFailed, "cannot make " + out.string() + ": " + error.message()};
  for (const auto& [name, text] :
       {std::pair<const char*, std::string>{"samples.csv", samplesCsv(result.rows)},
        {"load.json", loadJson(result).dump(1) + "\n"},
        {"table.txt", machineText() + "\n" + tableText(findings, soakForm(result.options))}})
    RETURN_IF_ERROR(writeFileAtomically(out / name, viewOf(text)));
  return {};
}

}  // namespace needlelab::test
