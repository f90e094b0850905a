/// A lab on PostgreSQL that two servers share: filled once, and put back after each run.
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
#include "db/connection.h"
#include "db/store_address.h"
#include "tests/postgres/isolation/interleaving.h"
#include "tests/support/postgres_database.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {

// Sessions of the world, by their ids of 16 bytes.
inline constexpr const char* kScoredSession = "closed-session-1";       ///< of anna, closed
inline constexpr const char* kOtherSession = "closed-session-2";        ///< of bob, closed
inline constexpr const char* kOpenSession = "open---session-3";         ///< of carl, with two chunks
inline constexpr const char* kUnknownOpenSession = "opened-session-8";  ///< of "somebody", with two chunks
inline constexpr const char* kWaitingSession = "waits--session-4";      ///< of "nobody", closed
inline constexpr const char* kOldSession = "old----session-5";     ///< of bob; a policy deletes its recording
inline constexpr const char* kErasedSession = "closed-session-6";  ///< of carl, closed
inline constexpr const char* kUnsafeSession = "unsafe-session-7";  ///< as kOldSession, but not Safe

/// Removes what no two runs have in common from a text: times from this program's start on, times of day, and
/// MACs of the audit log.
std::string withoutTimes(const std::string& text);

/// People: ada and abe (administrators), mia (manager), ina (instructor), rea (researcher), anna, bob, carl,
/// cora (trainees; cora has a code). Stations 1 and 2; a course of the exercises first and second; the group
/// g1 of anna and bob; one assignment; the sessions above. Beside it two databases into which backups of it
/// were restored. Random numbers of this program are always the same. Thread: one.
class SharedWorld {
 public:
  /// Throws when it cannot be made.
  SharedWorld();

  /// Of the tables that are not as at the beginning, or all of these but the audit log's: a line a row,
  /// without what two runs do not have in common.
  std::string contents(bool with_audit_log);
  /// Puts tables and files back as they were.
  void putBack();
  /// Makes the two servers' connections anew: a bug that was planted before is in what they prepare.
  void connectAnew();
  /// What is wrong with the audit log's chain; empty: nothing.
  std::string faultOfAuditChain();
  /// Transactions that PostgreSQL ended because of a deadlock.
  std::int64_t deadlocks();

  [[nodiscard]] Connection& control() { return *control_; }
  [[nodiscard]] const std::string& profileJson() const { return profile_json_; }
  /// Of an export of everything: the record of a person.
  [[nodiscard]] const std::string& personRecord() const { return person_record_; }
  /// Where a backup of the whole world was restored; and an older one, to which all sessions are open. Both
  /// were made before this program began, so that contents() tells their times apart.
  [[nodiscard]] const std::string& restoredUrl() const { return restored_url_; }
  [[nodiscard]] const std::string& olderUrl() const { return older_url_; }

  OneServer& one() { return *one_; }
  OneServer& other() { return *other_; }

 private:
  void fill();
  /// A database of its own with what the world's has now, as if made at `made_unix_ns`; returns its URL.
  /// Nobody may have the world's open.
  std::string restoredNow(const char* folder, std::int64_t made_unix_ns);
  /// By table: another text once a transaction has changed it.
  std::map<std::string, std::string> stampsNow();
  [[nodiscard]] std::set<std::string> changedTables();
  /// Lines of rows by table, without what two runs do not have in common.
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
  std::set<std::string> bloated_;               ///< tables with rows that were put back
  std::uint64_t times_put_back_ = 0;
  std::map<std::string, Bytes> files_;  ///< at the beginning, by path
  std::unique_ptr<OneServer> one_, other_;
};

}  // namespace needlelab::test
