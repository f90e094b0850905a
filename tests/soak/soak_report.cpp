#include "tests/soak/soak_report.h"

#include <algorithm>
#include <cmath>

#include "client/sim/tools/gnuplot.h"
#include "common/base/files.h"
#include "common/base/program.h"
#include "common/base/text.h"

namespace needlelab::test {
namespace {

std::string samplesCsv(const SoakData& data) {
  std::string text = "time_s";
  for (const char* name : kSoakNames)
    for (const char* what : {"rss_kib", "anon_kib", "handles", "threads", "cpu_s"})
      text += std::string(",") + name + "_" + what;
  text += ",spool_bytes,data_bytes,samples,missed_ticks,spool_left,wakeup_p99_us,request_ms\n";
  const auto count = [](std::uint64_t n) { return "," + std::to_string(n); };
  for (const SoakRow& row : data.rows) {
    text += formatted("%.3f", row.time_s);
    for (const ProcessSample& p : row.processes)
      text += count(p.rss_KiB) + count(p.anon_KiB) + count(p.handles) + count(p.threads) +
              formatted(",%.2f", p.cpu_s);
    text += count(row.spool_bytes) + count(row.data_bytes) + count(row.samples) + count(row.missed_ticks) +
            count(row.spool_left) + count(row.wakeup_p99_us) + formatted(",%.3f\n", row.request_ms);
  }
  return text;
}

std::string minutesCsv(const SoakMinutes& minutes) {
  std::string text = "end_s,samples,missed_ticks,tick_p99_us,wakeup_p99_us,request_p99_ms,live_p99_ms\n";
  for (const SoakMinute& m : minutes)
    text +=
        formatted("%.3f,%llu,%llu,%.2f,%.0f,%.3f,%.3f\n", m.end_s, static_cast<unsigned long long>(m.samples),
                  static_cast<unsigned long long>(m.missed_ticks), m.tick_p99_us, m.wakeup_p99_us,
                  m.request_p99_ms, m.live_p99_ms);
  return text;
}

std::string durationWords(double seconds) {
  return seconds >= 120 ? formatted("%.0f minutes", seconds / 60) : formatted("%.0f seconds", seconds);
}

std::string script(const SoakData& data, const SoakOptions& options, const std::vector<Finding>& findings) {
  const Verdict verdict = verdictOf(findings);
  const std::string samples = "'" + (options.out / "samples.csv").string() + "'";
  const std::string minutes = "'" + (options.out / "minutes.csv").string() + "'";
  const std::string title = durationWords(options.seconds) +
                            formatted(" at %g Hz with recording, uplink and a viewer: ", options.rate_hz) +
                            (verdict == Verdict::kGood   ? "memory stays flat, nothing is lost"
                             : verdict == Verdict::kOpen ? "nothing is lost; too short to tell of memory"
                                                         : "NOT as it should be, see the table");
  // growth since the warm-up's end: the processes' own sizes differ too much for one axis
  const auto start = std::find_if(data.rows.begin(), data.rows.end(),
                                  [&](const SoakRow& row) { return row.time_s >= options.warmUp_s(); });
  const SoakRow base = start == data.rows.end() ? data.rows.back() : *start;
  std::string text =
      "set datafile separator ','\nset grid lc rgb '#d8dde3'\nset border 3 lc rgb '#606a75'\n"
      "set tics nomirror\nset lmargin 13\nset rmargin 32\nset key outside right top samplen 2\n"
      "set multiplot layout 3,1 title \"" +
      title + "\" font ',14'\n" + formatted("set xrange [0:%g]\n", options.seconds / 60) +
      "set ylabel \"memory since the\\nwarm-up [KiB]\"\n" +
      formatted("set arrow 1 from first %g, graph 0 to first %g, graph 1 nohead dt 3 lc rgb '#606a75'\n",
                options.warmUp_s() / 60, options.warmUp_s() / 60) +
      formatted("set label 1 'judged from here' at first %g, graph 0.08 offset 0.5,0 tc rgb '#606a75'\n",
                options.warmUp_s() / 60);
  constexpr std::array<const char*, kSoakProcesses> kColours = {"#0072b2", "#d55e00", "#009e73"};
  constexpr std::array<int, kSoakProcesses> kDashes = {1, 2, 4};
  text += "plot ";
  for (std::size_t which = 0; which < kSoakProcesses; ++which)
    text += formatted(
        "%s%s skip 1 using ($1/60):($%zu-%llu) with lines lw 2 dt %d lc rgb '%s' title '%s (%.0f MiB)'",
        which == 0 ? "" : ", ", samples.c_str(), 2 + 5 * which,
        static_cast<unsigned long long>(base.processes[which].rss_KiB), kDashes[which], kColours[which],
        kSoakNames[which], static_cast<double>(base.processes[which].rss_KiB) / 1024);
  text +=
      "\nunset arrow 1\nunset label 1\nset ylabel 'p99 of each minute'\nset logscale y\n"
      "plot " +
      minutes +
      " skip 1 using ($1/60):($4/1000) with linespoints lw 2 pt 7 ps 0.5 lc rgb '#d55e00' title 'work of a "
      "tick [ms]', '' skip 1 using "
      "($1/60):6 with linespoints lw 2 dt 2 pt 5 ps 0.5 lc rgb '#0072b2' title 'answer of the server [ms]', "
      "'' skip 1 using "
      "($1/60):7 with linespoints lw 2 dt 4 pt 9 ps 0.5 lc rgb '#009e73' title 'capture to viewer [ms]'\n"
      "unset logscale y\nset xlabel 'time [min]'\nset ylabel \"missed ticks\\na minute\"\nset yrange "
      "[0:*]\nset y2label 'spool [MB]'\nset y2range [0:*]\n"
      "set border 11\nset y2tics\nset rmargin 32\n"
      "plot " +
      minutes + formatted(" skip 1 using (($1-%g)/60):3", options.minute_s() / 2) +
      " with impulses lw 3 lc rgb '#cc79a7' title 'missed ticks (left)', " + samples +
      " skip 1 using ($1/60):($17/1e6) axes x1y2 with lines lw 2 lc rgb '#56b4e9' title 'spool "
      "(right)'\nunset multiplot\n";
  return text;
}

}  // namespace

std::string tableText(const std::vector<Finding>& findings) {
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
  return text + "verdict: " + verdictText(verdictOf(findings)) + "\n";
}

Status writeReport(const SoakData& data, const SoakOptions& options, const SoakMinutes& minutes,
                   const std::vector<Finding>& findings) {
  const std::string table = machineText() + "\n" + tableText(findings);
  for (const auto& [name, text] : {std::pair<const char*, std::string>{"samples.csv", samplesCsv(data)},
                                   {"minutes.csv", minutesCsv(minutes)},
                                   {"table.txt", table}})
    if (Status status = writeFileAtomically(options.out / name, viewOf(text)); !status.ok()) return status;
  if (!hasGnuplot() || data.rows.empty()) return {};
  return plotPng(script(data, options, findings), options.out / "soak.png", 1200, 950);
}

}  // namespace needlelab::test
