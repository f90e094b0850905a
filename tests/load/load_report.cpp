#include "tests/load/load_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <thread>

#include "client/sim/tools/gnuplot.h"
#include "common/base/program.h"
#include "tests/bench/result_folder.h"

namespace needlelab::test {
namespace {

using Json = nlohmann::ordered_json;

double ms(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-6;
}

unsigned long long n(std::uint64_t value) {
  return value;
}

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
    text += fmt::format(
        "| {} | {} | {:.2f} | {:.2f} | {:.1f} | {:.1f} | {:.1f} | {:.1f} | {} | {:.1f} | {:.1f} | {:.1f} | "
        "{:.2f} | {} |\n",
        count(run, "stations"), count(run, "viewers"), cores(run, "server_cpu_s"),
        cores(run, "generator_cpu_s"), number(run, "server_rss_kib") / 1024, number(run, "live_p50_ms"),
        number(run, "live_p99_ms"), number(run, "live_max_ms"), count(run, "live_dropped_frames"),
        number(run, "ack_p99_ms"), number(run, "late_p99_ms"), number(run, "database_bytes") * 1e-6,
        number(run, "bytes_per_sample"), wrong(run));
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
  std::string text = fmt::format(
      "The server for {:.0f} s of a run of its own at the largest size, `perf record -e cpu-clock`, {} "
      "samples, {:.2f} cores.\n\n| work | share | cores |\n|---|---:|---:|\n",
      growth.profile_span_s, profile.samples, growth.profiled_s / span_s);
  for (const auto& [work, samples] : sorted(profile.work))
    text += fmt::format("| {} | {:.1f} % | {:.3f} |\n", work, 100 * static_cast<double>(samples) / all,
                        static_cast<double>(samples) / all * growth.profiled_s / span_s);
  text += "\n| thread | share | mostly |\n|---|---:|---|\n";
  for (const auto& [thread, work] : profile.threads) {
    const double mine = static_cast<double>(total(work));
    if (mine < 0.002 * all) continue;
    text += fmt::format("| {} | {:.1f} % | ", threadName(growth, thread), 100 * mine / all);
    const Shares shares = sorted(work);
    for (std::size_t i = 0; i < std::min<std::size_t>(3, shares.size()); ++i)
      text += fmt::format("{}{} {:.0f} %", i == 0 ? "" : ", ", shares[i].first,
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
  std::string text = fmt::format(
      "At {:.0f} stations the server takes {:.2f} of the machine's {} cores and the generator {:.2f}, which "
      "a real lab has elsewhere{}.\n",
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
      text += fmt::format(
          "The server's network is one thread, {:.0f} % busy at this size: by that alone it would be full at "
          "about {:.0f} stations, if the machine has cores to spare.\n",
          100 * busy, stations / busy);
  }
  return text;
}

// null: unknown, or SQLite
Json postgresCpu_s(const LoadResult& r) {
  return r.postgres && r.postgres->cpu_s ? Json(*r.postgres->cpu_s) : Json();
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

std::string cell(const std::optional<std::uint64_t>& value, double scale, int digits) {
  return value ? fmt::format("{:.{}f}", static_cast<double>(*value) * scale, digits) : "-";
}

// each process: its share, and what a second of one station costs there
std::string processesText(const LoadResult& r) {
  std::string text =
      fmt::format("{:<12}{:>8}{:>8}{:>9}{:>9}{:>9}{:>9}{:>9}{:>11}{:>11}\n", "process", "CPU s", "cores",
                  "us/st-s", "disk MB", "log MB", "sent MB", "rcvd MB", "msgs out", "msgs in");
  const double span_s = std::max(0.001, r.streamed_s), work = std::max(0.001, r.stationSeconds());
  for (const ProcessUse& use : r.processes) {
    const std::string cpu = use.cpu_s ? fmt::format("{:>8.2f}{:>8.2f}{:>9.0f}", *use.cpu_s,
                                                    *use.cpu_s / span_s, 1e6 * *use.cpu_s / work)
                                      : fmt::format("{:>8}{:>8}{:>9}", "-", "-", "-");
    text += fmt::format("{:<12}{}{:>9}{:>9}{:>9}{:>9}{:>11}{:>11}\n", use.name, cpu,
                        cell(use.disk_bytes, 1e-6, 1), cell(use.log_bytes, 1e-6, 1),
                        cell(use.sent_bytes, 1e-6, 1), cell(use.received_bytes, 1e-6, 1),
                        cell(use.messages_out, 1, 0), cell(use.messages_in, 1, 0));
  }
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
      // beside the fields that all results have
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
      {"postgres_cpu_s", postgresCpu_s(r)},
      {"postgres_log_bytes", r.postgres ? Json(r.postgres->log_bytes) : Json()},
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
      {"version", NEEDLELAB_VERSION},
      {"machine", machineText()},
      {"when", r.when},
  };
}

std::string loadText(const LoadResult& r) {
  const LatencyQuantiles live = r.viewers.live.quantiles(), ack = r.stations.ack.quantiles(),
                         late = r.stations.late.quantiles();
  const Difference& d = r.stored.samples;
  std::string text;
  text += fmt::format("stations {}, viewers {}, {:.1f} s, seed {}\n", r.options.stations, r.options.viewers,
                      r.streamed_s, n(r.options.seed));
  text += fmt::format(
      "samples   made {}, acknowledged {}, stored {}; lost {}, duplicated {}, different {}, foreign {}\n",
      n(r.samples_made), n(r.stations.samples_acked), n(d.stored), n(d.lost), n(d.duplicated), n(d.different),
      n(d.foreign));
  text += fmt::format("sessions  closed {}, not complete {}, stray {}\n", n(r.stations_closed),
                      n(r.stored.not_complete), n(r.stored.stray));
  text += fmt::format(
      "live      p50 {:.1f} ms, p99 {:.1f} ms, p99.9 {:.1f} ms, max {:.1f} ms; {} frames, {} not seen\n",
      ms(live.p50_ns), ms(live.p99_ns), ms(live.p999_ns), ms(live.max_ns), n(r.stations.live_frames),
      n(r.stations.live_frames - std::min(r.stations.live_frames, r.viewers.frames)));
  if (r.viewers.elsewhere.total() > 0) {
    const LatencyQuantiles elsewhere = r.viewers.elsewhere.quantiles();
    text += fmt::format("elsewhere p50 {:.1f} ms, p99 {:.1f} ms; {} frames of stations at another server\n",
                        ms(elsewhere.p50_ns), ms(elsewhere.p99_ns), n(r.viewers.elsewhere.total()));
  }
  text += fmt::format("ack       p50 {:.1f} ms, p99 {:.1f} ms, max {:.1f} ms\n", ms(ack.p50_ns),
                      ms(ack.p99_ns), ms(ack.max_ns));
  text += fmt::format(
      "generator late p50 {:.1f} ms, p99 {:.1f} ms, max {:.1f} ms{}\n", ms(late.p50_ns), ms(late.p99_ns),
      ms(late.max_ns),
      late.p99_ns > 10'000'000 ? ": IT DID NOT KEEP UP, the latencies hold its own lateness" : "");
  const double span = r.streamed_s > 0 ? r.streamed_s : 1;
  text += fmt::format("CPU       server {:.2f} s ({:.2f} cores), generator {:.2f} s ({:.2f} cores)\n",
                      r.server_cpu_s, r.server_cpu_s / span, r.generator_cpu_s, r.generator_cpu_s / span);
  text += fmt::format(
      "memory    server {:.1f} MiB, {} handles; database {:.1f} MB, {:.2f} bytes a sample\n",
      static_cast<double>(r.server_rss_KiB) / 1024, n(r.server_handles),
      static_cast<double>(r.database_bytes) * 1e-6,
      d.stored > 0 ? static_cast<double>(r.stored.chunk_bytes) / static_cast<double>(d.stored) : 0);
  if (r.postgres) {
    const double cpu_s = r.postgres->cpu_s.value_or(0);
    text += fmt::format("store     PostgreSQL {}; {:.1f} MB of log in the streaming\n",
                        r.postgres->cpu_s ? fmt::format("{:.2f} s ({:.2f} cores)", cpu_s, cpu_s / span)
                                          : "on another computer",
                        static_cast<double>(r.postgres->log_bytes) * 1e-6);
  }
  if (r.stations_at.size() > 1) {
    text += "servers  ";
    for (std::size_t i = 0; i < r.stations_at.size(); ++i)
      text += fmt::format("{} {} stations at {}", i == 0 ? "" : ",", r.stations_at[i],
                          i < r.options.servers.size() ? r.options.servers[i] : std::to_string(i + 1));
    text += "\n";
  }
  if (r.processes.size() > 2) text += processesText(r);
  if (r.cuts + r.kills + r.pauses > 0)
    text +=
        fmt::format("faults    {} cuts, {} kill -9 of the server, {} slow viewers; {} chunks sent again\n",
                    n(r.cuts), n(r.kills), n(r.pauses), n(r.stations.chunks_resent));
  for (const std::string& fault : r.stored.faults) text += "FAULT     " + fault + "\n";
  for (const std::string& trouble : r.troubles) text += "TROUBLE   " + trouble + "\n";
  return text + (r.good() ? "verdict: good\n" : "verdict: BAD\n");
}

std::vector<GrowthVerdict> judgeGrowth(const Growth& growth, const GrowthGoals& goals) {
  std::vector<GrowthVerdict> verdicts;
  const Json empty;
  const Json& most = growth.runs.empty() ? empty : growth.runs.back();
  const std::uint64_t stations = most.is_object() ? count(most, "stations") : 0;
  verdicts.push_back({stations >= goals.stations,
                      fmt::format("{} stations at 1 kHz over TLS, wanted {}", stations, goals.stations)});
  std::uint64_t bad = 0;
  bool good = !growth.runs.empty();
  for (const Json& run : growth.runs) {
    bad += wrong(run);
    good = good && run.value("good", false);
  }
  verdicts.push_back(
      {good && bad == 0,
       fmt::format("samples lost, doubled or different, over all sizes: {}, all sessions complete: {}", bad,
                   good ? "yes" : "no")});
  if (!most.is_object()) return verdicts;
  const double p99_ms = number(most, "live_p99_ms");
  verdicts.push_back({p99_ms < goals.live_p99_ms && count(most, "live_frames_seen") > 0,
                      fmt::format("capture to viewer p99 at {} stations: {:.1f} ms, below {:.0f} ms (the "
                                  "oldest sample of a frame, from when it was due)",
                                  stations, p99_ms, goals.live_p99_ms)});
  return verdicts;
}

std::string growthText(const Growth& growth) {
  const Json* last = growth.runs.empty() ? nullptr : &growth.runs.back();
  std::string text = "# Load, from one station to a thousand\n\n" + machineText() + "; " + nowText() +
                     "; commit " + growth.commit + "\n\n";
  if (last != nullptr)
    text += fmt::format(
        "`needlelab-load`, {:.0f} s each, on the same cores as its server; database on {}. Each station "
        "streams 1,000 samples a second over TLS and is watched at full rate by one of the viewers. "
        "Latencies count from when a sample was due (the frame's oldest; its 20 ms are in it). Every stored "
        "sample was compared with what was generated: \"wrong\" are those lost, doubled, different or "
        "strange.\n\n",
        number(*last, "seconds"), last->value("database_disk", "?"));
  text += sizesTable(growth) + "\n![growth](load.png)\n\n## Goals\n\n";
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
  const auto verdicts = judgeGrowth(growth);
  const bool met = std::all_of(verdicts.begin(), verdicts.end(), [](const auto& v) { return v.met; });
  const auto over = [&](auto get) {
    std::vector<double> values;
    for (const Json& run : growth.runs) values.push_back(get(run));
    return values;
  };
  const auto column = [&](const char* key) {
    return over([=](const Json& run) { return number(run, key); });
  };
  const auto busy = [&](const char* key) { return over([=](const Json& run) { return cores(run, key); }); };
  return drawPlot(
      embeddedLoadPlots(), "growth", png,
      {{"stations", column("stations")},
       {"server_cores", busy("server_cpu_s")},
       {"generator_cores", busy("generator_cpu_s")},
       {"live_p50_ms", column("live_p50_ms")},
       {"live_p99_ms", column("live_p99_ms")},
       {"server_mib", over([](const Json& run) { return number(run, "server_rss_kib") / 1024; })},
       {"database_mb_a_minute", over([](const Json& run) {
          return number(run, "database_bytes") * 1e-6 * 60 / std::max(0.001, number(run, "seconds"));
        })},
       {"most", growth.runs.empty() ? 1000 : number(growth.runs.back(), "stations")},
       {"goal_ms", GrowthGoals().live_p99_ms},
       {"shared_cores", static_cast<double>(std::thread::hardware_concurrency())},
       {"finding", met ? "nothing lost, viewers within 50 ms" : "NOT all goals met, see the table"}});
}

}  // namespace needlelab::test
