#include "tests/load/load_report.h"

#include "common/base/program.h"
#include "common/base/text.h"

namespace needlelab::test {
namespace {

using Json = nlohmann::ordered_json;

double ms(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-6;
}

unsigned long long n(std::uint64_t value) {
  return value;
}

}  // namespace

Json loadJson(const LoadResult& r) {
  const LatencyQuantiles live = r.viewers.live.quantiles(), ack = r.stations.ack.quantiles(),
                         late = r.stations.late.quantiles();
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
      // beyond DESIGN §9
      {"different", d.different},
      {"foreign", d.foreign},
      {"samples_made", r.samples_made},
      {"sessions_closed", r.stations_closed},
      {"sessions_not_complete", r.stored.not_complete},
      {"sessions_stray", r.stored.stray},
      {"live_p999_ms", ms(live.p999_ns)},
      {"live_max_ms", ms(live.max_ns)},
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
      {"connect_s", r.connect_s},
      {"drain_s", r.drain_s},
      {"check_s", r.check_s},
      {"server_rss_kib", r.server_rss_KiB},
      {"server_handles", r.server_handles},
      {"database_bytes", r.database_bytes},
      {"database_disk", r.database_disk},
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
  text += formatted("stations %zu, viewers %zu, %.1f s, seed %llu\n", r.options.stations, r.options.viewers,
                    r.streamed_s, n(r.options.seed));
  text += formatted(
      "samples   made %llu, acknowledged %llu, stored %llu; lost %llu, duplicated %llu, "
      "different %llu, foreign %llu\n",
      n(r.samples_made), n(r.stations.samples_acked), n(d.stored), n(d.lost), n(d.duplicated), n(d.different),
      n(d.foreign));
  text += formatted("sessions  closed %llu, not complete %llu, stray %llu\n", n(r.stations_closed),
                    n(r.stored.not_complete), n(r.stored.stray));
  text += formatted(
      "live      p50 %.1f ms, p99 %.1f ms, p99.9 %.1f ms, max %.1f ms; %llu frames, %llu not seen\n",
      ms(live.p50_ns), ms(live.p99_ns), ms(live.p999_ns), ms(live.max_ns), n(r.stations.live_frames),
      n(r.stations.live_frames - std::min(r.stations.live_frames, r.viewers.frames)));
  text += formatted("ack       p50 %.1f ms, p99 %.1f ms, max %.1f ms\n", ms(ack.p50_ns), ms(ack.p99_ns),
                    ms(ack.max_ns));
  text +=
      formatted("generator late p50 %.1f ms, p99 %.1f ms, max %.1f ms%s\n", ms(late.p50_ns), ms(late.p99_ns),
                ms(late.max_ns),
                late.p99_ns > 10'000'000 ? ": IT DID NOT KEEP UP, the latencies hold its own lateness" : "");
  const double span = r.streamed_s > 0 ? r.streamed_s : 1;
  text += formatted("CPU       server %.2f s (%.2f cores), generator %.2f s (%.2f cores)\n", r.server_cpu_s,
                    r.server_cpu_s / span, r.generator_cpu_s, r.generator_cpu_s / span);
  text +=
      formatted("memory    server %.1f MiB, %llu handles; database %.1f MB, %.2f bytes a sample\n",
                static_cast<double>(r.server_rss_KiB) / 1024, n(r.server_handles),
                static_cast<double>(r.database_bytes) * 1e-6,
                d.stored > 0 ? static_cast<double>(r.stored.chunk_bytes) / static_cast<double>(d.stored) : 0);
  if (r.cuts + r.kills + r.pauses > 0)
    text += formatted(
        "faults    %llu cuts, %llu kill -9 of the server, %llu slow viewers; %llu chunks sent again\n",
        n(r.cuts), n(r.kills), n(r.pauses), n(r.stations.chunks_resent));
  for (const std::string& fault : r.stored.faults) text += "FAULT     " + fault + "\n";
  for (const std::string& trouble : r.troubles) text += "TROUBLE   " + trouble + "\n";
  return text + (r.good() ? "verdict: good\n" : "verdict: BAD\n");
}

}  // namespace needlelab::test
