/// The store's ingest rate compared with the engine's own (goal: at least 70 % of it with the same rows, the
/// same groups and the same durability), on SQLite, and where clusters are given on PostgreSQL, alone and
/// with a synchronous standby: the writer thread with the store's checks and counters, and bare INSERTs, in
/// turns, each with its own database on the same disk.
#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <span>
#include <sstream>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/gesture/chunk.h"
#include "tests/bench/ingest/ingest_stores.h"
#include "tests/bench/result_folder.h"
#include "tests/load/gesture_pool.h"

namespace needlelab::test {
namespace {

/// Chunks of a second at 1 kHz, as tests/load makes them: the first minute of each of four stations.
std::vector<Bytes> madeChunks() {
  constexpr std::uint64_t kSeed = 7;
  const GesturePool pool = mustIngest(makeGesturePool(kSeed, 24));
  std::vector<Bytes> chunks;
  std::vector<GestureSample> samples(1000);
  for (std::size_t station = 0; station < 4; ++station) {
    StationStream stream(pool, kSeed, station);
    for (std::uint64_t second = 0; second < 60; ++second) {
      stream.fill(1000 * second, samples);
      chunks.push_back(encodeChunk(Resolution::standard(), samples));
    }
  }
  return chunks;
}

double quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  const double at = q * static_cast<double>(values.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const std::size_t high = std::min(low + 1, values.size() - 1);
  return values[low] + (at - static_cast<double>(low)) * (values[high] - values[low]);
}

constexpr double kGoal = 0.7;

/// One engine, and what the store is compared with there.
struct Engine {
  std::string title, text, cluster;
  std::vector<std::string> raw_names;
  std::size_t judged = 1;  ///< the ratio is to the fastest of so many of them
};

std::unique_ptr<IngestContender> rawOf(const IngestSettings& settings, const Engine& engine,
                                       std::size_t group, std::size_t which) {
  if (engine.cluster.empty()) return ingestRawSqlite(settings, group);
  return ingestRawPostgres(settings, engine.cluster, group, static_cast<RawPostgresForm>(which));
}

/// Of this program, without PostgreSQL's own.
double processorSeconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

/// Returns a line of the table, and adds one to `remarks`; sets `met` to false when the goal was missed.
std::string measure(const IngestSettings& settings, const std::vector<Bytes>& material, const Engine& engine,
                    std::size_t group, std::string& remarks, bool& met) {
  std::vector<std::unique_ptr<IngestContender>> contenders;
  contenders.push_back(ingestOurs(settings, engine.cluster, group));
  for (std::size_t i = 0; i < engine.raw_names.size(); ++i)
    contenders.push_back(rawOf(settings, engine, group, i));
  std::vector<std::uint64_t> next(settings.sessions, 0);
  std::size_t session = 0, chunk = 0;
  std::vector<std::vector<double>> seconds(contenders.size());
  std::vector<double> processor_s(contenders.size());
  double count = 0, bytes_per_row = 0;
  // the first round warms all up and is not counted
  for (std::size_t round = 0; round <= settings.rounds; ++round) {
    IngestRows rows;
    double bytes = 0;
    for (std::size_t i = 0; i < group * settings.groups; ++i) {
      const Bytes& data = material[chunk++ % material.size()];
      rows.push_back({session, next[session]++, &data});
      bytes += static_cast<double>(data.size());
      session = (session + 1) % settings.sessions;
    }
    count = static_cast<double>(rows.size());
    bytes_per_row = bytes / count;
    for (std::size_t turn = 0; turn < contenders.size(); ++turn) {
      const std::size_t which = (turn + round) % contenders.size();
      const double before_s = processorSeconds();
      const double took = contenders[which]->run(rows);
      if (round == 0) continue;
      seconds[which].push_back(took);
      processor_s[which] += processorSeconds() - before_s;
    }
    std::fprintf(stderr, "\r%s, groups of %zu: round %zu of %zu  ", engine.title.c_str(), group, round,
                 settings.rounds);
  }
  std::fprintf(stderr, "\r%70s\r", "");

  std::vector<double> rates;
  for (const auto& of : seconds) rates.push_back(count / quantile(of, 0.5));
  const auto fastest = static_cast<std::size_t>(std::distance(
      rates.begin(),
      std::max_element(rates.begin() + 1, rates.begin() + 1 + static_cast<std::ptrdiff_t>(engine.judged))));
  std::vector<double> ratio;
  for (std::size_t i = 0; i < settings.rounds; ++i) ratio.push_back(seconds[fastest][i] / seconds[0][i]);
  const double median = quantile(ratio, 0.5);
  const bool here = median >= kGoal;
  met = met && here;
  std::string line = fmt::format("| {} |", group);
  for (const double rate : rates)
    line += fmt::format(" {:.0f} | {:.1f} |", rate, rate * bytes_per_row * 1e-6);
  line +=
      fmt::format(" **{:.2f}** | {:.2f}–{:.2f} | {:.2f}–{:.2f} | {} |\n", median, quantile(ratio, 0.25),
                  quantile(ratio, 0.75), quantile(ratio, 0), quantile(ratio, 1), here ? "PASS" : "**FAIL**");
  std::string remark = fmt::format("- Groups of {}: ours: {}", group, contenders.front()->remark());
  for (std::size_t i = 1; i < contenders.size(); ++i)
    remark += fmt::format("; {}: {}", engine.raw_names[i - 1], contenders[i]->remark());
  remarks += remark + ".\n";
  std::printf("%s: %s%s; processor time here, µs a row:", engine.title.c_str(), line.c_str(), remark.c_str());
  for (const double s : processor_s)
    std::printf(" %.1f", s * 1e6 / (count * static_cast<double>(settings.rounds)));
  std::printf("\n");
  std::fflush(stdout);
  return line;
}

std::string tableOf(const IngestSettings& settings, const std::vector<Bytes>& material, const Engine& engine,
                    bool& met) {
  std::string head = "| group | ours rows/s | MB/s |", rule = "|---:|---:|---:|";
  for (const std::string& name : engine.raw_names) {
    head += " " + name + " rows/s | MB/s |";
    rule += "---:|---:|";
  }
  std::string text = "## " + engine.title + "\n" + engine.text + "\n\n" + head +
                     " ratio | quartiles | all rounds | goal ≥ 0.7 |\n" + rule + "---:|---|---|---|\n";
  std::string remarks;
  for (const std::size_t group : {16, 32, 64, 256})
    text += measure(settings, material, engine, group, remarks, met);
  return text + "\nFrom one commit to the next, with the round that warms up:\n" + remarks + "\n";
}

std::vector<Engine> enginesOf(const IngestSettings& settings) {
  std::vector<Engine> engines = {
      {"SQLite",
       "Ours: each chunk in a savepoint. Raw: one prepared INSERT of the same rows, without foreign keys "
       "(SQLite's default). Both: WAL, "
       "synchronous=FULL, a PASSIVE checkpoint every 100 ms.",
       "",
       {"raw"}}};
  const auto add = [&](const std::string& title, const std::string& cluster, bool standby) {
    if (cluster.empty()) return;
    engines.push_back(
        {title,
         "Ours: BEGIN with the writer's lock and the group's chunks in one statement, then COMMIT: two round "
         "trips; chunks that wait are checked meanwhile. Pipeline: a prepared, binary INSERT … ON CONFLICT "
         "DO NOTHING a row, in libpq's pipeline "
         "mode. Arrays: one such INSERT of arrays. Both send BEGIN, rows and COMMIT together, and wait "
         "once. The ratio is to the faster of them. Without keys: arrays, with the foreign key to the "
         "session off. " +
             textOfCluster(cluster, standby) + ".",
         cluster,
         {"pipeline", "arrays", "without keys"},
         2});
  };
  add("PostgreSQL", settings.postgres, false);
  add("PostgreSQL with a synchronous standby on the same machine", settings.standby, true);
  return engines;
}

std::string loadText() {
  std::ifstream in("/proc/loadavg");
  std::string one, five;
  in >> one >> five;
  return "load " + one + " and " + five + " (1 and 5 min) at the beginning";
}

int run(const IngestSettings& settings) {
  const std::vector<Bytes> material = madeChunks();
  double bytes = 0;
  for (const Bytes& chunk : material) bytes += static_cast<double>(chunk.size());
  std::ostringstream text;
  text << "# What the store takes in\n\n"
       << machineText() << "; " << nowText() << (settings.commit.empty() ? "" : "; commit " + settings.commit)
       << "; " << loadText() << ".\n\n"
       << "Written by `cmake --build build/release --target record_ingest_bench`. Rows are chunks of 1000 "
          "samples of stations as tests/load has them"
       << fmt::format(" ({:.0f} bytes each on average) over {} open sessions with a profile of {} bytes. ",
                      bytes / static_cast<double>(material.size()), settings.sessions, settings.profile_bytes)
       << "Ours: DbWriter and SessionStore, which check each chunk's CRC, columns, seq and owner, and keep "
          "the "
          "session's counters. The others: the same rows into the same table, the same number in a "
          "transaction, without checks or counters. "
       << fmt::format(
              "{} rounds of {} groups, in turns, the order changed from round to round; rates are medians, "
              "the ratio is taken round by round. ",
              settings.rounds, settings.groups)
       << "A thousand stations send 1000 rows/s, which come in groups of about 35.\n\n";
  bool met = true;
  for (const Engine& engine : enginesOf(settings)) text << tableOf(settings, material, engine, met);
  if (!settings.results.empty()) {
    const auto folder = settings.results / folderName(machineText());
    std::error_code ignored;
    std::filesystem::create_directories(folder, ignored);
    std::string out = text.str();
    out.pop_back();
    mustIngest(writeFileAtomically(folder / "ingest.md", viewOf(out)));
    std::printf("written: %s\n", (folder / "ingest.md").c_str());
  }
  return met ? 0 : 1;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) {
  needlelab::test::IngestSettings settings;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    if (name == "--folder")
      settings.folder = value;
    else if (name == "--postgres")
      settings.postgres = value;
    else if (name == "--standby")
      settings.standby = value;
    else if (name == "--results")
      settings.results = value;
    else if (name == "--commit")
      settings.commit = value;
    else
      return std::fprintf(stderr, "ingest_bench: unknown option %s\n", name.c_str()), 2;
  }
  return needlelab::test::run(settings);
}
