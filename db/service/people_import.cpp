// Imports a class from a table: checks every row first, then stores all rows or none.
#include <fmt/core.h>
#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/csv_rows.h"
#include "common/base/result.h"
#include "common/base/secret.h"
#include "common/base/text.h"
#include "db/audit.h"
#include "db/credentials.h"
#include "db/people.h"
#include "db/person_name.h"
#include "db/service/handlers.h"
#include "db/service/requests.h"

namespace needlelab::handlers {
namespace {

constexpr std::size_t kMostImportRows = 5000;
constexpr std::size_t kMostImportSecrets = 200;  // passwords and codes; each takes 0.1 s
/// Memberships that one table may name, and those that the groups may have together which it adds people to:
/// the writer stores each of them again, for which others wait some 0.5 s.
constexpr std::size_t kMostImportMemberships = 20'000;
/// Rows that give somebody rights: a role other than trainee, another role, a password, a code. All of them
/// are told, before rows that give none.
constexpr std::size_t kMostRightsGiven = 300;
constexpr int kMostRowsTold = 2000;
constexpr std::size_t kMostBytesTold = 600'000;
static_assert(kMostRightsGiven >= kMostImportSecrets);
// a row has two full names of 200 bytes, some names of groups, and words
static_assert(kMostRightsGiven * (2 * 200 + 10 * kMaxNameBytes + 500) < kMostBytesTold);
static_assert(kMostBytesTold + kMostImportRows * (kMaxNameBytes + 3) <
              kMaxReplyBytes);  // PeopleImport.roles_changed

/// A row to import.
struct ImportRow {
  std::uint32_t line = 0;
  Person person;
  std::string password, code;
  std::vector<std::string> groups;
  pb::PeopleImport::What what = pb::PeopleImport::ADD;
  std::string text, column;  ///< the problem and its column
  bool role_given = false, full_name_given = false, has_password = false, has_code = false;
  bool role_changes = false;
  bool code_taken = false;  ///< the code becomes the person's

  /// Compared rows: see kMostRightsGiven.
  [[nodiscard]] bool givesRights() const {
    const bool is_new = what == pb::PeopleImport::ADD;
    return (is_new && (person.role != pb::TRAINEE || has_password)) ||
           ((is_new || what == pb::PeopleImport::CHANGE) && (role_changes || code_taken));
  }

  void fault(const std::string& in_column, const std::string& words) {
    if (what == pb::PeopleImport::FAULT) return;
    what = pb::PeopleImport::FAULT;
    column = in_column;
    text = words;
  }
};

/// Ids separated by ';', with optional spaces.
std::vector<std::string> idsOf(const std::string& cell) {
  std::vector<std::string> ids;
  for (std::size_t at = 0; at <= cell.size();) {
    const std::size_t end = std::min(cell.find(';', at), cell.size());
    std::size_t from = at, to = end;
    while (from < to && cell[from] == ' ') ++from;
    while (to > from && cell[to - 1] == ' ') --to;
    if (to > from) ids.push_back(cell.substr(from, to - from));
    at = end + 1;
  }
  return ids;
}

/// "4.71221E+11", which a spreadsheet makes of 471221000123; also with a comma.
bool isRoundedNumber(std::string_view code) {
  const auto passDigits = [&] {
    const std::size_t digits = std::min(code.find_first_not_of("0123456789"), code.size());
    code.remove_prefix(digits);
    return digits > 0;
  };
  if (!passDigits()) return false;
  if (code.starts_with('.') || code.starts_with(',')) {
    code.remove_prefix(1);
    if (!passDigits()) return false;
  }
  if (!code.starts_with('E') && !code.starts_with('e')) return false;
  code.remove_prefix(1);
  if (!code.starts_with('+') && !code.starts_with('-')) return false;
  code.remove_prefix(1);
  return passDigits() && code.empty();
}

std::string standsAlready(const ImportRow& first, const std::string& name) {
  if (first.person.name == name) return fmt::format("stands in line {} already", first.line);
  return fmt::format(
      "stands in line {} already, written '{}': is it the same person? Then leave one of the two "
      "lines out, else take another name",
      first.line, first.person.name);
}

class PeopleTable {
 public:
  explicit PeopleTable(const Context& context) : context_(context) {}
  PeopleTable(const PeopleTable&) = delete;
  PeopleTable& operator=(const PeopleTable&) = delete;
  ~PeopleTable() { wipeSecrets(); }

  /// kInvalidInput: a fault of the table as a whole.
  Status read(const std::string& csv, std::size_t lines_above) {
    if (!isUtf8(csv))
      return Error{ErrorCode::kInvalidInput, "csv: is not UTF-8: save the table as \"CSV UTF-8\""};
    CsvRows rows(withoutMark(csv), lines_above);
    for (bool is_header = true;; is_header = false) {
      const auto there = rows.next();
      if (!there.ok()) return Error{there.error().code, "csv: " + there.error().message};
      if (is_header) RETURN_IF_ERROR(readHeader(*there, rows));
      if (!*there) break;
      if (is_header) continue;
      if (rows_.size() == kMostImportRows)
        return Error{ErrorCode::kInvalidInput,
                     fmt::format("csv: has more than {} rows: split it", kMostImportRows)};
      add(rows);
    }
    if (rows_.empty()) return Error{ErrorCode::kInvalidInput, "csv: has a header and no rows"};
    RETURN_IF_ERROR(checkMemberships());
    std::size_t secrets = 0;
    for (const ImportRow& row : rows_) secrets += (row.password.empty() ? 0 : 1) + (row.code.empty() ? 0 : 1);
    if (secrets > kMostImportSecrets)
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("csv: has {} passwords and codes, at most {} are taken at once (each takes a "
                               "tenth of a second): split the table; trainees who only practise need no "
                               "password",
                               secrets, kMostImportSecrets)};
    faultEqualCodes();
    return {};
  }

  /// Compares with the stored people. Reader or writer. kInvalidInput: more than kMostRightsGiven rows.
  Status compare(Connection& connection) {
    std::size_t giving = 0;
    for (ImportRow& row : rows_) {
      if (row.what == pb::PeopleImport::FAULT) continue;
      RETURN_IF_ERROR(compareRow(connection, row));
      giving += row.givesRights() ? 1 : 0;
      if (giving > kMostRightsGiven)
        return at(row, Error{ErrorCode::kInvalidInput,
                             fmt::format("up to here {} rows give a role other than trainee, another role, a "
                                         "password or a code; at most {} are taken at once, because the "
                                         "report names each of them: split the table",
                                         giving, kMostRightsGiven)});
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
    wipeSecrets();
    return {};
  }

  /// Whether a password or code is to be stored that was not when the others were hashed.
  [[nodiscard]] bool lacksHashes() const {
    return std::any_of(rows_.begin(), rows_.end(), [](const ImportRow& row) {
      const bool password_taken = row.what == pb::PeopleImport::ADD && row.has_password;
      return (password_taken && row.person.password_hash.empty()) ||
             (row.code_taken && row.person.code_hash.empty());
    });
  }

  /// In the writer's transaction.
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
      auto group = GroupStore(writer).get(id);
      if (!group && group.error().code != ErrorCode::kNotFound) return group.error();
      pb::Group wanted = group ? *group : pb::Group();
      std::set<std::string>& names = joins.names;
      wanted.set_id(id);
      if (!group) wanted.set_name(id);
      names.insert(wanted.members().begin(), wanted.members().end());
      memberships += names.size();
      if (memberships > kMostImportMemberships)
        return Error{
            ErrorCode::kInvalidInput,
            fmt::format("csv: line {}: with group '{}', the groups that people join have more than {} "
                        "members together: split the table by groups",
                        joins.line, id, kMostImportMemberships)};
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

  /// Tells faults, then rows that give rights, then the others. Without faults all rows that give rights fit.
  void report(pb::PeopleImport& report) const {
    enum class Told { kFault, kRights, kOther };
    std::size_t bytes = 0;
    for (const Told turn : {Told::kFault, Told::kRights, Told::kOther}) {
      for (const ImportRow& row : rows_) {
        const Told kind = row.what == pb::PeopleImport::FAULT ? Told::kFault
                          : row.givesRights()                 ? Told::kRights
                                                              : Told::kOther;
        if (kind != turn || report.rows_size() >= kMostRowsTold) continue;
        pb::PeopleImport::Row told;
        told.set_line(row.line);
        told.set_name(printable(row.person.name));
        told.set_what(row.what);
        told.set_text(row.text);
        told.set_column(row.column);
        bytes += told.ByteSizeLong() + 8;
        if (bytes <= kMostBytesTold) *report.add_rows() = std::move(told);
      }
    }
    report.set_rows_left_out(static_cast<std::uint32_t>(rows_.size()) -
                             static_cast<std::uint32_t>(report.rows_size()));
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
  void tellRoles(pb::PeopleImport& report) const {
    for (const ImportRow& row : rows_) {
      if (row.what == pb::PeopleImport::CHANGE && row.role_changes) report.add_roles_changed(row.person.ref);
    }
  }

 private:
  /// Who joins a group, by the first line that names it.
  struct Joining {
    std::uint32_t line = 0;
    std::set<std::string> names;
  };

  /// kInvalidInput: together, the rows name more groups than kMostImportMemberships.
  [[nodiscard]] Status checkMemberships() const {
    std::size_t named = 0;
    for (const ImportRow& row : rows_) {
      named += row.groups.size();
      if (named > kMostImportMemberships)
        return Error{
            ErrorCode::kInvalidInput,
            fmt::format("csv: line {}: the people up to here join {} groups, counted for each; at most {} "
                        "are taken at once: split the table",
                        row.line, named, kMostImportMemberships)};
    }
    return {};
  }

  /// Adds one audit line per changed person, so that a search by name finds it.
  Status note(Connection& writer, const std::string& subject, const std::string& action,
              const std::string& detail) {
    return AuditStore(writer).add({0, context_.now_unix_ns, context_.who.name, action, subject, detail});
  }

  void wipeSecrets() {
    for (ImportRow& row : rows_) {
      wipe(row.password);
      wipe(row.code);
    }
  }

  static Error at(const ImportRow& row, const Error& error) {
    return {error.code,
            fmt::format("line {}, '{}': {}", row.line, printable(row.person.name), error.message)};
  }

  /// A badge that several people have opens the lessons of none of them.
  void faultEqualCodes() {
    for (ImportRow& row : rows_) {
      if (!row.has_code) continue;
      for (const ImportRow& other : rows_)
        if (&other != &row && other.code == row.code)
          row.fault("code", fmt::format("is the code of line {}, too", other.line));
    }
  }

  Status readHeader(bool is_there, const CsvRows& rows) {
    if (!is_there) return Error{ErrorCode::kInvalidInput, "csv: is empty; the first line names the columns"};
    static constexpr std::string_view kColumns[] = {"name", "full_name", "role", "group", "password", "code"};
    const auto cells = rows.cells();
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (cells[i].empty()) {
        unnamed_.push_back(i);
        continue;
      }
      width_ = i + 1;
      const auto* const column = std::find_if(std::begin(kColumns), std::end(kColumns),
                                              [&](std::string_view one) { return isColumn(cells[i], one); });
      if (column == std::end(kColumns))
        return Error{
            ErrorCode::kInvalidInput,
            fmt::format("csv: column '{}' is none of name, full_name, role, group, password, code: {}",
                        printable(std::string(cells[i])), headerText(cells, rows.separator()))};
      if (!columns_.emplace(std::string(*column), i).second)
        return Error{ErrorCode::kInvalidInput, fmt::format("csv: column '{}' is there twice", *column)};
    }
    if (columns_.contains("name")) return {};
    return Error{ErrorCode::kInvalidInput,
                 "csv: there is no column 'name': " + headerText(cells, rows.separator())};
  }

  void add(const CsvRows& rows) {
    ImportRow row;
    row.line = static_cast<std::uint32_t>(rows.line());
    const auto cells = rows.cells();
    const auto cell = [&](const std::string& column) {
      const auto found = columns_.find(column);
      return found == columns_.end() || found->second >= cells.size() ? std::string()
                                                                      : std::string(cells[found->second]);
    };
    row.person.name = trimmedName(cell("name"));
    row.person.full_name = cell("full_name");
    row.full_name_given = !row.person.full_name.empty();
    row.password = cell("password");
    row.has_password = !row.password.empty();
    row.code = cell("code");
    row.has_code = !row.code.empty();
    row.groups = idsOf(cell("group"));
    row.person.created_unix_ns = context_.now_unix_ns;
    row.person.role = pb::TRAINEE;
    std::size_t width = cells.size();
    while (width > width_ && cells[width - 1].empty()) --width;
    if (width != width_) row.fault("", fmt::format("has {} cells, the header has {}", width, width_));
    for (const std::size_t unnamed : unnamed_)
      if (unnamed < cells.size() && !cells[unnamed].empty())
        row.fault("",
                  fmt::format("has a cell in column {}, whose name is missing in the header", unnamed + 1));
    if (const std::string role = cell("role"); !role.empty()) {
      row.role_given = true;
      row.person.role = roleOfName(role == "manager" ? "curriculum-manager"
                                   : role == "admin" ? "administrator"
                                                     : role);
      if (row.person.role == pb::ROLE_UNSPECIFIED || row.person.role == pb::STATION)
        row.fault("role",
                  "'" + printable(role) +
                      "', allowed are trainee, instructor, curriculum-manager, administrator, researcher");
    }
    const auto check = [&](const char* column, const Status& valid) {
      if (!valid) row.fault(column, valid.error().message);
    };
    check("name", checkName("name", row.person.name));
    check("full_name", checkNewText("full_name", row.person.full_name, 0, 200));
    if (row.groups.size() > kMaxGroupsOfPerson)
      row.fault("group", fmt::format("has {} groups, a person is in at most {}", row.groups.size(),
                                     kMaxGroupsOfPerson));
    for (const std::string& group : row.groups) {
      check("group", checkName("group", group));
      if (group.find(',') != std::string::npos)
        row.fault("group", "'" + printable(group) +
                               "' has a comma: groups are separated by semicolons, within quotes where the "
                               "columns are, too");
    }
    if (!row.password.empty() &&
        (row.password.size() < kMinPasswordBytes || row.password.size() > kMaxPasswordBytes))
      row.fault("password", fmt::format("has {} bytes, allowed are {} to {}", row.password.size(),
                                        kMinPasswordBytes, kMaxPasswordBytes));
    else if (!row.password.empty() && row.person.role != pb::TRAINEE)
      check("password", checkStaffPassword(row.password, row.person.name));
    if (row.has_code) check("code", checkCode(row.code));
    if (isRoundedNumber(row.code))
      row.fault("code",
                "is a number that a spreadsheet has rounded (as 4.7E+11): format the column as text, and put "
                "the codes in again");
    if (row.what != pb::PeopleImport::FAULT) {
      const auto [first, is_new] = lines_.emplace(nameKey(row.person.name), rows_.size());
      if (!is_new) row.fault("name", standsAlready(rows_[first->second], row.person.name));
    }
    rows_.push_back(std::move(row));
  }

  Status compareRow(Connection& connection, ImportRow& row) {
    ASSIGN_OR_RETURN(auto there, PeopleStore(connection).findNamed(row.person.name));
    // another spelling is asked about below
    const auto same = there;
    if (there && there->name != row.person.name) there.reset();
    row.person.ref = there ? there->ref : std::string();
    ASSIGN_OR_RETURN(const auto groups, GroupStore(connection).groupsOf(row.person.ref));
    std::vector<std::string> joined;
    for (const std::string& group : row.groups) {
      if (!std::binary_search(groups.begin(), groups.end(), group)) joined.push_back(group);
    }
    // not all: what stands behind them must fit into the line of the audit log, too
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
  std::map<std::string, std::size_t, std::less<>> columns_;
  std::vector<std::size_t> unnamed_;          ///< columns without a name
  std::size_t width_ = 0;                     ///< cells of the header, up to its last name
  std::map<std::string, std::size_t> lines_;  ///< indices into rows_, by nameKey()
  std::vector<ImportRow> rows_;
};

}  // namespace

Result<pb::Reply> importPeople(const Context& context, const pb::ImportPeople& call) {
  PeopleTable table(context);
  RETURN_IF_ERROR(table.read(call.csv(), call.lines_above()));
  RETURN_IF_ERROR(table.compare(context.reader));
  pb::Reply reply;
  auto* report = reply.mutable_people_import();
  if (table.hasFaults() || call.dry_run()) {
    table.report(*report);
    return reply;
  }
  RETURN_IF_ERROR(table.hashSecrets());
  std::string detail;
  const Status written = write(context, "", detail, [&](Connection& writer) -> Status {
    // compare again: people may have changed while passwords and codes were hashed
    RETURN_IF_ERROR(table.compare(writer));
    if (table.hasFaults() || table.lacksHashes())
      return Error{ErrorCode::kConflict, "people were changed meanwhile: try again"};
    pb::PeopleImport counts;
    table.report(counts);
    detail = fmt::format("{} added, {} changed, {} as they were; {} with a role, a password or a code",
                         counts.added(), counts.changed(), counts.unchanged(), counts.rights_given());
    return table.store(writer);
  });
  if (!written) return written.error();
  table.report(*report);
  table.tellRoles(*report);
  report->set_done(true);
  return reply;
}

}  // namespace needlelab::handlers
