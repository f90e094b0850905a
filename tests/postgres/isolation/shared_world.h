/// A lab on PostgreSQL shared by two servers: filled once, and restored after each run.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "db/store/connection.h"
#include "db/store/store_address.h"
#include "tests/postgres/isolation/interleaving.h"
#include "tests/support/store/postgres_database.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {

// The world's sessions, by their 16-byte ids.
inline constexpr const char* kScoredSession = "closed-session-1";       ///< anna's, closed
inline constexpr const char* kOtherSession = "closed-session-2";        ///< bob's, closed
inline constexpr const char* kOpenSession = "open---session-3";         ///< carl's, with two chunks
inline constexpr const char* kUnknownOpenSession = "opened-session-8";  ///< of "somebody", with two chunks
inline constexpr const char* kWaitingSession = "waits--session-4";      ///< of "nobody", closed
inline constexpr const char* kOldSession = "old----session-5";     ///< bob's; a policy deletes its recording
inline constexpr const char* kErasedSession = "closed-session-6";  ///< carl's, closed
inline constexpr const char* kUnsafeSession = "unsafe-session-7";  ///< like kOldSession, but not Safe

/// Removes from a text what differs between runs: times since this program's start, times of day, and the
/// audit log's MACs.
std::string withoutTimes(const std::string& text);

/// People: ada and abe (administrators), mia (manager), ina (instructor), rea (researcher), anna, bob, carl,
/// cora (trainees; cora has a code). Stations 1 and 2; a course with the exercises first and second; the
/// group g1 with anna and bob; one assignment; the sessions above. In addition two databases with restored
/// backups of it. The program's random numbers are always the same. Thread: one.
class SharedWorld {
 public:
  /// Throws if it cannot be created.
  SharedWorld();

  /// The tables that differ from the beginning, or all of these except the audit log's: one line per row,
  /// without what differs between runs.
  std::string contents(bool with_audit_log);
  /// Restores tables and files.
  void putBack();
  /// Reconnects the two servers: their prepared statements still contain an earlier planted bug.
  void connectAnew();
  /// The error in the audit log's chain; empty: none.
  std::string faultOfAuditChain();
  /// Transactions that PostgreSQL ended because of a deadlock.
  std::int64_t deadlocks();

  [[nodiscard]] Connection& control() { return *control_; }
  [[nodiscard]] const std::string& profileJson() const { return profile_json_; }
  /// From an export of everything: a person's record.
  [[nodiscard]] const std::string& personRecord() const { return person_record_; }
  /// A database with a restored backup of the whole world; and an older one, in which all sessions are open.
  /// Both were made before this program began, so that contents() can distinguish their times.
  [[nodiscard]] const std::string& restoredUrl() const { return restored_url_; }
  [[nodiscard]] const std::string& olderUrl() const { return older_url_; }

  OneServer& one() { return *one_; }
  OneServer& other() { return *other_; }

 private:
  void fill();
  /// A separate database with the world's current content, as if made at `made_unix_ns`; returns its URL. The
  /// world's must not be open elsewhere.
  std::string restoredNow(const char* folder, std::int64_t made_unix_ns);
  /// By table: a different text once a transaction has changed it.
  std::map<std::string, std::string> stampsNow();
  [[nodiscard]] std::set<std::string> changedTables();
  /// Rows as lines, by table, without what differs between runs.
  std::map<std::string, std::string> rowsOf(const std::set<std::string>& tables);
  std::map<std::string, Bytes> filesNow() const;

  TempFolder folder_;
  PostgresBelow dropped_at_end_{folder_.path()};
  StoreAddress address_;
  std::string profile_json_, person_record_, restored_url_, older_url_, all_stamps_;
  std::unique_ptr<Connection> control_;
  std::map<std::string, std::string> columns_;  ///< by table
  std::map<std::string, std::string> stamps_;   ///< since the beginning, or putBack()
  std::map<std::string, std::string> rows_;     ///< at the beginning
  std::set<std::string> bloated_;               ///< tables with restored rows
  std::uint64_t times_put_back_ = 0;
  std::map<std::string, Bytes> files_;  ///< at the beginning, by path
  std::unique_ptr<OneServer> one_, other_;
};

}  // namespace needlelab::test
