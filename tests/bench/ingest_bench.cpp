/// The store's ingest rate compared with raw SQLite (goal: at least 70 % of raw SQLite with the same rows,
/// the same groups and synchronous=FULL): the writer thread with SessionStore::append (checks, counters, one
/// savepoint per chunk) and a bare loop of INSERTs, in turns, each with its own database on the same disk.
#include <fmt/core.h>
#include <sqlite3.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

#include "common/base/files.h"
#include "common/base/program.h"
#include "common/gesture/chunk.h"
#include "db/credentials.h"
#include "db/db_writer.h"
#include "db/schema.h"
#include "db/session_rows.h"
#include "db/session_store.h"
#include "tests/bench/result_folder.h"
#include "tests/unit/common/gesture/gesture_samples.h"
#include "tests/unit/common/gesture/recorded_gestures.h"

namespace needlelab::test {
namespace {

using Clock = std::chrono::steady_clock;

struct Settings {
  std::filesystem::path folder = std::filesystem::current_path();  ///< databases go here: a real disk
  std::filesystem::path results;
  std::string commit;
  std::size_t rounds = 12, groups = 20;
  std::size_t sessions = 1000, profile_bytes = 4000;
};

[[noreturn]] void die(const std::string& text) {
  std::fprintf(stderr, "ingest_bench: %s\n", text.c_str());
  std::_Exit(1);
}
void must(const Status& status) {
  if (!status.ok()) die(status.error().message);
}
template <typename T>
T must(Result<T> result) {
  if (!result.ok()) die(result.error().message);
  return std::move(*result);
}

/// Chunks of a second at 1 kHz with jittering clocks; from the recorded hands if available.
struct Material {
  std::vector<Bytes> chunks;
  std::string source = "a made-up gesture";
  Material() {
    std::mt19937_64 random(7);
    const auto cut = [&](std::vector<GestureSample> samples) {
      for (GestureSample& s : samples) {
        s.time_ns += static_cast<std::int64_t>(random() % 20'000);
        s.device_ns = static_cast<std::int32_t>(8'000 + random() % 4'000);
        s.engine_ns = static_cast<std::int32_t>(30 + random() % 400);
      }
      for (std::size_t at = 0; at + 1000 <= samples.size(); at += 1000)
        chunks.push_back(encodeChunk(Resolution::standard(), std::span(samples).subspan(at, 1000)));
    };
    for (const auto& gesture : test::recordedGestures({test::realRecordingsFolder(), true}))
      cut(gesture.samples);
    if (!chunks.empty())
      source = "the four recordings";
    else
      cut(smoothGesture(60'000));
  }
};

struct Row {
  std::size_t session = 0;
  std::uint64_t seq = 0;
  const Bytes* bytes = nullptr;
};

/// One database with all sessions open.
struct Database {
  std::filesystem::path path;
  std::vector<Uuid> ids;
  explicit Database(const Settings& settings, const std::string& name) : path(settings.folder / name) {
    remove();
    Connection writer = must(Connection::open(path, {.mode = Connection::Mode::kWriter, .create = true}));
    must(migrate(writer));
    must(writer.script("BEGIN"));
    must(StationStore(writer).add("station-1", StationKeyBytes{}, 1));
    for (std::size_t i = 0; i < settings.sessions; ++i) {
      ids.push_back(makeUuidV7());
      pb::SessionDescription d;
      d.set_session_id(std::string(ids.back().begin(), ids.back().end()));
      d.set_station("station-1");
      d.set_trainee("anna");
      d.set_exercise_id("knee-1");
      d.set_profile_id("knee-adult");
      d.set_profile_json("{\"text\":\"" + std::string(settings.profile_bytes, 'x') + "\"}");
      d.set_engine_version("bench");
      d.set_rate_hz(1000);
      d.set_started_unix_ns(1'700'000'000'000'000'000);
      d.mutable_resolution()->set_length_m(1e-6);
      must(SessionStore(writer).open(d, 1));
    }
    must(writer.script("COMMIT"));
    must(writer.checkpointPassive());
  }
  ~Database() { remove(); }
  void remove() const {
    for (const char* suffix : {"", "-wal", "-shm"}) {
      std::error_code ignored;
      std::filesystem::remove(path.string() + suffix, ignored);
    }
  }
};

/// The store, as in the server, with the queue kept full so that each group has exactly `group` chunks.
class Ours {
 public:
  Ours(const Settings& settings, std::size_t group)
      : database_(settings, "ingest-ours.db"),
        group_(group),
        writer_(must(Connection::open(database_.path, {.mode = Connection::Mode::kWriter})),
                {.window = std::chrono::seconds(10), .max_items = 4 * group, .max_group = group},
                [](const Error& error) { die(error.message); }) {}
  double run(const std::vector<Row>& rows) {
    const auto begin = Clock::now();
    for (const Row& row : rows) {
      {
        std::unique_lock lock(mutex_);
        room_.wait(lock, [&] { return under_way_ < 3 * group_; });
        ++under_way_;
      }
      must(writer_.post(
          [&row, id = database_.ids[row.session]](Connection& connection) -> Status {
            auto appended = SessionStore(connection).append(id, row.seq, *row.bytes, "station-1");
            if (!appended.ok()) return appended.error();
            if (appended->kind != Appended::Kind::kStored) die(appended->text);
            return {};
          },
          [this](const Status& status) {
            must(status);
            const std::lock_guard lock(mutex_);
            if (--under_way_ <= 2 * group_) room_.notify_one();
          }));
    }
    std::unique_lock lock(mutex_);
    room_.wait(lock, [&] { return under_way_ == 0; });
    return std::chrono::duration<double>(Clock::now() - begin).count();
  }
  [[nodiscard]] DbWriter::Counters counters() const { return writer_.counters(); }

 private:
  Database database_;
  std::size_t group_;
  std::mutex mutex_;
  std::condition_variable room_;
  std::size_t under_way_ = 0;
  DbWriter writer_;
};

/// SQLite alone: one prepared INSERT of the same rows into the same table, with the same durability and
/// memory settings and the same number of checkpoints; no checks, no counters, no foreign keys.
class Raw {
 public:
  Raw(const Settings& settings, std::size_t group) : database_(settings, "ingest-raw.db"), group_(group) {
    ok(sqlite3_open_v2(database_.path.c_str(), &db_, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX, nullptr));
    exec(
        "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA wal_autocheckpoint=0; PRAGMA "
        "foreign_keys=OFF; PRAGMA cache_size=-16384");
    ok(sqlite3_prepare_v2(db_, "INSERT INTO chunks (session, seq, samples, crc, bytes) VALUES (?,?,?,?,?)",
                          -1, &insert_, nullptr));
  }
  ~Raw() {
    sqlite3_finalize(insert_);
    sqlite3_close(db_);
  }
  Raw(const Raw&) = delete;
  Raw& operator=(const Raw&) = delete;
  double run(const std::vector<Row>& rows) {
    const auto begin = Clock::now();
    for (std::size_t at = 0; at < rows.size(); at += group_) {
      exec("BEGIN IMMEDIATE");
      for (std::size_t i = at; i < std::min(rows.size(), at + group_); ++i) {
        const Row& row = rows[i];
        sqlite3_bind_int64(insert_, 1, static_cast<sqlite3_int64>(row.session + 1));
        sqlite3_bind_int64(insert_, 2, static_cast<sqlite3_int64>(row.seq));
        sqlite3_bind_int64(insert_, 3, 1000);
        sqlite3_bind_int64(insert_, 4, stationCrcOf(*row.bytes));
        sqlite3_bind_blob64(insert_, 5, row.bytes->data(), row.bytes->size(), SQLITE_STATIC);
        if (sqlite3_step(insert_) != SQLITE_DONE) die(sqlite3_errmsg(db_));
        sqlite3_reset(insert_);
      }
      exec("COMMIT");
      if (const auto now = Clock::now(); now - checkpointed_ >= std::chrono::milliseconds(100)) {
        checkpointed_ = now;
        ok(sqlite3_wal_checkpoint_v2(db_, nullptr, SQLITE_CHECKPOINT_PASSIVE, nullptr, nullptr));
      }
    }
    return std::chrono::duration<double>(Clock::now() - begin).count();
  }

 private:
  void ok(int rc) {
    if (rc != SQLITE_OK) die(sqlite3_errmsg(db_));
  }
  void exec(const char* sql) { ok(sqlite3_exec(db_, sql, nullptr, nullptr, nullptr)); }

  Database database_;
  std::size_t group_;
  sqlite3* db_ = nullptr;
  sqlite3_stmt* insert_ = nullptr;
  Clock::time_point checkpointed_ = Clock::now();
};

double quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  const double at = q * static_cast<double>(values.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const std::size_t high = std::min(low + 1, values.size() - 1);
  return values[low] + (at - static_cast<double>(low)) * (values[high] - values[low]);
}

constexpr double kGoal = 0.7;

/// Prints a line of the table; sets `met` to false when the goal was missed.
std::string measure(const Settings& settings, const Material& material, std::size_t group, bool& met) {
  Ours ours(settings, group);
  Raw raw(settings, group);
  std::vector<std::uint64_t> next(settings.sessions, 0);
  std::size_t session = 0, chunk = 0;
  std::vector<double> our_rate, raw_rate, ratio;
  double bytes_per_row = 0;
  // the first round warms both up and is not counted
  for (std::size_t round = 0; round <= settings.rounds; ++round) {
    std::vector<Row> rows;
    double bytes = 0;
    for (std::size_t i = 0; i < group * settings.groups; ++i) {
      const Bytes& data = material.chunks[chunk++ % material.chunks.size()];
      rows.push_back({session, next[session]++, &data});
      bytes += static_cast<double>(data.size());
      session = (session + 1) % settings.sessions;
    }
    bytes_per_row = bytes / static_cast<double>(rows.size());
    double our_s = 0, raw_s = 0;
    if (round % 2 == 0) our_s = ours.run(rows);
    raw_s = raw.run(rows);
    if (round % 2 == 1) our_s = ours.run(rows);
    if (round == 0) continue;
    const auto count = static_cast<double>(rows.size());
    our_rate.push_back(count / our_s);
    raw_rate.push_back(count / raw_s);
    ratio.push_back(raw_s / our_s);
    std::fprintf(stderr, "\rgroups of %zu: round %zu of %zu  ", group, round, settings.rounds);
  }
  std::fprintf(stderr, "\r%50s\r", "");
  const double median = quantile(ratio, 0.5);
  const bool here = median >= kGoal;
  met = met && here;
  const auto counters = ours.counters();
  std::printf(
      "groups of %4zu: ours %6.0f rows/s (%.1f MB/s), raw %6.0f rows/s (%.1f MB/s), ratio %.3f (quartiles "
      "%.3f-%.3f, all %.3f-%.3f) %s; "
      "%.1f items a commit, COMMIT p50 %.2f ms, work p50 %.2f ms\n",
      group, quantile(our_rate, 0.5), quantile(our_rate, 0.5) * bytes_per_row * 1e-6, quantile(raw_rate, 0.5),
      quantile(raw_rate, 0.5) * bytes_per_row * 1e-6, median, quantile(ratio, 0.25), quantile(ratio, 0.75),
      quantile(ratio, 0), quantile(ratio, 1), here ? "PASS" : "FAIL",
      static_cast<double>(counters.group_items.sum()) / static_cast<double>(counters.group_items.count()),
      counters.commit_ns.quantile(0.5) * 1e-6, counters.work_ns.quantile(0.5) * 1e-6);
  return fmt::format(
      "| {} | {:.0f} | {:.1f} | {:.0f} | {:.1f} | **{:.2f}** | {:.2f}–{:.2f} | {:.2f}–{:.2f} | {} |\n", group,
      quantile(our_rate, 0.5), quantile(our_rate, 0.5) * bytes_per_row * 1e-6, quantile(raw_rate, 0.5),
      quantile(raw_rate, 0.5) * bytes_per_row * 1e-6, median, quantile(ratio, 0.25), quantile(ratio, 0.75),
      quantile(ratio, 0), quantile(ratio, 1), here ? "PASS" : "**FAIL**");
}

int run(const Settings& settings) {
  const Material material;
  double bytes = 0;
  for (const Bytes& chunk : material.chunks) bytes += static_cast<double>(chunk.size());
  std::ostringstream text;
  text << "# What the store takes in\n\n"
       << machineText() << "; " << nowText() << (settings.commit.empty() ? "" : "; commit " + settings.commit)
       << ".\n\n"
       << "Written by `cmake --build build/release --target record_ingest_bench`. Rows are chunks of 1000 "
          "samples of "
       << material.source
       << fmt::format(" ({:.0f} bytes each on average) over {} open sessions with a profile of {} bytes. ",
                      bytes / static_cast<double>(material.chunks.size()), settings.sessions,
                      settings.profile_bytes)
       << "Ours: DbWriter and SessionStore::append, which checks each chunk's CRC, seq and owner, keeps the "
          "session's counters and gives each chunk a "
          "savepoint. Raw: one prepared INSERT of the same rows, without checks, counters or foreign keys. "
          "Both: WAL, synchronous=FULL, a PASSIVE "
          "checkpoint every 100 ms, the same group in one transaction. "
       << fmt::format(
              "{} rounds of {} groups, in turns, the order swapped from round to round; rates are medians, "
              "the ratio is taken round by round. ",
              settings.rounds, settings.groups)
       << "A thousand stations send 1000 rows/s, which come in groups of about 35.\n\n"
       << "| group | ours rows/s | MB/s | raw rows/s | MB/s | ratio | quartiles | all rounds | goal ≥ 0.7 "
          "|\n|---:|---:|---:|---:|---:|---:|---|---|---|\n";
  bool met = true;
  for (const std::size_t group : {16, 32, 64, 256}) text << measure(settings, material, group, met);
  if (!settings.results.empty()) {
    const auto folder = settings.results / folderName(machineText());
    std::error_code ignored;
    std::filesystem::create_directories(folder, ignored);
    const std::string out = text.str();
    must(writeFileAtomically(folder / "ingest.md", viewOf(out)));
    std::printf("written: %s\n", (folder / "ingest.md").c_str());
  }
  return met ? 0 : 1;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) {
  needlelab::test::Settings settings;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    const auto number = static_cast<std::size_t>(std::strtoul(value.c_str(), nullptr, 10));
    if (name == "--folder")
      settings.folder = value;
    else if (name == "--results")
      settings.results = value;
    else if (name == "--commit")
      settings.commit = value;
    else if (name == "--rounds")
      settings.rounds = std::max<std::size_t>(1, number);
    else if (name == "--groups")
      settings.groups = std::max<std::size_t>(1, number);
    else if (name == "--sessions")
      settings.sessions = std::max<std::size_t>(1, number);
    else if (name == "--profile-bytes")
      settings.profile_bytes = number;
    else
      return std::fprintf(stderr, "ingest_bench: unknown option %s\n", name.c_str()), 2;
  }
  return needlelab::test::run(settings);
}
