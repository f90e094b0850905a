// Imports a class from a table: checks every row first, then stores all rows or none.
#include <fmt/core.h>
#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/text.h"
#include "db/audit/audit.h"
#include "db/login/credentials.h"
#include "db/people/look_alikes.h"
#include "db/people/people.h"
#include "db/people/person_name.h"
#include "db/service/requests/handlers.h"
#include "db/service/requests/people/import_table.h"

namespace needlelab::handlers {
namespace {

/// Limit on rows that give rights: a role other than trainee, a changed role, a password, a code. All of them
/// are reported, before the other rows.
constexpr std::size_t kMaxRightsGiven = 300;
constexpr int kMaxRowsTold = 2000;
constexpr std::size_t kMaxReportBytes = 600'000;
constexpr std::size_t kMaxColumnsTold = 100;
static_assert(kMaxRightsGiven >= kMaxImportSecrets);
// a row has two full names of 200 bytes, some group names, and words
static_assert(kMaxRightsGiven * (2 * 200 + 10 * kMaxNameBytes + 500) +
                  kMaxColumnsTold * (kMaxColumnBytes + 100) <
              kMaxReportBytes);
static_assert(kMaxReportBytes + kMaxImportRows * (kMaxNameBytes + 3) <
              kMaxReplyBytes);  // PeopleImport.roles_changed

/// Compares a table's rows with the stored people, and stores them.
class PeopleImporter {
 public:
  PeopleImporter(const Context& context, ImportTable& table)
      : context_(context), table_(table), rows_(table.rows()) {}

  /// Compares with the stored people. Reader or writer. kInvalidInput: more than kMaxRightsGiven rows give
  /// rights.
  Status compare(Connection& connection) {
    std::size_t giving = 0;
    ASSIGN_OR_RETURN(auto groups, ThingNames::read(connection, Thing::kGroup));
    ASSIGN_OR_RETURN(const auto there, numbers(connection));
    for (ImportRow& row : rows_) {
      if (row.what == pb::PeopleImport::FAULT) continue;
      row.new_groups.clear();
      RETURN_IF_ERROR(compareRow(connection, row));
      for (const std::string& group : row.groups) compareGroup(groups, row, group);
      if (const auto other = there.find(withoutZeros(row.person.name));
          other != there.end() && row.person.ref.empty())
        row.fault("name",
                  fmt::format("looks like '{0}' but for zeros at the left: is it the same person? Then "
                              "write '{0}', else take another name",
                              other->second));
      giving += row.givesRights() ? 1 : 0;
      if (giving > kMaxRightsGiven)
        return at(row, Error{ErrorCode::kInvalidInput,
                             fmt::format("up to here {} rows give a role other than trainee, another role, a "
                                         "password or a code; at most {} are taken at once, because the "
                                         "report names each of them: split the table",
                                         giving, kMaxRightsGiven)});
    }
    return {};
  }

  [[nodiscard]] bool hasFaults() const {
    return std::any_of(rows_.begin(), rows_.end(),
                       [](const auto& row) { return row.what == pb::PeopleImport::FAULT; });
  }

  /// Hashes the passwords and codes, which is slow, before anything is stored.
  Status hashSecrets() {
    for (ImportRow& row : rows_) {
      if (row.what == pb::PeopleImport::ADD && row.has_password) {
        ASSIGN_OR_RETURN(row.person.password_hash, hashPassword(row.password));
      }
      if (row.code_taken) {
        ASSIGN_OR_RETURN(row.person.code_hash, hashCode(row.code));
      }
    }
    table_.wipeSecrets();
    return {};
  }

  /// Whether a password or code is to be stored that was not hashed with the others.
  [[nodiscard]] bool lacksHashes() const {
    return std::any_of(rows_.begin(), rows_.end(), [](const ImportRow& row) {
      const bool password_taken = row.what == pb::PeopleImport::ADD && row.has_password;
      return (password_taken && row.person.password_hash.empty()) ||
             (row.code_taken && row.person.code_hash.empty());
    });
  }

  /// Call in the writer's transaction.
  Status store(Connection& writer) {
    std::map<std::string, Joining> joining;
    for (ImportRow& row : rows_) {
      if (row.what == pb::PeopleImport::ADD) {
        if (auto done = PeopleStore(writer).add(row.person, &row.person.ref); !done)
          return at(row, done.error());
      } else if (row.what == pb::PeopleImport::CHANGE) {
        PersonChange change;
        if (row.role_given) change.role = row.person.role;
        if (row.full_name_given) change.full_name = row.person.full_name;
        const auto done =
            PeopleStore(writer).change(row.person.ref, {}, change, context_.who.name, context_.now_unix_ns);
        if (!done) return at(row, done.error());
        if (row.code_taken) {
          RETURN_IF_ERROR(PeopleStore(writer).setCodeHash(row.person.ref, row.person.code_hash));
        }
      }
      if (row.what != pb::PeopleImport::NOTHING) {
        RETURN_IF_ERROR(note(writer, row.person.ref, "user import", row.text));
      }
      for (const std::string& group : row.groups) {
        Joining& joins = joining.try_emplace(group, Joining{row.line, {}}).first->second;
        joins.names.insert(row.person.ref);
      }
    }
    std::size_t memberships = 0;
    for (auto& [id, joins] : joining) {
      ASSIGN_OR_RETURN(const auto group, GroupStore(writer).find(id));
      pb::Group wanted = group ? *group : pb::Group();
      std::set<std::string>& names = joins.names;
      wanted.set_id(id);
      if (!group) wanted.set_name(id);
      names.insert(wanted.members().begin(), wanted.members().end());
      memberships += names.size();
      if (memberships > kMaxImportMemberships)
        return Error{
            ErrorCode::kInvalidInput,
            fmt::format("csv: line {}: with group '{}', the groups that people join have more than {} "
                        "members together: split the table by groups",
                        joins.line, id, kMaxImportMemberships)};
      wanted.clear_members();
      for (const std::string& name : names) wanted.add_members(name);
      ASSIGN_OR_RETURN(const auto put,
                       GroupStore(writer).put(wanted, {}, context_.who.name, context_.now_unix_ns));
      const pb::Group before = group ? *group : pb::Group();
      if (put.revision() == before.revision()) continue;
      RETURN_IF_ERROR(note(writer, id, "group set", groupChange(before, put)));
    }
    return {};
  }

  /// Reports the columns of a foreign header (rows without `what`; `column` is the header's word, `name` what
  /// it is taken as), then faults, then rows that give rights, then the others. Without faults, all rows that
  /// give rights fit.
  /// Before the import it names new groups; a row with a question names its column.
  void report(pb::PeopleImport& report, bool before_import) const {
    enum class Told { kFault, kRights, kAsked, kOther };
    const auto columns = table_.foreignColumns();
    for (const ImportColumn& column : columns.first(std::min(columns.size(), kMaxColumnsTold))) {
      auto& told = *report.add_rows();
      told.set_line(table_.headerLine());
      told.set_name(column.taken_as);
      told.set_column(column.cell);
      told.set_text(column.taken_as.empty()
                        ? "ignored"
                        : "is the " + (column.taken_as == "name" ? "account" : wordsOfName(column.taken_as)));
    }
    const int columns_told = report.rows_size();
    std::size_t bytes = report.ByteSizeLong();
    for (const Told turn : {Told::kFault, Told::kRights, Told::kAsked, Told::kOther}) {
      for (const ImportRow& row : rows_) {
        const Told kind = row.what == pb::PeopleImport::FAULT ? Told::kFault
                          : row.givesRights()                 ? Told::kRights
                          : !row.question.empty()             ? Told::kAsked
                                                              : Told::kOther;
        if (kind != turn || report.rows_size() >= kMaxRowsTold) continue;
        pb::PeopleImport::Row told;
        told.set_line(row.line);
        told.set_name(printable(row.person.name));
        told.set_what(row.what);
        told.set_text(row.text);
        told.set_column(row.column);
        if (row.what != pb::PeopleImport::FAULT) {
          if (!row.new_groups.empty() && before_import)
            told.mutable_text()->append("; new group: " + someNames(row.new_groups));
          if (!row.question.empty()) told.mutable_text()->append("; " + row.question);
          told.set_column(row.asked_column);
        }
        bytes += told.ByteSizeLong() + 8;
        if (bytes <= kMaxReportBytes) *report.add_rows() = std::move(told);
      }
    }
    report.set_rows_left_out(static_cast<std::uint32_t>(rows_.size()) -
                             static_cast<std::uint32_t>(report.rows_size() - columns_told));
    const auto count = [&](pb::PeopleImport::What what) {
      return static_cast<std::uint32_t>(
          std::count_if(rows_.begin(), rows_.end(), [&](const auto& row) { return row.what == what; }));
    };
    report.set_added(count(pb::PeopleImport::ADD));
    report.set_changed(count(pb::PeopleImport::CHANGE));
    report.set_unchanged(count(pb::PeopleImport::NOTHING));
    report.set_faults(count(pb::PeopleImport::FAULT));
    report.set_rights_given(static_cast<std::uint32_t>(
        std::count_if(rows_.begin(), rows_.end(), [](const auto& row) { return row.givesRights(); })));
  }

  /// Lists the people whose connections must end after the import.
  void reportRoles(pb::PeopleImport& report) const {
    for (const ImportRow& row : rows_) {
      if (row.what == pb::PeopleImport::CHANGE && row.role_changes) report.add_roles_changed(row.person.ref);
    }
  }

 private:
  /// The number without zeros at its left; "": not a number.
  static std::string withoutZeros(const std::string& name) {
    const std::size_t first = name.find_first_not_of('0');
    const bool is_number = name.find_first_not_of("0123456789") == std::string::npos;
    return is_number && first != std::string::npos ? name.substr(first) : std::string();
  }

  /// Accounts that are numbers, by withoutZeros().
  static Result<std::map<std::string, std::string>> numbers(Connection& connection) {
    ASSIGN_OR_RETURN(const auto names, connection.prepare("SELECT name FROM accounts").all(firstText));
    std::map<std::string, std::string> found;
    for (const std::string& name : names)
      if (std::string rest = withoutZeros(name); !rest.empty()) found.emplace(std::move(rest), name);
    return found;
  }

  /// Notes a group that neither the store nor an earlier row has, unless a person must be asked about it.
  static void compareGroup(ThingNames& groups, ImportRow& row, const std::string& group) {
    if (groups.has(group)) return;
    if (const std::string made = madeByTableProgram(group); !made.empty())
      return row.fault("group", fmt::format("'{}' is {}: format the column as text", group, made));
    if (const std::string question = groups.question(group); !question.empty())
      return row.fault("group", question);
    groups.add(group, group);
    row.new_groups.push_back(group);
  }

  /// The people who join a group, and the first line that names it.
  struct Joining {
    std::uint32_t line = 0;
    std::set<std::string> names;
  };

  /// Adds one audit line per changed person, so that a search by name finds it.
  Status note(Connection& writer, const std::string& subject, const std::string& action,
              const std::string& detail) {
    return AuditStore(writer).add({0, context_.now_unix_ns, context_.who.name, action, subject, detail});
  }

  static Error at(const ImportRow& row, const Error& error) {
    return {error.code,
            fmt::format("line {}, '{}': {}", row.line, printable(row.person.name), error.message)};
  }

  Status compareRow(Connection& connection, ImportRow& row) {
    ASSIGN_OR_RETURN(auto there, PeopleStore(connection).findNamed(row.person.name));
    // a different spelling is queried below
    const auto same = there;
    if (there && there->name != row.person.name) there.reset();
    row.person.ref = there ? there->ref : std::string();
    ASSIGN_OR_RETURN(const auto groups, GroupStore(connection).groupsOf(row.person.ref));
    std::vector<std::string> joined;
    for (const std::string& group : row.groups) {
      if (!std::binary_search(groups.begin(), groups.end(), group)) joined.push_back(group);
    }
    // not all names: the text after them must fit into the audit line, too
    const std::string joins = joined.empty() ? "" : "joins " + someNames(joined);
    const auto checkGroups = [&] {
      if (!joined.empty() && groups.size() + joined.size() > kMaxGroupsOfPerson)
        row.fault("group", fmt::format("is in {} groups and joins {} more, a person is in at most {}",
                                       groups.size(), joined.size(), kMaxGroupsOfPerson));
    };
    row.code_taken = row.has_code && (!there || there->code_hash.empty());
    if (!there) {
      row.what = pb::PeopleImport::ADD;
      row.text = "added as " + std::string(roleName(row.person.role)) + (joins.empty() ? "" : ", " + joins) +
                 (row.has_password ? ", with a password" : "") + (row.has_code ? ", with a code" : "");
      if (const std::string made = madeByTableProgram(row.person.name); !made.empty())
        row.fault("name", "is " + made + ": format the column as text, and put the accounts in again");
      if (auto valid = checkNewPersonName("name", row.person.name); !valid)
        row.fault("name", valid.error().message);
      if (same) row.fault("name", sameNameQuestion(same->name, row.person.name));
      if (auto may = mayManage(context_, row.person.role); !may) row.fault("role", may.error().message);
      if (!row.has_password && row.person.role != pb::TRAINEE)
        row.fault("password", "is missing: only trainees do without");
      checkGroups();
      return {};
    }
    const Person& before = *there;
    if (row.asked_column == "name") row.question = row.asked_column = "";
    row.text.clear();
    row.role_changes = false;
    const auto addDetail = [&](const std::string& words) {
      row.text += (row.text.empty() ? "" : "; ") + words;
    };
    if (row.role_given && row.person.role != before.role) {
      if (auto may = mayManage(context_, before.role); !may) row.fault("role", may.error().message);
      if (auto may = mayChangeRole(context_, before.role, row.person.role); !may)
        row.fault("role", may.error().message);
      if (row.person.role != pb::TRAINEE && before.password_hash.empty())
        row.fault("role", "has no password, and only trainees do without");
      row.role_changes = true;
      addDetail("role: " + std::string(roleName(before.role)) + " to " +
                std::string(roleName(row.person.role)));
    }
    if (!joins.empty()) addDetail(joins);
    if (row.code_taken) {
      if (auto may = mayManage(context_, before.role); !may)
        row.fault("code", may.error().message);
      else
        addDetail("given the code");
    }
    if (row.full_name_given && row.person.full_name != before.full_name) {
      if (auto may = mayManage(context_, before.role); !may) row.fault("full_name", may.error().message);
      addDetail("full name");
    }
    checkGroups();
    if (row.what == pb::PeopleImport::FAULT) return {};
    row.what = row.text.empty() ? pb::PeopleImport::NOTHING : pb::PeopleImport::CHANGE;
    if (row.text.empty()) row.text = "is there already";
    if (row.has_password) row.text += "; the password is left as it is";
    if (row.has_code && !row.code_taken) row.text += "; has a code, which is left as it is";
    return {};
  }

  const Context& context_;
  ImportTable& table_;
  std::vector<ImportRow>& rows_;
};

}  // namespace

Result<pb::Reply> importPeople(const Context& context, const pb::ImportPeople& call) {
  ImportTable table(context.now_unix_ns);
  RETURN_IF_ERROR(table.read(call.csv(), call.lines_above()));
  PeopleImporter people(context, table);
  RETURN_IF_ERROR(people.compare(context.reader));
  pb::Reply reply;
  auto* report = reply.mutable_people_import();
  if (people.hasFaults() || call.dry_run()) {
    people.report(*report, true);
    return reply;
  }
  RETURN_IF_ERROR(people.hashSecrets());
  std::string detail;
  const Status written = write(context, "", detail, [&](Connection& writer) -> Status {
    // compare again: people may have changed while passwords and codes were hashed
    RETURN_IF_ERROR(people.compare(writer));
    if (people.hasFaults() || people.lacksHashes())
      return Error{ErrorCode::kConflict, "people were changed meanwhile: try again"};
    pb::PeopleImport counts;
    people.report(counts, false);
    detail = fmt::format("{} added, {} changed, {} as they were; {} with a role, a password or a code",
                         counts.added(), counts.changed(), counts.unchanged(), counts.rights_given());
    return people.store(writer);
  });
  if (!written) return written.error();
  people.report(*report, false);
  people.reportRoles(*report);
  report->set_done(true);
  return reply;
}

}  // namespace needlelab::handlers
