#include "db/service/requests/people/import_table.h"

#include <fmt/core.h>
#include <algorithm>
#include <iterator>

#include "common/base/secret.h"
#include "common/base/text/text.h"
#include "db/login/credentials.h"
#include "db/people/person_name.h"
#include "db/service/context/principal.h"

namespace needlelab {
namespace {

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

/// "4.71221E+11" (or with a comma), which a spreadsheet makes of 471221000123.
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

std::string duplicateText(const ImportRow& first, const std::string& name) {
  if (first.person.name == name) return fmt::format("stands in line {} already", first.line);
  return fmt::format(
      "stands in line {} already, written '{}': is it the same person? Then leave one of the two "
      "lines out, else take another name",
      first.line, first.person.name);
}

}  // namespace

Status ImportTable::read(const std::string& csv, std::size_t lines_above) {
  if (!isUtf8(csv))
    return Error{ErrorCode::kInvalidInput, "csv: is not UTF-8: save the table as \"CSV UTF-8\""};
  CsvRows rows(withoutMark(csv), lines_above);
  for (bool is_header = true;; is_header = false) {
    const auto there = rows.next();
    if (!there.ok()) return Error{there.error().code, "csv: " + there.error().message};
    if (is_header) RETURN_IF_ERROR(readHeader(*there, rows));
    if (!*there) break;
    if (is_header) continue;
    if (rows_.size() == kMaxImportRows)
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("csv: has more than {} rows: split it", kMaxImportRows)};
    add(rows);
  }
  if (rows_.empty()) return Error{ErrorCode::kInvalidInput, "csv: has a header and no rows"};
  RETURN_IF_ERROR(checkMemberships());
  std::size_t secrets = 0;
  for (const ImportRow& row : rows_) secrets += (row.password.empty() ? 0 : 1) + (row.code.empty() ? 0 : 1);
  if (secrets > kMaxImportSecrets)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("csv: has {} passwords and codes, at most {} are taken at once (each takes a "
                             "tenth of a second): split the table; trainees who only practise need no "
                             "password",
                             secrets, kMaxImportSecrets)};
  faultEqualCodes();
  return {};
}

void ImportTable::wipeSecrets() {
  for (ImportRow& row : rows_) {
    wipe(row.password);
    wipe(row.code);
  }
}

/// kInvalidInput: together, the rows name more groups than kMaxImportMemberships.
Status ImportTable::checkMemberships() const {
  std::size_t named = 0;
  for (const ImportRow& row : rows_) {
    named += row.groups.size();
    if (named > kMaxImportMemberships)
      return Error{
          ErrorCode::kInvalidInput,
          fmt::format("csv: line {}: the people up to here join {} groups, counted for each; at most {} "
                      "are taken at once: split the table",
                      row.line, named, kMaxImportMemberships)};
  }
  return {};
}

/// A badge shared by several people is accepted for none of them.
void ImportTable::faultEqualCodes() {
  for (ImportRow& row : rows_) {
    if (!row.has_code) continue;
    for (const ImportRow& other : rows_)
      if (&other != &row && other.code == row.code)
        row.fault("code", fmt::format("is the code of line {}, too", other.line));
  }
}

Status ImportTable::readHeader(bool is_there, const CsvRows& rows) {
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
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("csv: column '{}' is none of name, full_name, role, group, password, code: {}",
                               printable(std::string(cells[i])), headerText(cells, rows.separator()))};
    if (!columns_.emplace(std::string(*column), i).second)
      return Error{ErrorCode::kInvalidInput, fmt::format("csv: column '{}' is there twice", *column)};
  }
  if (columns_.contains("name")) return {};
  return Error{ErrorCode::kInvalidInput,
               "csv: there is no column 'name': " + headerText(cells, rows.separator())};
}

void ImportTable::add(const CsvRows& rows) {
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
  row.person.created_unix_ns = now_unix_ns_;
  row.person.role = pb::TRAINEE;
  std::size_t width = cells.size();
  while (width > width_ && cells[width - 1].empty()) --width;
  if (width != width_) row.fault("", fmt::format("has {} cells, the header has {}", width, width_));
  for (const std::size_t unnamed : unnamed_)
    if (unnamed < cells.size() && !cells[unnamed].empty())
      row.fault("", fmt::format("has a cell in column {}, whose name is missing in the header", unnamed + 1));
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
    row.fault("group",
              fmt::format("has {} groups, a person is in at most {}", row.groups.size(), kMaxGroupsOfPerson));
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
    if (!is_new) row.fault("name", duplicateText(rows_[first->second], row.person.name));
  }
  rows_.push_back(std::move(row));
}

}  // namespace needlelab
