/// What records of an import would change in what the server does: which recordings it deletes, who gets in,
/// what a course's newest revision is. Private to this folder.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/pseudonyms.h"
#include "db/service/record_tables.h"

namespace needlelab {

/// State of one import. Thread: the writer's.
class ImportRules {
 public:
  /// `with_policies`: retention policies and the lab's settings are stored, too.
  ImportRules(Connection& writer, bool with_policies, std::int64_t now_unix_ns)
      : writer_(writer), with_policies_(with_policies), now_unix_ns_(now_unix_ns) {}

  enum class Verdict {
    kTake,     ///< perhaps with changes
    kLeftOut,  ///< and named by notes()
  };
  /// For a record that differs from `there`, what is here under its key (null: nothing); its fields have
  /// their types. May change it: a policy's without_backup is never taken, nor a time of an erasure that is
  /// yet to come. kInvalidInput: a policy that nobody could set by a request; an erasure's pseudonym that is
  /// none.
  Result<Verdict> look(const RecordTable& table, RecordJson& record, const RecordJson& there);
  /// For a record that was stored: notes who gets in, who consents, and what people who are here get; marks
  /// an erasure of a name that nobody had.
  Status noteStored(const RecordTable& table, const RecordJson& record);
  /// What the importer has to know, one line each, the gravest kind first; of each kind the first 100, and
  /// how many more there are.
  [[nodiscard]] std::vector<std::string> notes() const;
  /// For the audit log: what was left out of sessions that are here, and the first of these; empty: nothing.
  [[nodiscard]] std::string leftOutText() const;

 private:
  enum Kind : std::size_t {
    kOfSessions,
    kPolicies,
    kAdministrators,
    kStaff,
    kStations,
    kSettings,
    kErasures,
    kRevisions,
    kTrainees,
    kConsents,
    kNewSessions,
    kRemarks,
    kMembers,
    kAssignments,
    kKinds
  };
  struct Lines {
    std::vector<std::string> first;
    std::uint64_t count = 0;
  };

  Result<Verdict> lookAtPolicy(const RecordTable& table, RecordJson& record, const RecordJson& there);
  Result<Verdict> lookAtSetting(const RecordTable& table, const RecordJson& record);
  Result<Verdict> lookAtErasure(RecordJson& record, const RecordJson& there);
  /// A score, event, remark or mark of a session: taken only with the session.
  Result<Verdict> lookAtSessionsRow(const RecordTable& table, const RecordJson& record,
                                    const RecordJson& there);
  /// Whether that row was here before this import. `table` and `column` are SQL.
  Result<bool> wasHere(const char* table, const char* column, const std::string& name);
  /// Notes a revision that is newer than what is here, and a sample that is replaced.
  Status lookAtRevision(const RecordTable& table, const RecordJson& record, const RecordJson& there);
  /// Once: the accounts that are here, by the hash of their name.
  Status readAccounts();
  void addAccount(const std::string& name, std::int64_t created_unix_ns);
  void note(Kind kind, const std::string& text);

  Connection& writer_;
  const bool with_policies_;
  const std::int64_t now_unix_ns_;
  std::array<Lines, kKinds> lines_;
  std::set<std::string> sessions_;             ///< ids in digits: of this import
  std::set<std::string> people_, groups_;      ///< of this import
  std::map<std::string, std::uint64_t> left_;  ///< rows of sessions that are here, by kind
  std::vector<std::string> left_sessions_;     ///< the first of these
  /// By "KIND ID": the newest revision before this import; 0: none.
  std::map<std::string, std::int64_t> newest_;
  struct Account {
    std::string name;
    std::int64_t created_unix_ns = 0;
  };
  bool accounts_read_ = false;
  std::optional<PseudonymKey> key_;
  std::map<std::string, Account> accounts_;  ///< by the hash in digits
  std::set<std::string> names_;
};

}  // namespace needlelab
