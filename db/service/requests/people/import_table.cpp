#include "db/service/requests/people/import_table.h"

#include <fmt/core.h>
#include <algorithm>
#include <iterator>
#include <utility>

#include "common/base/secret.h"
#include "common/base/text/text.h"
#include "db/login/credentials.h"
#include "db/people/person_name.h"
#include "db/service/context/principal.h"

namespace needlelab {
namespace {

/// Ids separated by ';', without white space around them; each once.
std::vector<std::string> idsOf(const std::string& cell) {
  std::vector<std::string> ids;
  for (std::size_t at = 0; at <= cell.size();) {
    const std::size_t end = std::min(cell.find(';', at), cell.size());
    std::string id(trimmedName(std::string_view(cell).substr(at, end - at)));
    if (!id.empty() && std::find(ids.begin(), ids.end(), id) == ids.end()) ids.push_back(std::move(id));
    at = end + 1;
  }
  return ids;
}

bool isDigits(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos;
}

/// "471,221" or "20.261.234".
bool isGrouped(std::string_view text) {
  const std::size_t sign = text.find_first_of(".,'");
  if (sign == std::string_view::npos || sign > 3 || !isDigits(text.substr(0, sign))) return false;
  const char thousands = text[sign];
  for (text.remove_prefix(sign); !text.empty(); text.remove_prefix(4))
    if (text.size() < 4 || text[0] != thousands || !isDigits(text.substr(1, 3))) return false;
  return true;
}

/// Other words for a column, as registrars write them, folded and without spaces and signs. Where a header
/// has several for one column, the first of this list is taken.
struct HeaderWord {
  std::string_view word, column;
};
constexpr HeaderWord kHeaderWords[] = {
    {"account", "name"},
    {"username", "name"},
    {"userid", "name"},
    {"user", "name"},
    {"login", "name"},
    {"benutzername", "name"},
    {"benutzerkennung", "name"},
    {"kennung", "name"},
    {"nomdutilisateur", "name"},
    {"identifiant", "name"},
    {"studentid", "name"},
    {"studentnumber", "name"},
    {"matrikelnummer", "name"},
    {"matrikelnr", "name"},
    {"numéroétudiant", "name"},
    {"displayname", "full_name"},
    {"vollständigername", "full_name"},
    {"nomcomplet", "full_name"},
    {"firstname", "given_name"},
    {"givenname", "given_name"},
    {"vorname", "given_name"},
    {"prénom", "given_name"},
    {"lastname", "family_name"},
    {"familyname", "family_name"},
    {"surname", "family_name"},
    {"nachname", "family_name"},
    {"familienname", "family_name"},
    {"nomdefamille", "family_name"},
    {"nom", "family_name"},
    {"groups", "group"},
    {"class", "group"},
    {"gruppe", "group"},
    {"klasse", "group"},
    {"groupe", "group"},
    {"classe", "group"},
};
/// What the cell "name" means before the other columns are known.
const std::pair<std::string, int> kPlainName{"name", 0};

/// The column that a header's cell names, and the rank of its word; "" for none of them.
std::pair<std::string, int> meaningOf(std::string_view cell) {
  for (const char* const column : {"name", "full_name", "role", "group", "password", "code"})
    if (isColumn(cell, column)) return {column, 0};
  std::string word = nameKey(cell);
  std::erase_if(word, [](char c) { return std::string_view(" _-.'/").find(c) != std::string_view::npos; });
  const auto* const found = std::find_if(std::begin(kHeaderWords), std::end(kHeaderWords),
                                         [&](const HeaderWord& one) { return one.word == word; });
  if (found == std::end(kHeaderWords)) return {};
  return {std::string(found->column), 1 + static_cast<int>(found - std::begin(kHeaderWords))};
}

std::string duplicateText(const ImportRow& first, const std::string& name) {
  if (first.person.name == name)
    return fmt::format("stands in line {} already: rows of one person may differ only in the group",
                       first.line);
  return fmt::format(
      "stands in line {} already, written '{}': is it the same person? Then leave one of the two "
      "lines out, else take another name",
      first.line, first.person.name);
}

}  // namespace

std::string madeByTableProgram(std::string_view text) {
  const std::size_t e = text.find_first_of("Ee");
  const std::string_view number = text.substr(0, e);
  const std::size_t sign = number.find_first_of(".,");
  const std::string_view whole = number.substr(0, sign),
                         rest = sign == std::string_view::npos ? std::string_view() : number.substr(sign + 1);
  if (!isDigits(whole) || (sign != std::string_view::npos && !isDigits(rest))) return {};
  if (e != std::string_view::npos) {
    const bool has_sign = e + 1 < text.size() && (text[e + 1] == '+' || text[e + 1] == '-');
    return has_sign && isDigits(text.substr(e + 2)) ? "a number that a spreadsheet has rounded (as 4.7E+11)"
                                                    : "";
  }
  if (sign == std::string_view::npos || rest.find_first_not_of('0') != std::string_view::npos) return {};
  return fmt::format("a number to which a table program has added '{}'", number.substr(sign));
}

Status ImportTable::read(const std::string& csv, std::size_t lines_above) {
  if (!isUtf8(csv))
    return Error{ErrorCode::kInvalidInput, "csv: is not UTF-8: save the table as \"CSV UTF-8\""};
  CsvRows rows(withoutMark(csv), lines_above);
  for (bool is_header = true;; is_header = false) {
    const auto there = rows.next();
    if (!there.ok()) return Error{there.error().code, "csv: " + there.error().message};
    if (is_header) RETURN_IF_ERROR(readHeader(*there, rows));
    if (is_header && !rows_.empty()) return {};  // without the account no row can be read
    if (!*there) break;
    if (is_header) continue;
    if (rows_.size() == kMaxImportRows)
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("csv: has more than {} rows: split it", kMaxImportRows)};
    add(rows);
  }
  if (rows_.empty()) return Error{ErrorCode::kInvalidInput, "csv: has a header and no rows"};
  for (ImportRow& row : rows_)
    if (row.groups.size() > kMaxGroupsOfPerson)
      row.fault("group", fmt::format("has {} groups, a person is in at most {}", row.groups.size(),
                                     kMaxGroupsOfPerson));
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
  askAboutLengths("name", [](const ImportRow& row) { return row.person.name; });
  askAboutLengths("code", [](const ImportRow& row) { return row.code; });
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

void ImportTable::askAboutLengths(const std::string& column,
                                  const std::function<std::string(const ImportRow&)>& textOf) {
  std::map<std::size_t, std::size_t> rows_by_length;
  for (const ImportRow& row : rows_)
    if (const std::string text = textOf(row); isDigits(text)) ++rows_by_length[text.size()];
  const auto most = std::max_element(rows_by_length.rbegin(), rows_by_length.rend(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  if (rows_by_length.size() < 2) return;
  for (ImportRow& row : rows_) {
    const std::string text = textOf(row);
    if (!isDigits(text) || text.size() >= most->first || !row.question.empty()) continue;
    row.asked_column = column;
    row.question = fmt::format("has {} digits, most have {}: has a table program dropped zeros at the left?",
                               text.size(), most->first);
  }
}

bool ImportTable::joinRow(ImportRow& row) {
  const auto there = lines_.find(nameKey(row.person.name));
  if (there == lines_.end()) return false;
  ImportRow& first = rows_[there->second];
  const bool is_same = first.person.name == row.person.name &&
                       first.person.full_name == row.person.full_name &&
                       first.person.role == row.person.role && first.password == row.password &&
                       first.code == row.code && first.groups != row.groups &&
                       first.what != pb::PeopleImport::FAULT && row.what != pb::PeopleImport::FAULT;
  if (!is_same) return false;
  for (std::string& group : row.groups)
    if (std::find(first.groups.begin(), first.groups.end(), group) == first.groups.end())
      first.groups.push_back(std::move(group));
  wipe(row.password);
  wipe(row.code);
  return true;
}

/// Finds the columns by their words. `name` beside a full name is the account; otherwise, beside a given name
/// alone, the family name; otherwise, beside another word for the account, the full name.
Status ImportTable::readHeader(bool is_there, const CsvRows& rows) {
  if (!is_there) return Error{ErrorCode::kInvalidInput, "csv: is empty; the first line names the columns"};
  const auto cells = rows.cells();
  std::vector<std::pair<std::string, int>> meant(cells.size());  // the column and the word's rank, 0: its own
  std::map<std::string, int> best;
  const auto prefer = [&](const std::string& column, int rank) {
    const auto found = best.emplace(column, rank).first;
    found->second = std::min(found->second, rank);
  };
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (cells[i].empty()) {
      unnamed_.push_back(i);
      continue;
    }
    width_ = i + 1;
    meant[i] = meaningOf(cells[i]);
    if (!meant[i].first.empty() && meant[i] != kPlainName) prefer(meant[i].first, meant[i].second);
  }
  const std::string plain = best.contains("full_name")                                     ? "name"
                            : best.contains("given_name") && !best.contains("family_name") ? "family_name"
                            : best.contains("name")                                        ? "full_name"
                                                                                           : "name";
  for (auto& [column, rank] : meant) {
    if (std::pair(column, rank) != kPlainName) continue;
    column = plain;
    prefer(column, rank);
  }
  header_line_ = static_cast<std::uint32_t>(rows.line());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (cells[i].empty()) continue;
    const auto& [column, rank] = meant[i];
    const bool part = column == "given_name" || column == "family_name";
    const bool taken = !column.empty() && best.at(column) == rank && !(part && best.contains("full_name"));
    if (taken && !columns_.emplace(column, i).second)
      return Error{ErrorCode::kInvalidInput, fmt::format("csv: column '{}' is there twice", column)};
    header_.push_back(
        {printable(std::string(cells[i].substr(0, kMaxColumnBytes))), taken ? column : std::string()});
    in_own_words_ = in_own_words_ && taken && rank == 0;
  }
  if (columns_.contains("name")) return {};
  ImportRow row;
  row.line = header_line_;
  row.fault("name", "no column is known as the account: " + headerText(cells, rows.separator()));
  rows_.push_back(std::move(row));
  return {};
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
  for (const char* const part : {"given_name", "family_name"})
    if (const std::string one = cell(part); !one.empty())
      row.person.full_name += (row.person.full_name.empty() ? "" : " ") + one;
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
  if (row.has_code) check("code", checkCode(asciiDigits(row.code)));
  if (const std::string made = madeByTableProgram(row.code); !made.empty())
    row.fault("code", "is " + made + ": format the column as text, and put the codes in again");
  for (const char* const column : {"name", "code"})
    if (isGrouped(column[0] == 'n' ? row.person.name : row.code)) {
      row.asked_column = column;
      row.question = "is digits with signs of thousands: has a table program put them in?";
    }
  if (joinRow(row)) return;
  if (row.what != pb::PeopleImport::FAULT) {
    const auto [first, is_new] = lines_.emplace(nameKey(row.person.name), rows_.size());
    if (!is_new) row.fault("name", duplicateText(rows_[first->second], row.person.name));
  }
  rows_.push_back(std::move(row));
}

}  // namespace needlelab
