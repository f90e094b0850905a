/// A person's data taken away: what of it goes, what stays under a pseudonym, and how an old backup is told
/// from this database.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/uuid.h"
#include "db/connection.h"
#include "db/pseudonym.h"
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

/// An erasure that this database does not know of although its folder does: it was restored from a backup
/// made before.
struct ErasureToRepeat {
  std::string name;  ///< who is here again
  std::string pseudonym;
  std::int64_t erased_unix_ns = 0;
};
/// "'anna' was erased on … and is in this database again, …: needlelab-admin person erase anna": for people.
std::string erasureToRepeatText(const ErasureToRepeat& erasure);

/// The name in a text by others is replaced where it stands as a word of its own, in either case; so is each
/// word of the full name that is longer than two letters.
std::string withoutName(const std::string& text, std::string_view name, std::string_view full_name,
                        std::string_view in_its_place);

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's and
/// a transaction.
class ErasureStore {
 public:
  explicit ErasureStore(Connection& connection) : connection_(connection) {}

  /// Open sessions of this trainee, as "… at station …".
  Result<std::vector<std::string>> openSessions(std::string_view name);
  /// In one transaction (DESIGN of it: db/README.md). Sessions keep their rows, closed, under the pseudonym,
  /// without score, events and attempts' verdicts; their chunks are left for retention to remove
  /// (RetentionStore::leftovers). kNotFound: neither a person nor sessions of this name; kDenied: the last
  /// administrator who can log in.
  Result<pb::Erasure> erase(const std::string& name, const ErasureLine& line, const std::string& by,
                            const std::string& reason, std::int64_t now_unix_ns);

  /// The pseudonym of a trainee who was erased after `started_unix_ns`: a station that was away may bring a
  /// session of it yet. Reads the key beside the database; nothing without one.
  Result<std::optional<std::string>> pseudonymOf(std::string_view trainee, std::int64_t started_unix_ns);
  /// A session without chunks that a station has opened for somebody who was erased: closed at once, marked,
  /// and to be kept empty.
  Status emptySession(const Uuid& session, std::int64_t now_unix_ns);
  /// Lines of DIR/erasures that this database lacks, and whose names it has. Empty when all is well.
  Result<std::vector<ErasureToRepeat>> toRepeat(const std::filesystem::path& folder);

 private:
  Status eraseSessions(const std::string& name, const std::string& full_name, const std::string& pseudonym,
                       std::int64_t now_unix_ns, const std::string& by, pb::Erasure& erasure);
  Status eraseWords(const std::string& name, const std::string& full_name, const std::string& pseudonym,
                    pb::Erasure& erasure);
  Connection& connection_;
};

}  // namespace needlelab
