#include "db/service/import_rules.h"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <optional>
#include <string_view>
#include <system_error>

#include "common/base/local_time.h"
#include "common/base/text.h"
#include "db/erasure.h"
#include "db/lab_settings.h"
#include "db/pseudonyms.h"
#include "db/retention_store.h"
#include "db/schema.h"
#include "db/service/lesson_texts.h"
#include "db/service/requests.h"
#include "db/session_rows.h"

namespace needlelab {
namespace {

constexpr std::size_t kMostNotes = 100;  // of a kind
constexpr std::size_t kLongestName = 200;
constexpr std::size_t kMostSessionsNamed = 5;  // in the audit log

bool isOfSession(const RecordTable& table) {
  return std::any_of(table.columns.begin(), table.columns.end(),
                     [](const RecordColumn& column) { return column.kind == RecordColumnKind::kSession; });
}

double realIn(const RecordJson& record, const char* name) {
  const auto found = record.find(name);
  return found != record.end() && found->is_number() ? found->get<double>() : 0;
}

/// A session's id as the audit log has it.
std::string textOfId(const std::string& digits) {
  const auto bytes = bytesOfHex(digits);
  return bytes ? sessionText(*bytes) : printable(digits);
}

/// A name of a record, for a note.
std::string named(const std::string& name) {
  return name.size() <= kLongestName ? "'" + printable(name) + "'"
                                     : fmt::format("(a name of {} bytes)", name.size());
}

/// Days beyond 32 bits become the greatest number of them, which no policy may have.
std::uint32_t daysIn(const RecordJson& record, const char* name) {
  constexpr std::int64_t kMost = std::numeric_limits<std::uint32_t>::max();
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(numberIn(record, name), 0, kMost));
}

pb::RetentionPolicy policyIn(const RecordJson& record) {
  pb::RetentionPolicy policy;
  policy.set_exercise_id(textIn(record, "exercise_id"));
  if (isGiven(record, "thin_after_days")) policy.set_thin_after_days(daysIn(record, "thin_after_days"));
  policy.set_thin_rate_hz(realIn(record, "thin_rate_hz"));
  policy.set_thin_coarser(realIn(record, "thin_coarser"));
  if (isGiven(record, "delete_after_days")) policy.set_delete_after_days(daysIn(record, "delete_after_days"));
  return policy;
}

std::string policyText(const pb::RetentionPolicy& policy) {
  std::string text =
      "retention policy of " +
      (policy.exercise_id().empty() ? std::string("all other exercises") : named(policy.exercise_id()));
  if (policy.has_thin_after_days())
    text += fmt::format(", thin to {:g} Hz after {} days", policy.thin_rate_hz(), policy.thin_after_days());
  if (policy.has_delete_after_days())
    text += fmt::format(", delete recordings after {} days", policy.delete_after_days());
  return text;
}

/// How somebody or a station that is new can get in; empty: not yet.
std::string accessText(const RecordJson& person) {
  std::string text;
  if (!textIn(person, "password_hash").empty()) text = "a password";
  if (!textIn(person, "code_hash").empty()) text += text.empty() ? "a code" : " and a code";
  return text;
}

}  // namespace

Result<ImportRules::Verdict> ImportRules::look(const RecordTable& table, RecordJson& record,
                                               const RecordJson& there) {
  if (table.kind == "retention_policy") return lookAtPolicy(table, record, there);
  if (table.kind == "lab_setting") return lookAtSetting(table, record);
  if (table.kind == "erasure") return lookAtErasure(record, there);
  if (isOfSession(table)) return lookAtSessionsRow(table, record, there);
  RETURN_IF_ERROR(lookAtRevision(table, record, there));
  return Verdict::kTake;
}

Result<ImportRules::Verdict> ImportRules::lookAtSessionsRow(const RecordTable& table,
                                                            const RecordJson& record,
                                                            const RecordJson& there) {
  const std::string id = textIn(record, "session");
  if (!there.is_null() || sessions_.contains(id)) return Verdict::kTake;
  const auto bytes = bytesOfHex(id);
  if (!bytes) return bytes.error();
  ASSIGN_OR_RETURN(const bool here,
                   writer_.query("SELECT 1 FROM sessions WHERE id = ?", viewOf(*bytes)).step());
  if (!here) return Verdict::kTake;  // the import says that there is none
  RETURN_IF_ERROR(checkRecord(table, record));
  const std::string session = sessionText(*bytes);
  note(kOfSessions, fmt::format("{} of session {}: left out, the session is here already, and an import "
                                "adds nothing to it",
                                table.kind, session));
  ++left_[std::string(table.kind)];
  if (left_sessions_.size() < kMostSessionsNamed &&
      std::find(left_sessions_.begin(), left_sessions_.end(), session) == left_sessions_.end())
    left_sessions_.push_back(session);
  return Verdict::kLeftOut;
}

std::string ImportRules::leftOutText() const {
  if (left_.empty()) return {};
  std::string counts, sessions;
  for (const auto& [kind, count] : left_)
    counts += fmt::format("{}{} of {}", counts.empty() ? "" : ", ", count, kind);
  for (const std::string& session : left_sessions_) sessions += (sessions.empty() ? "" : ", ") + session;
  return fmt::format("; left out of sessions that are here: {} (such as session {})", counts, sessions);
}

Result<bool> ImportRules::wasHere(const char* table, const char* column, const std::string& name) {
  const auto& mine = std::string_view(table) == "people" ? people_ : groups_;
  if (name.empty() || mine.contains(name)) return false;
  return writer_.query(fmt::format("SELECT 1 FROM {} WHERE {} = ?", table, column), name).step();
}

Result<ImportRules::Verdict> ImportRules::lookAtPolicy(const RecordTable& table, RecordJson& record,
                                                       const RecordJson& there) {
  RETURN_IF_ERROR(checkRecord(table, record));
  const auto policy = policyIn(record);
  RETURN_IF_ERROR(RetentionStore::checkPolicy(policy));
  const std::string text = policyText(policy);
  if (!with_policies_) {
    note(kPolicies, text +
                        ": left out, it would change which recordings are deleted here. Set it by a "
                        "command (retention set), or import with --with-policies");
    return Verdict::kLeftOut;
  }
  if (numberIn(record, "without_backup") != 0) {
    record["without_backup"] = 0;
    note(kPolicies, text +
                        ": taken without without_backup: recordings that no backup has stay. Only a person "
                        "can say otherwise here (retention set)");
  }
  if (there.is_null()) note(kPolicies, text + ": stored");
  return Verdict::kTake;
}

Result<ImportRules::Verdict> ImportRules::lookAtSetting(const RecordTable& table, const RecordJson& record) {
  RETURN_IF_ERROR(checkRecord(table, record));
  ASSIGN_OR_RETURN(const bool required, LabSettingsStore(writer_).codesRequired());
  const bool wanted = textIn(record, "value") == "1";
  if (required == wanted) return Verdict::kTake;
  const std::string text = fmt::format("lab setting: codes of trainees {}", wanted ? "required" : "optional");
  note(kSettings, with_policies_
                      ? text + ": stored"
                      : text + ": left out, here they are " + (required ? "required" : "optional") +
                            ". Set it by a command (lab set), or import with --with-policies");
  return with_policies_ ? Verdict::kTake : Verdict::kLeftOut;
}

Result<ImportRules::Verdict> ImportRules::lookAtErasure(RecordJson& record, const RecordJson& there) {
  const std::string pseudonym = textIn(record, "pseudonym");
  if (!isErasurePseudonym(pseudonym))
    return Error{ErrorCode::kInvalidInput,
                 "pseudonym: must be \"erased-\" and 12 hexadecimal digits, found " + named(pseudonym)};
  // a time that is yet to come would take sessions of whoever gets the name until then
  if (numberIn(record, "erased_unix_ns") > now_unix_ns_) {
    record["erased_unix_ns"] = now_unix_ns_;
    if (!there.is_null() && textIn(there, "name_hash") == textIn(record, "name_hash"))
      record["erased_unix_ns"] = there["erased_unix_ns"];
    else
      note(kErasures,
           "erasure " + named(pseudonym) + ": was made at a time that is yet to come, taken as of now");
  }
  RETURN_IF_ERROR(readAccounts());
  const auto account = accounts_.find(textIn(record, "name_hash"));
  const bool older =
      account != accounts_.end() && account->second.created_unix_ns <= numberIn(record, "erased_unix_ns");
  if (!older && !names_.contains(pseudonym)) return Verdict::kTake;
  note(kErasures,
       "erasure " + named(pseudonym) + ": left out, " + named(older ? account->second.name : pseudonym) +
           " has an account here, and would lose what it records from now on. Erase it here if it is "
           "the same person (person erase)");
  return Verdict::kLeftOut;
}

Status ImportRules::readAccounts() {
  if (accounts_read_) return {};
  accounts_read_ = true;
  std::error_code error;
  const auto folder = writer_.path().parent_path();
  // without a key no hash is that of anybody here
  if (std::filesystem::exists(folder / "pseudonym.key", error)) {
    ASSIGN_OR_RETURN(key_, PseudonymKey::ofFolder(folder));
  }
  auto people = writer_.prepare("SELECT name, created_unix_ns FROM people");
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, people.step());
    if (!more) return {};
    addAccount(people.text(0), people.integer(1));
  }
}

void ImportRules::addAccount(const std::string& name, std::int64_t created_unix_ns) {
  names_.insert(name);
  if (key_)
    accounts_.insert_or_assign(hexDigitsOf(textOf(key_->nameHash(name))), Account{name, created_unix_ns});
}

Status ImportRules::lookAtRevision(const RecordTable& table, const RecordJson& record,
                                   const RecordJson& there) {
  const bool document = table.kind == "profile" || table.kind == "course";
  if (!document && table.kind != "reference") return {};
  const std::string id = textIn(record, document ? "id" : "exercise_id");
  if (!there.is_null()) {
    if (document && textIn(there, "author") == kSampleAuthor &&
        textIn(there, "json") != textIn(record, "json"))
      note(kRevisions, fmt::format("{} {}: replaces the sample that is here", table.kind, named(id)));
    return {};
  }
  const std::string of = std::string(table.kind) + " " + id;
  auto known = newest_.find(of);
  if (known == newest_.end()) {
    auto row = writer_.query(fmt::format("SELECT coalesce(max(revision), 0) FROM {} WHERE {} = ?",
                                         table.table, document ? "id" : "exercise_id"),
                             id);
    RETURN_IF_ERROR(row.step());
    known = newest_.emplace(of, row.integer(0)).first;
  }
  const std::int64_t revision = numberIn(record, "revision");
  if (known->second > 0 && revision > known->second)
    note(kRevisions, fmt::format("{} {}: revision {} holds from now on, here it was {}", table.kind,
                                 named(id), revision, known->second));
  return {};
}

Status ImportRules::noteStored(const RecordTable& table, const RecordJson& record) {
  if (table.kind == "person") {
    people_.insert(textIn(record, "name"));
    if (accounts_read_) addAccount(textIn(record, "name"), numberIn(record, "created_unix_ns"));
    const auto role = static_cast<pb::Role>(numberIn(record, "role"));
    const std::string access = accessText(record);
    if (role == pb::TRAINEE && access.empty()) return {};
    note(role == pb::ADMINISTRATOR ? kAdministrators
         : role == pb::TRAINEE     ? kTrainees
                                   : kStaff,
         fmt::format("{} {} is new here, with {}{}", roleName(role), named(textIn(record, "name")),
                     access.empty() ? "no password" : access,
                     numberIn(record, "disabled") != 0 ? ", disabled" : ""));
  } else if (table.kind == "station") {
    if (textIn(record, "key_hash").empty() || numberIn(record, "revoked") != 0) return {};
    note(kStations, "station " + named(textIn(record, "name")) + " is new here, with its key");
  } else if (table.kind == "consent") {
    const std::string person = textIn(record, "person"), by = textIn(record, "recorded_by");
    note(kConsents, fmt::format("{} {} to studies, {}, {}", named(person),
                                numberIn(record, "given") != 0 ? "consents" : "does not consent",
                                by == person ? "by the person" : "on paper, by " + named(by),
                                localTime(numberIn(record, "unix_ns"), TimeForm::kZoned)));
  } else if (table.kind == "erasure") {
    // one that does not say it takes nothing that comes later: that may be another person's
    if (isGiven(record, "without_account") && numberIn(record, "without_account") == 0) return {};
    return MetaStore(writer_).set(std::string(kWithoutAccountKey) + textIn(record, "pseudonym"), "");
  } else if (table.kind == "group") {
    groups_.insert(textIn(record, "id"));
  } else if (table.kind == "group_member") {
    const std::string group = textIn(record, "group_id"), person = textIn(record, "person");
    ASSIGN_OR_RETURN(const bool of_group, wasHere("groups", "id", group));
    ASSIGN_OR_RETURN(const bool of_person, wasHere("people", "name", person));
    if (of_group || of_person)
      note(kMembers, fmt::format("{} is in group {} from now on", named(person), named(group)));
  } else if (table.kind == "assignment") {
    const std::string group = textIn(record, "group_id"), trainee = textIn(record, "trainee");
    ASSIGN_OR_RETURN(const bool to_group, wasHere("groups", "id", group));
    ASSIGN_OR_RETURN(const bool to_person, wasHere("people", "name", trainee));
    if (to_group || to_person)
      note(kAssignments, fmt::format("{} {} gets an assignment by {}", to_group ? "group" : "trainee",
                                     named(to_group ? group : trainee), named(textIn(record, "by_whom"))));
  } else if (table.kind == "session") {
    const std::string id = textIn(record, "id"), trainee = textIn(record, "trainee");
    sessions_.insert(id);
    ASSIGN_OR_RETURN(const bool here, wasHere("people", "name", trainee));
    if (here) note(kNewSessions, fmt::format("session {} is new here, of {}", textOfId(id), named(trainee)));
  } else if (table.kind == "annotation") {
    const std::string author = textIn(record, "author");
    ASSIGN_OR_RETURN(const bool here, wasHere("people", "name", author));
    if (here)
      note(kRemarks, fmt::format("a remark in the name of {} is new here, on session {}", named(author),
                                 textOfId(textIn(record, "session"))));
  }
  return {};
}

void ImportRules::note(Kind kind, const std::string& text) {
  Lines& lines = lines_[kind];
  if (++lines.count <= kMostNotes) lines.first.push_back(text);
}

std::vector<std::string> ImportRules::notes() const {
  constexpr std::array<std::string_view, kKinds> kNames = {"rows of sessions that are here",
                                                           "retention policies",
                                                           "administrators",
                                                           "other staff",
                                                           "stations with keys",
                                                           "settings",
                                                           "erasures",
                                                           "revisions",
                                                           "trainees with passwords or codes",
                                                           "consents",
                                                           "new sessions of people who are here",
                                                           "remarks in the names of people who are here",
                                                           "members of groups",
                                                           "assignments"};
  std::vector<std::string> all;
  for (std::size_t kind = 0; kind < kKinds; ++kind) {
    const Lines& lines = lines_[kind];
    all.insert(all.end(), lines.first.begin(), lines.first.end());
    if (lines.count > kMostNotes)
      all.push_back(fmt::format("and {} more lines on {}", lines.count - kMostNotes, kNames[kind]));
  }
  return all;
}

}  // namespace needlelab
