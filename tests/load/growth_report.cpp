#include "tests/load/growth_report.h"

#include <algorithm>
#include <thread>

#include "client/sim/tools/gnuplot.h"
#include "common/base/program.h"
#include "common/base/text.h"
#include "tests/bench/result_folder.h"

namespace needlelab::test {
namespace {

using Json = nlohmann::ordered_json;

double number(const Json& run, const char* key) {
  return run.value(key, 0.0);
}

std::uint64_t count(const Json& run, const char* key) {
  return run.value(key, std::uint64_t{0});
}

double cores(const Json& run, const char* key) {
  return number(run, key) / std::max(0.001, number(run, "streamed_s"));
}

std::uint64_t wrong(const Json& run) {
  return count(run, "lost") + count(run, "duplicated") + count(run, "different") + count(run, "foreign");
}

std::string sizesTable(const Growth& growth) {
  std::string text =
      "| stations | viewers | server cores | generator cores | server MiB | live p50 ms | live p99 ms | live "
      "max ms | frames not seen | ack p99 ms | generator late p99 ms | database MB | bytes/sample | wrong |\n"
      "|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n";
  for (const Json& run : growth.runs)
    text += formatted(
        "| %llu | %llu | %.2f | %.2f | %.1f | %.1f | %.1f | %.1f | %llu | %.1f | %.1f | %.1f | "
        "%.2f | %llu |\n",
        static_cast<unsigned long long>(count(run, "stations")),
        static_cast<unsigned long long>(count(run, "viewers")), cores(run, "server_cpu_s"),
        cores(run, "generator_cpu_s"), number(run, "server_rss_kib") / 1024, number(run, "live_p50_ms"),
        number(run, "live_p99_ms"), number(run, "live_max_ms"),
        static_cast<unsigned long long>(count(run, "live_dropped_frames")), number(run, "ack_p99_ms"),
        number(run, "late_p99_ms"), number(run, "database_bytes") * 1e-6, number(run, "bytes_per_sample"),
        static_cast<unsigned long long>(wrong(run)));
  return text;
}

using Shares = std::vector<std::pair<std::string, std::size_t>>;
Shares sorted(const std::map<std::string, std::size_t>& work) {
  Shares shares(work.begin(), work.end());
  std::sort(shares.begin(), shares.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  return shares;
}

std::size_t total(const std::map<std::string, std::size_t>& work) {
  std::size_t sum = 0;
  for (const auto& [name, samples] : work) sum += samples;
  return sum;
}

// the writer is the one that waits for the disk
std::string threadName(const Growth& growth, pid_t thread) {
  if (thread == growth.profiled_pid) return "network";
  const auto& work = growth.profile->threads.at(thread);
  const std::size_t store = (work.contains("SQLite") ? work.at("SQLite") : 0) +
                            (work.contains("kernel: fsync") ? work.at("kernel: fsync") : 0);
  return 4 * store > total(work) ? "database writer" : "worker";
}

std::string profileText(const Growth& growth) {
  if (!growth.profile || growth.profile->samples == 0) return "No profile: " + growth.why_no_profile + "\n";
  const Profile& profile = *growth.profile;
  const double span_s = std::max(0.001, growth.profile_span_s);
  const double all = static_cast<double>(profile.samples);
  std::string text = formatted(
      "The server for %.0f s of a run of its own at the largest size, `perf record -e cpu-clock`, %zu "
      "samples, %.2f cores.\n\n| work | share | cores |\n|---|---:|---:|\n",
      growth.profile_span_s, profile.samples, growth.profiled_s / span_s);
  for (const auto& [work, samples] : sorted(profile.work))
    text += formatted("| %s | %.1f %% | %.3f |\n", work.c_str(), 100 * static_cast<double>(samples) / all,
                      static_cast<double>(samples) / all * growth.profiled_s / span_s);
  text += "\n| thread | share | mostly |\n|---|---:|---|\n";
  for (const auto& [thread, work] : profile.threads) {
    const double mine = static_cast<double>(total(work));
    if (mine < 0.002 * all) continue;
    text += formatted("| %s | %.1f %% | ", threadName(growth, thread).c_str(), 100 * mine / all);
    const Shares shares = sorted(work);
    for (std::size_t i = 0; i < std::min<std::size_t>(3, shares.size()); ++i)
      text += formatted("%s%s %.0f %%", i == 0 ? "" : ", ", shares[i].first.c_str(),
                        100 * static_cast<double>(shares[i].second) / mine);
    text += " |\n";
  }
  return text;
}

std::string limitText(const Growth& growth) {
  if (growth.runs.empty()) return {};
  const Json& most = growth.runs.back();
  const double stations = number(most, "stations");
  const double server = cores(most, "server_cpu_s"), generator = cores(most, "generator_cpu_s");
  const unsigned machine = std::thread::hardware_concurrency();
  std::string text = formatted(
      "At %.0f stations the server takes %.2f of the machine's %u cores and the generator %.2f, which a real "
      "lab "
      "has elsewhere%s.\n",
      stations, server, machine, generator,
      server + generator > 0.85 * machine ? ": on this machine, with the generator on it, the cores are what "
                                            "limits next"
                                          : "");
  if (growth.profile && growth.profile->samples > 0) {
    const auto found = growth.profile->threads.find(growth.profiled_pid);
    const double share =
        found == growth.profile->threads.end()
            ? 0
            : static_cast<double>(total(found->second)) / static_cast<double>(growth.profile->samples);
    const double busy = share * growth.profiled_s / std::max(0.001, growth.profile_span_s);
    if (busy > 0)
      text += formatted(
          "The server's network is one thread, %.0f %% busy at this size: by that alone it would be full at "
          "about %.0f stations, if the machine has cores to spare.\n",
          100 * busy, stations / busy);
  }
  return text;
}

}  // namespace

std::vector<GrowthVerdict> judgeGrowth(const Growth& growth, const GrowthGoals& goals) {
  std::vector<GrowthVerdict> verdicts;
  const Json empty;
  const Json& most = growth.runs.empty() ? empty : growth.runs.back();
  const std::uint64_t stations = most.is_object() ? count(most, "stations") : 0;
  verdicts.push_back(
      {stations >= goals.stations, formatted("%llu stations at 1 kHz over TLS, wanted %zu",
                                             static_cast<unsigned long long>(stations), goals.stations)});
  std::uint64_t bad = 0;
  bool good = !growth.runs.empty();
  for (const Json& run : growth.runs) {
    bad += wrong(run);
    good = good && run.value("good", false);
  }
  verdicts.push_back(
      {good && bad == 0, formatted("samples lost, doubled or different, over all sizes: %llu, all sessions "
                                   "complete: %s",
                                   static_cast<unsigned long long>(bad), good ? "yes" : "no")});
  if (!most.is_object()) return verdicts;
  const double p99_ms = number(most, "live_p99_ms");
  verdicts.push_back(
      {p99_ms < goals.live_p99_ms && count(most, "live_frames_seen") > 0,
       formatted(
           "capture to viewer p99 at %llu stations: %.1f ms, below %.0f ms (the oldest sample of a frame, "
           "from when it was due)",
           static_cast<unsigned long long>(stations), p99_ms, goals.live_p99_ms)});
  return verdicts;
}

std::string growthText(const Growth& growth) {
  const Json* last = growth.runs.empty() ? nullptr : &growth.runs.back();
  std::string text = "# Load, from one station to a thousand\n\n" + machineText() + "; " + nowText() +
                     "; commit " + growth.commit + "\n\n";
  if (last != nullptr)
    text += formatted(
        "`needlelab-load`, %.0f s each, on the same cores as its server; database on %s. Each station "
        "streams "
        "1,000 samples a second over TLS and is watched at full rate by one of the viewers. Latencies count "
        "from when a sample was due (the frame's oldest; its 20 ms are in it). Every stored sample was "
        "compared with what was generated: \"wrong\" are those lost, doubled, different or strange.\n\n",
        number(*last, "seconds"), last->value("database_disk", "?").c_str());
  text += sizesTable(growth) + "\n![growth](load.png)\n\n## Goals of DESIGN §12\n\n";
  for (const GrowthVerdict& verdict : judgeGrowth(growth))
    text += std::string("- ") + (verdict.met ? "PASS" : "FAIL") + ": " + verdict.text + "\n";
  text += "\n## Where the time goes\n\n" + profileText(growth);
  text += "\n## What limits next\n\n" + limitText(growth);
  return text;
}

std::string growthJson(const Growth& growth) {
  Json json = {{"version", NEEDLELAB_VERSION},
               {"machine", machineText()},
               {"when", nowText()},
               {"commit", growth.commit}};
  for (const GrowthVerdict& verdict : judgeGrowth(growth))
    json["goals"].push_back({{"met", verdict.met}, {"text", verdict.text}});
  json["runs"] = growth.runs;
  if (growth.profile) {
    json["profile"] = {{"samples", growth.profile->samples},
                       {"span_s", growth.profile_span_s},
                       {"server_cpu_s", growth.profiled_s},
                       {"work", growth.profile->work}};
    for (const auto& [thread, work] : growth.profile->threads)
      json["profile"]["threads"].push_back({{"thread", threadName(growth, thread)}, {"work", work}});
  }
  return json.dump(1) + "\n";
}

Status drawGrowth(const Growth& growth, const std::filesystem::path& png) {
  std::string data = "$runs << EOD\n";
  for (const Json& run : growth.runs)
    data += formatted("%g %g %g %g %g %g %g\n", number(run, "stations"), cores(run, "server_cpu_s"),
                      cores(run, "generator_cpu_s"), number(run, "live_p50_ms"), number(run, "live_p99_ms"),
                      number(run, "server_rss_kib") / 1024,
                      number(run, "database_bytes") * 1e-6 * 60 / std::max(0.001, number(run, "seconds")));
  data += "EOD\n";
  const auto verdicts = judgeGrowth(growth);
  const bool met = std::all_of(verdicts.begin(), verdicts.end(), [](const auto& v) { return v.met; });
  const double most = growth.runs.empty() ? 1000 : number(growth.runs.back(), "stations");
  const std::string line = " with linespoints lw 2 ps 1.2 ";
  const std::string script =
      data +
      "set grid lc rgb '#d8dde3'\nset border 3 lc rgb '#606a75'\nset tics nomirror\n"
      "set xrange [0:" +
      formatted("%g", most * 1.05) + "]\nset xlabel 'stations'\n" +
      "set key top left Left reverse samplen 2\nset lmargin 11\nset rmargin 3\n"
      "set multiplot layout 2,2 title \"" +
      formatted("%g stations at 1 kHz over TLS on %u shared cores: ", most,
                std::thread::hardware_concurrency()) +
      (met ? "nothing lost, viewers within 50 ms" : "NOT all goals met, see the table") +
      "\" font ',14'\n"
      "set yrange [0:*]\nset ylabel 'processor [cores]'\n"
      "plot $runs using 1:2" +
      line + "pt 7 lc rgb '#0072b2' title 'server', $runs using 1:3" + line +
      "pt 5 lc rgb '#d55e00' title 'generator (stations and viewers)'\n"
      "set ylabel 'capture to viewer [ms]'\nset yrange [0:*<200]\nset key top left\n"
      "plot 50 with lines dt 2 lw 2 lc rgb '#606a75' title 'goal for p99', $runs using 1:5" +
      line + "pt 7 lc rgb '#d55e00' title 'p99', $runs using 1:4" + line +
      "pt 5 lc rgb '#0072b2' title 'p50'\n"
      "set key off\nset yrange [0:*]\nset ylabel 'memory of the server [MiB]'\n"
      "plot $runs using 1:6" +
      line + "pt 7 lc rgb '#0072b2'\n" + "set ylabel 'database [MB a minute]'\nplot $runs using 1:7" + line +
      "pt 7 lc rgb '#009e73'\nunset multiplot\n";
  return plotPng(script, png, 1300, 900);
}

}  // namespace needlelab::test
