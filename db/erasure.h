/// A person's data taken away: what of it goes, what stays under a pseudonym, and how an old backup is told
/// from this database.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "db/pseudonyms.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// A line of DIR/erasures. The file outlives a restore, which replaces the database.
struct ErasureLine {
  std::string pseudonym;
  PseudonymKey::Hash name_hash{};
  std::int64_t unix_ns = 0;
};

/// What is in DIR/erasures; nothing when there is no such file. kCorrupt.
Result<std::vector<ErasureLine>> readErasures(const std::filesystem::path& folder);
Status writeErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines);

/// Somebody who was erased and is here again: the database was restored from a backup made before.
struct ErasureToRepeat {
  std::string name;  ///< who is here again
  std::string pseudonym;
  std::int64_t erased_unix_ns = 0;
};
/// "'anna' was erased on … and is in this database again, …: needlelab-admin person erase anna": for people.
std::string erasureToRepeatText(const ErasureToRepeat& erasure);

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's and
/// a transaction.
class ErasureStore {
 public:
  explicit ErasureStore(Connection& connection) : connection_(connection) {}

  /// The key beside the database, made when there is none. kCorrupt: there is none although people were
  /// erased: a new one could not tell who they were.
  Result<PseudonymKey> key();
  /// Open sessions of this trainee, as "… at station …".
  Result<std::vector<std::string>> openSessions(std::string_view name);
  /// In one transaction (db/README.md, "An erasure"). Sessions keep their rows, closed, under the pseudonym,
  /// without score, events and attempts' verdicts; their chunks are left for retention to remove
  /// (RetentionStore::leftovers). kNotFound: neither a person nor sessions of this name; kDenied: the last
  /// administrator who can log in.
  Result<pb::Erasure> erase(const std::string& name, const ErasureLine& line, const std::string& by,
                            const std::string& reason, std::int64_t now_unix_ns);

  /// The pseudonym of a trainee who was erased after `started_unix_ns`: a station that was away may bring a
  /// session of it yet. Nothing when the key is not there: what is recorded is taken in any case, and `check`
  /// says that the key is missing.
  Result<std::optional<std::string>> pseudonymOf(std::string_view trainee, std::int64_t started_unix_ns);
  /// A session without chunks that a station has opened for somebody who was erased: closed at once, marked,
  /// and to be kept empty.
  Status emptySession(const Uuid& session, std::int64_t now_unix_ns);
  /// Who was erased, by DIR/erasures or by this database, and is here again: from a backup that was restored,
  /// or from records of before. Empty when all is well. kCorrupt: as key().
  Result<std::vector<ErasureToRepeat>> toRepeat(const std::filesystem::path& folder);

 private:
  Status eraseSessions(const ErasedNames& names, std::int64_t now_unix_ns, const std::string& by,
                       std::set<std::string>& ids, pb::Erasure& erasure);
  Status eraseRemarks(const ErasedNames& names);
  Status eraseWords(const ErasedNames& names, const std::set<std::string>& sessions, pb::Erasure& erasure);
  Connection& connection_;
};

}  // namespace needlelab
