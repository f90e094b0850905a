#include "tests/bench/ingest/ingest_stores.h"

#include <fmt/core.h>
#include <sqlite3.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <system_error>

#include "db/engine/open_postgres.h"
#include "db/login/credentials.h"
#include "db/sessions/db_writer.h"
#include "db/sessions/session_rows.h"
#include "db/sessions/session_store.h"
#include "db/store/schema.h"

namespace needlelab::test {
namespace {

using IngestClock = std::chrono::steady_clock;

double secondsSince(IngestClock::time_point begin) {
  return std::chrono::duration<double>(IngestClock::now() - begin).count();
}

/// A connection to a cluster's own database, for CREATE and DROP DATABASE.
Connection controlOf(const std::string& cluster) {
  return {mustIngest(openPostgres({.url = cluster + " dbname=postgres"})), "control"};
}

class OurIngest final : public IngestContender {
 public:
  OurIngest(const IngestSettings& settings, const std::string& cluster, std::size_t group)
      : database_(settings, cluster, "ingest_ours"),
        group_(group),
        writer_(mustIngest(openAt(database_.address(), Connection::Mode::kWriter)),
                {.window = std::chrono::seconds(10), .max_items = 4 * group, .max_group = group},
                [](const Error& error) { dieOfIngest(error.message); }) {}

  double run(const IngestRows& rows) override {
    std::vector<Appended> outcomes(rows.size());
    const auto begin = IngestClock::now();
    done_ = 0;
    times_.begin();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      {
        std::unique_lock lock(mutex_);
        room_.wait(lock, [&] { return under_way_ < 3 * group_; });
        ++under_way_;
      }
      Appended& outcome = outcomes[i];
      ArrivedChunk chunk{database_.id(rows[i].session), rows[i].seq, *rows[i].bytes, "station-1", &outcome};
      mustIngest(writer_.postChunk(std::move(chunk), [this, &outcome](const Status& status) {
        mustIngest(status);
        if (outcome.kind != Appended::Kind::kStored) dieOfIngest(outcome.text);
        const std::lock_guard lock(mutex_);
        if (++done_ % group_ == 0) times_.committed();
        if (--under_way_ <= 2 * group_) room_.notify_one();
      }));
    }
    std::unique_lock lock(mutex_);
    room_.wait(lock, [&] { return under_way_ == 0; });
    return secondsSince(begin);
  }

  [[nodiscard]] std::string remark() const override {
    const auto counters = writer_.counters();
    return fmt::format(
        "{} ({:.1f} chunks each, {:.0f} % stored together, {:.0f} % checked while the thread waited)",
        times_.text(),
        static_cast<double>(counters.group_items.sum()) / static_cast<double>(counters.group_items.count()),
        100 * static_cast<double>(counters.together) / static_cast<double>(counters.items),
        100 * static_cast<double>(counters.checked_ahead) / static_cast<double>(counters.items));
  }

 private:
  IngestDatabase database_;
  const std::size_t group_;
  std::mutex mutex_;
  std::condition_variable room_;
  std::size_t under_way_ = 0, done_ = 0;
  IngestTimes times_;  ///< the writer's thread, while rows are under way
  DbWriter writer_;
};

class RawSqlite final : public IngestContender {
 public:
  RawSqlite(const IngestSettings& settings, std::size_t group)
      : database_(settings, "", "ingest_raw"), group_(group) {
    ok(sqlite3_open_v2(database_.address().path.c_str(), &db_, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX,
                       nullptr));
    exec(
        "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA wal_autocheckpoint=0; PRAGMA "
        "foreign_keys=OFF; PRAGMA cache_size=-16384");
    ok(sqlite3_prepare_v2(db_, "INSERT INTO chunks (session, seq, samples, crc, bytes) VALUES (?,?,?,?,?)",
                          -1, &insert_, nullptr));
  }
  ~RawSqlite() override {
    sqlite3_finalize(insert_);
    sqlite3_close(db_);
  }

  double run(const IngestRows& rows) override {
    const auto begin = IngestClock::now();
    times_.begin();
    for (std::size_t at = 0; at < rows.size(); at += group_) {
      exec("BEGIN IMMEDIATE");
      for (std::size_t i = at; i < std::min(rows.size(), at + group_); ++i) {
        const IngestRow& row = rows[i];
        sqlite3_bind_int64(insert_, 1, static_cast<sqlite3_int64>(row.session + 1));
        sqlite3_bind_int64(insert_, 2, static_cast<sqlite3_int64>(row.seq));
        sqlite3_bind_int64(insert_, 3, 1000);
        sqlite3_bind_int64(insert_, 4, stationCrcOf(*row.bytes));
        sqlite3_bind_blob64(insert_, 5, row.bytes->data(), row.bytes->size(), SQLITE_STATIC);
        if (sqlite3_step(insert_) != SQLITE_DONE) dieOfIngest(sqlite3_errmsg(db_));
        sqlite3_reset(insert_);
      }
      exec("COMMIT");
      times_.committed();
      if (const auto now = IngestClock::now(); now - checkpointed_ >= std::chrono::milliseconds(100)) {
        checkpointed_ = now;
        ok(sqlite3_wal_checkpoint_v2(db_, nullptr, SQLITE_CHECKPOINT_PASSIVE, nullptr, nullptr));
      }
    }
    return secondsSince(begin);
  }
  [[nodiscard]] std::string remark() const override { return times_.text(); }

 private:
  void ok(int rc) {
    if (rc != SQLITE_OK) dieOfIngest(sqlite3_errmsg(db_));
  }
  void exec(const char* sql) { ok(sqlite3_exec(db_, sql, nullptr, nullptr, nullptr)); }

  IngestDatabase database_;
  const std::size_t group_;
  sqlite3* db_ = nullptr;
  sqlite3_stmt* insert_ = nullptr;
  IngestTimes times_;
  IngestClock::time_point checkpointed_ = IngestClock::now();
};

}  // namespace

void IngestTimes::committed() {
  const auto now = IngestClock::now();
  ms_.push_back(std::chrono::duration<double, std::milli>(now - std::exchange(last_, now)).count());
}

std::string IngestTimes::text() const {
  std::vector<double> ms = ms_;
  std::sort(ms.begin(), ms.end());
  const auto at = [&](double share) {
    return ms[static_cast<std::size_t>(share * static_cast<double>(ms.size() - 1))];
  };
  return fmt::format("{:.2f} ms (p50), {:.2f} ms (p99)", at(0.5), at(0.99));
}

IngestDatabase::IngestDatabase(const IngestSettings& settings, const std::string& cluster,
                               const std::string& name)
    : cluster_(cluster),
      name_(name),
      address_(settings.folder / (name + ".db"), cluster.empty() ? "" : cluster + " dbname=" + name) {
  remove();
  if (!cluster.empty()) mustIngest(controlOf(cluster).script("CREATE DATABASE " + name));
  Connection writer = mustIngest(openAt(address_, Connection::Mode::kWriter, true));
  mustIngest(migrate(writer));
  auto transaction = mustIngest(Transaction::begin(writer, Transaction::Kind::kWrite));
  mustIngest(StationStore(writer).add("station-1", StationKeyBytes{}, 1));
  for (std::size_t i = 0; i < settings.sessions; ++i) {
    ids_.push_back(makeUuidV7());
    pb::SessionDescription d;
    d.set_session_id(std::string(ids_.back().begin(), ids_.back().end()));
    d.set_station("station-1");
    d.set_trainee("anna");
    d.set_exercise_id("knee-1");
    d.set_profile_id("knee-adult");
    d.set_profile_json("{\"text\":\"" + std::string(settings.profile_bytes, 'x') + "\"}");
    d.set_engine_version("bench");
    d.set_rate_hz(1000);
    d.set_started_unix_ns(1'700'000'000'000'000'000);
    d.mutable_resolution()->set_length_m(1e-6);
    mustIngest(SessionStore(writer).open(d, 1));
  }
  mustIngest(transaction.commit());
  mustIngest(writer.checkpointPassive());
  // as the server's own daemon does sooner or later
  if (!cluster.empty()) mustIngest(writer.script("ANALYZE"));
}

void IngestDatabase::remove() const {
  if (!cluster_.empty()) {
    mustIngest(controlOf(cluster_).script("DROP DATABASE IF EXISTS " + name_ + " WITH (FORCE)"));
    return;
  }
  for (const char* suffix : {"", "-wal", "-shm"}) {
    std::error_code ignored;
    std::filesystem::remove(address_.path.string() + suffix, ignored);
  }
}

std::unique_ptr<IngestContender> ingestOurs(const IngestSettings& settings, const std::string& cluster,
                                            std::size_t group) {
  return std::make_unique<OurIngest>(settings, cluster, group);
}

std::unique_ptr<IngestContender> ingestRawSqlite(const IngestSettings& settings, std::size_t group) {
  return std::make_unique<RawSqlite>(settings, group);
}

std::string textOfCluster(const std::string& cluster, bool wants_standby) {
  Connection control = controlOf(cluster);
  const auto ask = [&](const std::string& sql) {
    const auto found = mustIngest(control.prepare(sql).first(firstText));
    return found.value_or("");
  };
  const auto setting = [&](const std::string& name) {
    return name + "=" + ask("SELECT current_setting('" + name + "')");
  };
  const std::string state = ask("SELECT sync_state FROM pg_stat_replication");
  if (wants_standby && state != "quorum" && state != "sync")
    dieOfIngest("the standby of '" + cluster + "' is not synchronous ('" + state + "')");
  if (!wants_standby && !state.empty()) dieOfIngest("'" + cluster + "' has a standby");
  std::string text = "PostgreSQL " + ask("SELECT current_setting('server_version')");
  for (const char* const name : {"fsync", "synchronous_commit", "full_page_writes", "wal_sync_method"})
    text += ", " + setting(name);
  if (wants_standby) text += ", " + setting("synchronous_standby_names");
  return text;
}

}  // namespace needlelab::test
