/// A fresh database with one station, and sessions and chunks to put into it.
#pragma once

#include <gtest/gtest.h>
#include <sqlite3.h>
#include <cstdint>

#include <string>
#include <vector>

#include "common/gesture/chunk.h"
#include "db/login/credentials.h"
#include "db/sessions/session_store.h"
#include "db/store/connection.h"
#include "db/store/schema.h"
#include "db/store/store_address.h"
#include "needlelab/teaching.pb.h"
#include "tests/support/store/postgres_database.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {

inline constexpr std::int64_t kDay_ns = 86'400'000'000'000;

/// Fails the test with the error message if the result is an error.
#define ASSERT_OK(expression)                                             \
  do {                                                                    \
    const auto& status_to_check = (expression);                           \
    ASSERT_TRUE(status_to_check.ok()) << status_to_check.error().message; \
  } while (false)
#define EXPECT_OK(expression)                                             \
  do {                                                                    \
    const auto& status_to_check = (expression);                           \
    EXPECT_TRUE(status_to_check.ok()) << status_to_check.error().message; \
  } while (false)

class TestDb {
 public:
  explicit TestDb(const char* vfs = nullptr)
      : path(folder.path() / "needlelab.db"),
        address(path, vfs == nullptr && onPostgres() ? postgresUrlOf(folder.path()) : ""),
        writer(must(
            address.isPostgres()
                ? openAt(address, Connection::Mode::kWriter)
                : Connection::open(path, {.mode = Connection::Mode::kWriter, .create = true, .vfs = vfs}))) {
    // Store tests do not wait for the disk; durability tests use their own VFS.
    if (vfs == nullptr && !address.isPostgres()) EXPECT_OK(writer.script("PRAGMA synchronous=OFF"));
    EXPECT_OK(migrate(writer));
    EXPECT_OK(StationStore(writer).add("station-1", StationKeyBytes{}, 1));
  }

  [[nodiscard]] Connection reader() const { return must(openAt(address, Connection::Mode::kReader)); }

  template <typename T>
  static T must(Result<T> result) {
    if (!result) throw std::runtime_error(result.error().message);
    return std::move(*result);
  }

  TempFolder folder;
  std::filesystem::path path;
  PostgresBelow dropped_at_end{folder.path()};
  StoreAddress address;
  Connection writer;
};

/// SQL of somebody with direct access to the database: neither triggers nor foreign keys apply, on SQLite no
/// CHECKs either. On PostgreSQL for a superuser.
inline std::string lawless(const std::string& sql) {
  if (!onPostgres()) return "PRAGMA foreign_keys=OFF; PRAGMA ignore_check_constraints=ON;" + sql;
  return "SET session_replication_role = replica;" + sql + ";RESET session_replication_role";
}
/// SQL for bytes with these hexadecimal digits.
inline std::string bytesSql(const std::string& hex) {
  return onPostgres() ? "decode('" + hex + "', 'hex')" : "x'" + hex + "'";
}
inline std::string zerosSql(std::size_t count) {
  return bytesSql(std::string(2 * count, '0'));
}
/// SQL for the column `bytes` with the byte at `at`, counted from 1, replaced.
inline std::string byteReplacedSql(int at, const std::string& hex) {
  if (onPostgres())
    return "overlay(bytes PLACING " + bytesSql(hex) + " FROM " + std::to_string(at) + " FOR 1)";
  return "CAST(substr(bytes, 1, " + std::to_string(at - 1) + ") || " + bytesSql(hex) + " || substr(bytes, " +
         std::to_string(at + 1) + ") AS BLOB)";
}

/// Instructions of SQLite's virtual machine that the connection's statements have run since the last call.
inline int stepsOfStatements(Connection& connection) {
  int steps = 0;
  for (sqlite3_stmt* s = sqlite3_next_stmt(connection.handle(), nullptr); s != nullptr;
       s = sqlite3_next_stmt(connection.handle(), s))
    steps += sqlite3_stmt_status(s, SQLITE_STMTSTATUS_VM_STEP, 1);
  return steps;
}

/// Returns samples with ticks from `first_tick` and a small motion.
inline std::vector<GestureSample> someSamples(std::uint64_t first_tick, std::size_t count) {
  std::vector<GestureSample> samples(count);
  for (std::size_t i = 0; i < count; ++i) {
    samples[i].tick = first_tick + i;
    samples[i].time_ns = static_cast<std::int64_t>((first_tick + i) * 1'000'000);
    samples[i].p_WT_m[0] = 1e-4 * static_cast<double>((first_tick + i) % 97);
    samples[i].force_W_N[2] = 0.01 * static_cast<double>((first_tick + i) % 13);
  }
  return samples;
}

/// Returns chunk number `seq` of a session with `count` samples per chunk.
inline Bytes chunkOf(std::uint64_t seq, std::size_t count = 20) {
  return encodeChunk(Resolution{}, someSamples(seq * count, count));
}

inline std::string bytesOfId(const Uuid& id) {
  return {id.begin(), id.end()};
}

inline pb::SessionDescription describe(const Uuid& id) {
  pb::SessionDescription d;
  d.set_session_id(bytesOfId(id));
  d.set_station("station-1");
  d.set_trainee("anna");
  d.set_exercise_id("knee-1");
  d.set_profile_id("knee-adult");
  d.set_profile_revision(1);
  d.set_profile_json("{\"id\":\"knee-adult\"}");
  d.set_engine_version("0.1.0");
  d.set_rate_hz(1000);
  d.mutable_resolution()->set_length_m(1e-6);
  d.set_started_unix_ns(1'700'000'000'000'000'000);
  d.set_device("simulated");
  return d;
}

/// Returns the request that closes a session with the chunks 0 … chunks−1 of chunkOf().
inline pb::CloseSession closeOf(const Uuid& id, std::uint64_t chunks, std::size_t count = 20) {
  SessionHash hash;
  for (std::uint64_t seq = 0; seq < chunks; ++seq) hash.update(chunkOf(seq, count));
  const Digest digest = hash.digest();
  pb::CloseSession request;
  request.set_session_id(bytesOfId(id));
  request.set_chunks(chunks);
  request.set_samples(chunks * count);
  request.set_hash(digest.data(), digest.size());
  return request;
}

/// Returns a score of a session by the first definitions.
inline pb::Score scoreOf(const Uuid& id, const std::string& measures, std::uint32_t version = 1) {
  pb::Score score;
  score.set_session_id(bytesOfId(id));
  score.set_definition_version(version);
  score.set_measures_json(measures);
  score.set_engine_version("0.1.0");
  score.set_made_unix_ns(1);
  return score;
}

}  // namespace needlelab::test
