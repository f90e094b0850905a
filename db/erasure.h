/// Erases a person: the names go, the id stays as "erased person 17". Nothing else in the database says a
/// name, so nothing else is searched.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "db/erasure_list.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// How long a typed name that an erased person had waits for a manager, instead of counting for a namesake:
/// longer than any station keeps what it recorded.
inline constexpr std::int64_t kErasedNamesKept_ns = std::int64_t{400} * 86'400'000'000'000;

/// Who erases, why, and how.
struct ErasureOrder {
  std::string by, reason;
  std::int64_t now_unix_ns = 0;
  /// Also sessions that wait: without the person's code, or under the person's name as it was
  /// typed at a station. They may be another person's.
  bool with_waiting = false;
};

/// Does not own the connection. Thread: as its Connection; changes need the writer's and a transaction.
class ErasureStore {
 public:
  explicit ErasureStore(Connection& connection) : connection_(connection) {}

  /// Open sessions that an erasure would close, as "… at station …".
  Result<std::vector<std::string>> openSessions(std::string_view ref, bool with_waiting = false);
  /// What DIR/erasures says of it. kNotFound.
  Result<ErasureLine> lineOf(std::string_view ref, std::int64_t unix_ns);
  /// In a transaction. Names, password, code, groups, assignments, consents and tokens go; sessions keep
  /// their rows, closed, without recording, score and events; chunks go later (RetentionStore::leftovers).
  /// The names' pages are written again, so that no free part of them keeps a name. `ref`: of an account, or
  /// of a name that was typed at a station. kNotFound; kDenied: the last administrator who can log in.
  Result<pb::Erasure> erase(const std::string& ref, const ErasureOrder& order);
  /// Whether a person with this name was erased after `started_unix_ns`, within the last kErasedNamesKept_ns:
  /// a session that began then may be that person's, and waits.
  Result<bool> wasErased(std::string_view name, std::int64_t started_unix_ns, std::int64_t now_unix_ns);
  /// Whether this is the UUID of an erased person.
  Result<bool> isErased(const Uuid& person);
  /// The erasures that the database knows.
  Result<std::vector<ErasureLine>> known();
  /// Whether somebody of the lines is in the database again, from a restored backup.
  Result<bool> isAnyBack(const std::vector<ErasureLine>& lines);
  /// Erases those of the lines who are in the database again, from a restored backup. Lines of other labs
  /// are passed over. Returns how many it erased. In a transaction. Errors as erase().
  Result<std::size_t> repeat(const std::vector<ErasureLine>& lines, std::int64_t now_unix_ns);

 private:
  /// The ref of a person who is in the database and not erased.
  Result<std::optional<std::string>> refNotErased(const Uuid& person);
  /// The ref under which sessions wait whose stations typed the name of the account `ref`.
  Result<std::optional<std::string>> typedAs(std::string_view ref);
  Status eraseSessions(const std::string& ref, const ErasureOrder& order, pb::Erasure& erasure);
  /// Without the names of `gone`, a list of people.id in SQL.
  Status writeNamesAnew(std::string_view gone);
  Result<Uuid> lab();
  Connection& connection_;
};

}  // namespace needlelab
