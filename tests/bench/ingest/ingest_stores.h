/// What ingest_bench compares: the store as the server uses it, and the engines without it.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/store/connection.h"
#include "db/store/store_address.h"

namespace needlelab::test {

struct IngestSettings {
  std::filesystem::path folder = std::filesystem::current_path();  ///< databases go here: a real disk
  std::string postgres, standby;  ///< clusters (ingest_clusters), "host=… user=…"; empty: none
  std::filesystem::path results;
  std::string commit;
  std::size_t rounds = 12, groups = 20;
  std::size_t sessions = 1000, profile_bytes = 4000;
};

[[noreturn]] inline void dieOfIngest(const std::string& text) {
  std::fprintf(stderr, "ingest_bench: %s\n", text.c_str());
  std::_Exit(1);
}
inline void mustIngest(const Status& status) {
  if (!status.ok()) dieOfIngest(status.error().message);
}
template <typename T>
T mustIngest(Result<T> result) {
  if (!result.ok()) dieOfIngest(result.error().message);
  return std::move(*result);
}

/// From one commit to the next, while there is always something to store.
class IngestTimes {
 public:
  /// Rows come from now on.
  void begin() { last_ = std::chrono::steady_clock::now(); }
  void committed();
  /// "1.23 ms (p50), 4.56 ms (p99)".
  [[nodiscard]] std::string text() const;

 private:
  std::chrono::steady_clock::time_point last_;
  std::vector<double> ms_;
};

struct IngestRow {
  std::size_t session = 0;
  std::uint64_t seq = 0;
  const Bytes* bytes = nullptr;
};
using IngestRows = std::vector<IngestRow>;

/// One database with all sessions open; removed at its end.
class IngestDatabase {
 public:
  /// `cluster`: of PostgreSQL; empty: an SQLite file in the settings' folder.
  IngestDatabase(const IngestSettings& settings, const std::string& cluster, const std::string& name);
  ~IngestDatabase() { remove(); }
  IngestDatabase(const IngestDatabase&) = delete;
  IngestDatabase& operator=(const IngestDatabase&) = delete;
  [[nodiscard]] const StoreAddress& address() const { return address_; }
  [[nodiscard]] const Uuid& id(std::size_t session) const { return ids_[session]; }

 private:
  void remove() const;
  const std::string cluster_, name_;
  const StoreAddress address_;
  std::vector<Uuid> ids_;
};

/// Takes rows in, the settings' number in a transaction.
class IngestContender {
 public:
  IngestContender() = default;
  virtual ~IngestContender() = default;
  IngestContender(const IngestContender&) = delete;
  IngestContender& operator=(const IngestContender&) = delete;
  /// Seconds until the last of them is committed.
  virtual double run(const IngestRows& rows) = 0;
  /// How long its transactions took, and what else it has to say.
  [[nodiscard]] virtual std::string remark() const = 0;
};

/// The store as in the server (DbWriter), with the queue kept full so that each group has exactly `group`
/// chunks.
std::unique_ptr<IngestContender> ingestOurs(const IngestSettings& settings, const std::string& cluster,
                                            std::size_t group);
/// SQLite alone: one prepared INSERT of the same rows into the same table, with the same durability and
/// memory settings and the same number of checkpoints; no checks, no counters, no foreign keys.
std::unique_ptr<IngestContender> ingestRawSqlite(const IngestSettings& settings, std::size_t group);

/// How libpq alone sends the rows of a transaction, prepared and binary: an INSERT … ON CONFLICT DO NOTHING
/// each in pipeline mode, or one INSERT of arrays. Either way BEGIN, rows and COMMIT go out together and one
/// answer is waited for; the same table, no checks, no counters, no foreign keys.
enum class RawPostgresForm { kPipeline, kArrays, kArraysWithoutKeys };
std::unique_ptr<IngestContender> ingestRawPostgres(const IngestSettings& settings, const std::string& cluster,
                                                   std::size_t group, RawPostgresForm form);
/// What a table says of the cluster: its settings that matter here. Dies where a standby is wanted, and none
/// is synchronous.
std::string textOfCluster(const std::string& cluster, bool wants_standby);

}  // namespace needlelab::test
