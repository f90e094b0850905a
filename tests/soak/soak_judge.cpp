#include "tests/soak/soak_judge.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "common/base/files/files.h"
#include "common/base/program.h"

namespace needlelab::test {
namespace {

// Student's t, two-sided 95 %, for 1 … 20 degrees of freedom
constexpr std::array kStudent = {12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
                                 2.201,  2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : (values[half - 1] + values[half]) / 2;
}

Finding equal(const std::string& what, std::uint64_t value, std::uint64_t wanted) {
  return {what, std::to_string(value), fmt::format("= {}", wanted),
          value == wanted ? Verdict::kGood : Verdict::kBad};
}

// after the warm-up
template <typename Get>
std::vector<double> column(const std::vector<SoakRow>& rows, double from_s, Get get) {
  std::vector<double> values;
  for (const SoakRow& row : rows)
    if (row.time_s >= from_s) values.push_back(static_cast<double>(get(row)));
  return values;
}

std::string samplesCsv(const SoakData& data) {
  std::string text = "time_s";
  for (const char* name : kSoakNames)
    for (const char* what : {"rss_kib", "anon_kib", "handles", "threads", "cpu_s"})
      text += std::string(",") + name + "_" + what;
  text += ",spool_bytes,data_bytes,samples,missed_ticks,spool_left,wakeup_p99_us,request_ms\n";
  const auto count = [](std::uint64_t n) { return fmt::format(",{}", n); };
  for (const SoakRow& row : data.rows) {
    text += fmt::format("{:.3f}", row.time_s);
    for (const ProcessSample& p : row.processes)
      text += count(p.rss_KiB) + count(p.anon_KiB) + count(p.handles) + count(p.threads) +
              fmt::format(",{:.2f}", p.cpu_s);
    text += count(row.spool_bytes) + count(row.data_bytes) + count(row.samples) + count(row.missed_ticks) +
            count(row.spool_left) + count(row.wakeup_p99_us) + fmt::format(",{:.3f}\n", row.request_ms);
  }
  return text;
}

std::string minutesCsv(const SoakMinutes& minutes) {
  std::string text = "end_s,samples,missed_ticks,tick_p99_us,wakeup_p99_us,request_p99_ms,live_p99_ms\n";
  for (const SoakMinute& m : minutes)
    text += fmt::format("{:.3f},{},{},{:.2f},{:.0f},{:.3f},{:.3f}\n", m.end_s, m.samples, m.missed_ticks,
                        m.tick_p99_us, m.wakeup_p99_us, m.request_p99_ms, m.live_p99_ms);
  return text;
}

}  // namespace

Slope slopeOf(std::span<const double> time_s, std::span<const double> value, std::size_t blocks) {
  Slope slope;
  if (time_s.empty() || blocks < 4) return slope;
  const double first = time_s.front(), length = (time_s.back() - first) / static_cast<double>(blocks);
  std::vector<std::vector<double>> in(blocks);
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    const auto block = length > 0 ? static_cast<std::size_t>((time_s[i] - first) / length) : 0;
    in[std::min(block, blocks - 1)].push_back(value[i]);
  }
  std::vector<double> x, y;
  for (std::size_t block = 0; block < blocks; ++block) {
    if (in[block].empty()) continue;
    x.push_back((static_cast<double>(block) + 0.5) * length / 60);
    y.push_back(median(in[block]));
  }
  slope.blocks = x.size();
  if (x.size() < 4) return slope;
  const auto n = static_cast<double>(x.size());
  double mean_x = 0, mean_y = 0, xx = 0, xy = 0, rest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mean_x += x[i] / n;
    mean_y += y[i] / n;
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mean_x) * (x[i] - mean_x);
    xy += (x[i] - mean_x) * (y[i] - mean_y);
  }
  if (xx <= 0) return Slope{};
  slope.per_min = xy / xx;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double off = y[i] - mean_y - slope.per_min * (x[i] - mean_x);
    rest += off * off;
  }
  slope.half_width_per_min =
      kStudent[std::min(x.size() - 3, kStudent.size() - 1)] * std::sqrt(rest / (n - 2) / xx);
  return slope;
}

Finding flatMemory(const std::string& what, std::span<const double> time_s, std::span<const double> KiB,
                   SoakForm form, const SoakLimits& limits) {
  const Slope slope = slopeOf(time_s, KiB);
  Finding flat{what + ", growth after " + fmt::format("{:.0f} s", time_s.empty() ? 0.0 : time_s.front()),
               slope.blocks < 4
                   ? "too few samples"
                   : fmt::format("{:+.1f} ± {:.1f} KiB/min", slope.per_min, slope.half_width_per_min),
               "", Verdict::kGood};
  if (form == SoakForm::kShort) return flat;
  flat.limit = fmt::format("< {:.0f} KiB/min", limits.rss_KiB_per_min);
  if (slope.blocks < 4 || slope.per_min + slope.half_width_per_min >= limits.rss_KiB_per_min)
    flat.verdict = Verdict::kBad;
  return flat;
}

std::vector<Finding> judge(const SoakData& data, const SoakOptions& options, const SoakMinutes& minutes,
                           const SoakLimits& limits) {
  std::vector<Finding> findings;
  const double from_s = options.warmUp_s();
  const auto times = column(data.rows, from_s, [](const SoakRow& row) { return row.time_s; });
  for (std::size_t which = 0; which < kSoakProcesses; ++which) {
    const std::string name = kSoakNames[which];
    const auto rss =
        column(data.rows, from_s, [which](const SoakRow& row) { return row.processes[which].rss_KiB; });
    findings.push_back(flatMemory("memory of the " + name, times, rss, options.form(), limits));
    if (!rss.empty())
      findings.push_back(
          {"memory of the " + name + " at the end", fmt::format("{:.1f} MiB", rss.back() / 1024), "", {}});
  }
  for (std::size_t which = 0; which < kSoakProcesses; ++which)
    for (const bool handles : {true, false}) {
      const auto counts = column(data.rows, from_s, [&](const SoakRow& row) {
        return handles ? row.processes[which].handles : row.processes[which].threads;
      });
      if (counts.empty()) continue;
      // programs open files briefly; only lasting growth counts: compare the minima of the first and the last
      // third
      const auto third = static_cast<std::ptrdiff_t>(std::max<std::size_t>(1, counts.size() / 3));
      const double before = *std::min_element(counts.begin(), counts.begin() + third);
      const double after = *std::min_element(counts.end() - third, counts.end());
      findings.push_back({std::string(handles ? "handles" : "threads") + " of the " + kSoakNames[which],
                          fmt::format("{:.0f} at first, {:.0f} at last, {:.0f} at most", before, after,
                                      *std::max_element(counts.begin(), counts.end())),
                          "constant", after <= before ? Verdict::kGood : Verdict::kBad});
    }
  std::uint64_t database = 0;
  for (const SoakRow& row : data.rows) database = std::max(database, row.processes[kServer].database_handles);
  findings.push_back({"handles of the server's database", fmt::format("{} at most", database),
                      fmt::format("<= {}", limits.database_handles),
                      database <= limits.database_handles ? Verdict::kGood : Verdict::kBad});

  const auto number = [&](const char* key) {
    const auto at = data.summary.find(key);
    return at != data.summary.end() && at->is_number() ? at->get<std::uint64_t>() : UINT64_MAX;
  };
  findings.push_back(equal("samples lost at the station", number("samples_lost"), 0));
  findings.push_back(equal("samples in the server's database", data.stored_samples, number("samples")));
  findings.push_back(equal("samples and missed ticks together", number("samples") + number("missed_ticks"),
                           number("ticks")));
  findings.push_back(equal("chunks left in the spool", number("spool_left"), 0));
  findings.push_back(
      {"the session in the database", data.stored_state + (data.verified ? ", verified" : ", NOT VERIFIED"),
       "SESSION_COMPLETE, verified",
       data.verified && data.stored_state == "SESSION_COMPLETE" ? Verdict::kGood : Verdict::kBad});
  findings.push_back(
      equal("exit codes of station, viewer, server together",
            static_cast<std::uint64_t>(std::abs(data.station_code) + std::abs(data.viewer_code) +
                                       std::abs(data.server_code)),
            0));
  findings.push_back(equal("connections that the uplink made", number("connections"), 1));
  for (const std::string& trouble : data.troubles)
    findings.push_back({"reported trouble", trouble, "none", Verdict::kBad});

  // reported only: they depend on other programs on the machine
  const double ticks = std::max(1.0, static_cast<double>(number("ticks")));
  findings.push_back({"ticks missed",
                      fmt::format("{} of {:.0f} ({:.4f} %)", number("missed_ticks"), ticks,
                                  100 * static_cast<double>(number("missed_ticks")) / ticks),
                      "",
                      {}});
  const auto micro = [&](const char* key) {
    const auto at = data.summary.find(key);
    return at != data.summary.end() && at->is_number() ? at->get<double>()
                                                       : std::numeric_limits<double>::quiet_NaN();
  };
  findings.push_back({"wake-up late by, p50 / p99 / most",
                      fmt::format("{:.0f} / {:.0f} / {:.0f} µs", micro("wakeup_p50_us"),
                                  micro("wakeup_p99_us"), micro("wakeup_max_us")),
                      "",
                      {}});
  double worst_tick = 0, worst_live = 0;
  for (const SoakMinute& minute : minutes) {
    worst_tick = std::max(worst_tick, minute.tick_p99_us);
    worst_live = std::max(worst_live, minute.live_p99_ms);
  }
  findings.push_back(
      {"work of a tick, p99 of the worst minute", fmt::format("{:.1f} µs", worst_tick), "", {}});
  findings.push_back(
      {"capture to viewer, p99 of the worst minute", fmt::format("{:.1f} ms", worst_live), "", {}});
  findings.push_back(
      {"bytes a sample in the spool", fmt::format("{:.2f}", micro("bytes_per_sample")), "", {}});
  return findings;
}

Verdict verdictOf(const std::vector<Finding>& findings) {
  Verdict worst = Verdict::kGood;
  for (const Finding& finding : findings) worst = std::max(worst, finding.verdict);
  return worst;
}

const char* verdictText(Verdict verdict) {
  switch (verdict) {
    case Verdict::kGood:
      return "good";
    case Verdict::kBad:
      return "BAD";
  }
  return "?";
}

std::string tableText(const std::vector<Finding>& findings, SoakForm form) {
  std::size_t what = 0, value = 0, limit = 0;
  for (const Finding& finding : findings) {
    what = std::max(what, finding.what.size());
    value = std::max(value, finding.value.size());
    limit = std::max(limit, finding.limit.size());
  }
  std::string text;
  for (const Finding& finding : findings) {
    text += finding.what + std::string(what - finding.what.size() + 2, ' ') + finding.value +
            std::string(value - finding.value.size() + 2, ' ') + finding.limit +
            std::string(limit - finding.limit.size() + 2, ' ') +
            (finding.limit.empty() ? "" : verdictText(finding.verdict));
    text.erase(text.find_last_not_of(' ') + 1);
    text += "\n";
  }
  return text + formText(form) + ": " + verdictText(verdictOf(findings)) + "\n";
}

Status writeReport(const SoakData& data, const SoakOptions& options, const SoakMinutes& minutes,
                   const std::vector<Finding>& findings) {
  const std::string table = machineText() + "\n" + tableText(findings, options.form());
  for (const auto& [name, text] : {std::pair<const char*, std::string>{"samples.csv", samplesCsv(data)},
                                   {"minutes.csv", minutesCsv(minutes)},
                                   {"table.txt", table}})
    RETURN_IF_ERROR(writeFileAtomically(options.out / name, viewOf(text)));
  return {};
}

}  // namespace needlelab::test
