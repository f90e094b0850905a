/// Records of people who were erased here since the records were made: an import does not bring them back.
/// Private to this folder.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"
#include "db/erasure.h"
#include "db/service/record_tables.h"

namespace needlelab {

/// Within one import, in the order of its records: people come first. Thread: the writer's.
class ImportErasures {
 public:
  /// The erasures that the store and the file beside it know. kCorrupt: there are some, and no key that says
  /// of whom.
  static Result<ImportErasures> open(Connection& writer);

  enum class Verdict {
    kTake,     ///< perhaps with pseudonyms where names stood
    kLeftOut,  ///< of somebody erased
  };
  /// `record` has the types of its table. Changes names in it.
  Result<Verdict> look(const RecordTable& table, RecordJson& record);
  /// Whether `there` differs from `record` only by what an erasure since then has made of it.
  [[nodiscard]] bool isErasuresWork(const RecordTable& table, const RecordJson& there,
                                    const RecordJson& record) const;

 private:
  explicit ImportErasures(Connection& writer) : writer_(writer) {}
  /// The pseudonym of who had this name when the record was made; nothing: was not erased since.
  std::optional<std::string> pseudonymOf(const std::string& name, std::int64_t made_unix_ns) const;
  Result<bool> isOfErased(const RecordTable& table, const RecordJson& record);
  Result<bool> isOfErasedSession(const std::string& id_digits);
  void replaceDoer(RecordJson& record, const char* doer, const char* when) const;

  Connection& writer_;
  std::optional<PseudonymKey> key_;
  std::vector<ErasureLine> lines_;
  std::vector<ErasedNames> met_;          ///< those that the import holds
  std::map<std::string, bool> sessions_;  ///< by id in digits: whether it is of somebody erased
  std::set<std::string> session_texts_;   ///< ids of those that are, as the audit log has them
};

}  // namespace needlelab
