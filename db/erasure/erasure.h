/// Erases a person: the names go, the id remains as "erased person 17". No other table contains names, so
/// nothing else is searched. The list of erasures next to the database survives the restore of a backup that
/// still contains erased people; it contains no names.
#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/store/connection.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// One erasure. `lab`: kLabKey of the person's database.
struct ErasureLine {
  Uuid lab{}, person{};
  std::int64_t unix_ns = 0;
  auto operator<=>(const ErasureLine&) const = default;
};

/// The list in the data folder, and its copy next to backups, for a restore on another machine.
inline constexpr const char* kErasuresFile = "erasures";
inline constexpr const char* kErasuresCopy = "needlelab.erasures";

/// Nothing if the file does not exist. kCorrupt names the file and the line.
Result<std::vector<ErasureLine>> readErasures(const std::filesystem::path& folder,
                                              const char* file = kErasuresFile);
/// Replaces the list.
Status writeErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                     const char* file = kErasuresFile);
/// Adds the missing `lines` to the list, atomically and durably; writes nothing if none are missing. One
/// thread at a time.
Status addErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                   const char* file = kErasuresFile);

/// Who erases, why, and how.
struct ErasureOrder {
  std::string by, reason;
  std::int64_t now_unix_ns = 0;
  /// Also erase sessions that wait: recorded without the person's code, or under the person's name as typed
  /// at a station. They may belong to someone else.
  bool with_waiting = false;
};

/// Does not own the connection. Thread: as its Connection; changes need the writer's and a transaction.
class ErasureStore {
 public:
  explicit ErasureStore(Connection& connection) : connection_(connection) {}

  /// Open sessions that an erasure would close, as "… at station …".
  Result<std::vector<std::string>> openSessions(std::string_view ref, bool with_waiting = false);
  /// The person's line in DIR/erasures. kNotFound.
  Result<ErasureLine> lineOf(std::string_view ref, std::int64_t unix_ns);
  /// Removes names, password, code, groups, assignments, consents and tokens. Sessions keep their rows,
  /// closed, without recording, score and events; chunks are removed later (RetentionStore::leftovers).
  /// Rewrites the pages of the names, so that no free space in them keeps a name. `ref`: of an account, or of
  /// a name typed at a station. Call in a transaction. kNotFound; kDenied: the last administrator who can log
  /// in.
  Result<pb::Erasure> erase(const std::string& ref, const ErasureOrder& order);
  /// The erasures recorded in the database.
  Result<std::vector<ErasureLine>> known();
  /// Whether any person of the lines is in the database again, from a restored backup.
  Result<bool> isAnyBack(const std::vector<ErasureLine>& lines);
  /// Erases the people of the lines who are in the database again, from a restored backup. Skips other labs'
  /// lines. Returns the number of erasures. Call in a transaction. Errors: as erase().
  Result<std::size_t> repeat(const std::vector<ErasureLine>& lines, std::int64_t now_unix_ns);

 private:
  /// The ref of a person who is in the database and not erased.
  Result<std::optional<std::string>> refNotErased(const Uuid& person);
  /// The ref under which sessions wait whose stations typed the name of account `ref`.
  Result<std::optional<std::string>> typedAs(std::string_view ref);
  Status eraseSessions(const std::string& ref, const ErasureOrder& order, pb::Erasure& erasure);
  /// Rewrites the names without those of `gone`, a list of people.id in SQL.
  Status rewriteNames(std::string_view gone);
  Result<Uuid> lab();
  Connection& connection_;
};

}  // namespace needlelab
