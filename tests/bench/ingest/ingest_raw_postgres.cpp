#include <libpq-fe.h>

#include <algorithm>
#include <chrono>
#include <span>

#include "db/engine/postgres.h"
#include "db/engine/postgres_values.h"
#include "db/sessions/session_rows.h"
#include "tests/bench/ingest/ingest_stores.h"

namespace needlelab::test {
namespace {

/// What is sent for one statement.
struct RawValues {
  std::vector<std::string> bytes;
  std::vector<Oid> types;
  void add(PostgresType type, std::string value) {
    types.push_back(static_cast<Oid>(type));
    bytes.push_back(std::move(value));
  }
};

class RawPostgres final : public IngestContender {
 public:
  RawPostgres(const IngestSettings& settings, const std::string& cluster, std::size_t group,
              RawPostgresForm form)
      : database_(settings, cluster,
                  form == RawPostgresForm::kPipeline ? "ingest_raw_rows"
                  : form == RawPostgresForm::kArrays ? "ingest_raw_arrays"
                                                     : "ingest_raw_no_keys"),
        form_(form),
        group_(group),
        connection_(PQconnectdb(database_.address().url.c_str())) {
    if (PQstatus(connection_) != CONNECTION_OK) dieOfIngest(PQerrorMessage(connection_));
    command(std::string("SET search_path = ") + kPostgresSchema);
    // PostgreSQL checks foreign keys by triggers, which a replica does not run
    if (form == RawPostgresForm::kArraysWithoutKeys) command("SET session_replication_role = replica");
  }
  ~RawPostgres() override { PQfinish(connection_); }

  double run(const IngestRows& rows) override {
    const auto begin = std::chrono::steady_clock::now();
    times_.begin();
    for (std::size_t at = 0; at < rows.size(); at += group_) {
      transact(std::span(rows).subspan(at, std::min(group_, rows.size() - at)));
      times_.committed();
    }
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  [[nodiscard]] std::string remark() const override { return times_.text(); }

 private:
  void command(const std::string& sql) {
    PGresult* const result = PQexec(connection_, sql.c_str());
    if (PQresultStatus(result) != PGRES_COMMAND_OK) dieOfIngest(PQerrorMessage(connection_));
    PQclear(result);
  }
  void ok(int sent) {
    if (sent == 0) dieOfIngest(PQerrorMessage(connection_));
  }
  /// Prepares it once, outside of pipelines.
  void prepare(const char* sql, const RawValues& values) {
    if (std::exchange(prepared_, true)) return;
    PGresult* const result =
        PQprepare(connection_, "insert", sql, static_cast<int>(values.types.size()), values.types.data());
    if (PQresultStatus(result) != PGRES_COMMAND_OK) dieOfIngest(PQerrorMessage(connection_));
    PQclear(result);
  }
  void send(const RawValues& values) {
    constexpr int kBinary = 1;
    std::vector<const char*> bytes;
    std::vector<int> lengths, forms(values.bytes.size(), kBinary);
    for (const std::string& value : values.bytes) {
      bytes.push_back(value.data());
      lengths.push_back(static_cast<int>(value.size()));
    }
    ok(PQsendQueryPrepared(connection_, "insert", static_cast<int>(bytes.size()), bytes.data(),
                           lengths.data(), forms.data(), kBinary));
  }
  static RawValues valuesOf(const IngestRow& row) {
    RawValues values;
    values.add(PostgresType::kInt8, postgresInteger(static_cast<std::int64_t>(row.session + 1)));
    values.add(PostgresType::kInt8, postgresInteger(static_cast<std::int64_t>(row.seq)));
    values.add(PostgresType::kInt8, postgresInteger(1000));
    values.add(PostgresType::kInt8, postgresInteger(stationCrcOf(*row.bytes)));
    values.add(PostgresType::kBytes, std::string(textOf(*row.bytes)));
    return values;
  }
  static RawValues valuesOf(std::span<const IngestRow> rows) {
    std::vector<std::int64_t> sessions, seqs, samples, crcs;
    std::vector<ByteView> bytes;
    for (const IngestRow& row : rows) {
      sessions.push_back(static_cast<std::int64_t>(row.session + 1));
      seqs.push_back(static_cast<std::int64_t>(row.seq));
      samples.push_back(1000);
      crcs.push_back(stationCrcOf(*row.bytes));
      bytes.emplace_back(*row.bytes);
    }
    RawValues values;
    for (const auto* const list : {&sessions, &seqs, &samples, &crcs})
      values.add(PostgresType::kInt8List, *postgresList(std::span<const std::int64_t>(*list)));
    values.add(PostgresType::kBytesList, *postgresList(std::span<const ByteView>(bytes)));
    return values;
  }
  void transact(std::span<const IngestRow> rows) {
    constexpr const char* kOne =
        "INSERT INTO chunks (session, seq, samples, crc, bytes) VALUES ($1,$2,$3,$4,$5)"
        " ON CONFLICT DO NOTHING";
    constexpr const char* kMany =
        "INSERT INTO chunks (session, seq, samples, crc, bytes) SELECT * FROM unnest($1,$2,$3,$4,$5)"
        " ON CONFLICT DO NOTHING";
    if (form_ == RawPostgresForm::kPipeline)
      prepare(kOne, valuesOf(rows.front()));
    else
      prepare(kMany, valuesOf(rows.first(1)));
    ok(PQenterPipelineMode(connection_));
    plain("BEGIN");
    if (form_ == RawPostgresForm::kPipeline)
      for (const IngestRow& row : rows) send(valuesOf(row));
    else
      send(valuesOf(rows));
    plain("COMMIT");
    ok(PQpipelineSync(connection_));
    for (;;) {
      PGresult* const result = PQgetResult(connection_);
      const ExecStatusType status = result != nullptr ? PQresultStatus(result) : PGRES_COMMAND_OK;
      PQclear(result);
      if (status == PGRES_PIPELINE_SYNC) break;
      if (status != PGRES_COMMAND_OK) dieOfIngest(PQerrorMessage(connection_));
    }
    ok(PQexitPipelineMode(connection_));
  }
  void plain(const char* sql) {
    ok(PQsendQueryParams(connection_, sql, 0, nullptr, nullptr, nullptr, nullptr, 0));
  }

  IngestDatabase database_;
  const RawPostgresForm form_;
  const std::size_t group_;
  PGconn* const connection_;
  bool prepared_ = false;
  IngestTimes times_;
};

}  // namespace

std::unique_ptr<IngestContender> ingestRawPostgres(const IngestSettings& settings, const std::string& cluster,
                                                   std::size_t group, RawPostgresForm form) {
  return std::make_unique<RawPostgres>(settings, cluster, group, form);
}

}  // namespace needlelab::test
