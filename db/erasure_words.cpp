// The names of an erased person in remarks and in lines of the audit log: finding them on any connection, and
// replacing them, in pages or in the erasure's transaction.
#include <fmt/core.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "db/audit.h"
#include "db/audit_chain.h"
#include "db/erasure.h"
#include "db/text_pages.h"

namespace needlelab {
namespace {

struct RemarkRow {
  std::int64_t id = 0, session = 0;
  std::string text, author;
  [[nodiscard]] std::size_t bytes() const { return text.size() + author.size(); }
};
constexpr std::string_view kRemarkRows =
    "SELECT id, session, text, author FROM annotations WHERE id > ?1 AND id <= ?2 ORDER BY id";
RemarkRow remarkRowOf(const Statement& row) {
  return {row.integer(0), row.integer(1), row.text(2), row.text(3)};
}

struct LineRow {
  std::int64_t id = 0;
  AuditRow line;
  [[nodiscard]] std::size_t bytes() const {
    return line.who.size() + line.subject.size() + line.detail.size();
  }
};
constexpr std::string_view kLineRows =
    "SELECT id, who, action, subject, detail FROM audit WHERE id > ?1 AND id <= ?2 ORDER BY id";
LineRow lineRowOf(const Statement& row) {
  return {row.integer(0), {0, 0, row.text(1), row.text(2), row.text(3), row.text(4)}};
}

/// Lines that loggedFullNames() reads. Only the transaction replaces them: until then they say the earlier
/// full names to whoever begins anew.
bool saysFullNames(const AuditRow& line, const std::string& name) {
  return line.subject == name && (line.action == "user change" || line.action == "user import");
}

/// The remark as it is after the erasure; nothing: it stays. Remarks also name people in other people's
/// sessions; parts of a full name and names that were typed at stations are replaced only in the person's own
/// sessions.
std::optional<RemarkRow> replacedIn(const RemarkRow& remark, const PersonTraces& who) {
  RemarkRow after = remark;
  after.text = withoutNames(remark.text, who.names, who.sessions.contains(remark.session));
  if (!who.names.typed && remark.author == who.names.name) after.author = who.names.in_its_place;
  if (after.text == remark.text && after.author == remark.author) return std::nullopt;
  return after;
}

/// The same of a line.
std::optional<AuditRow> replacedIn(const LineRow& row, const PersonTraces& who) {
  const AuditRow& before = row.line;
  AuditRow after = withoutNames(before, who.names, who.session_ids);
  if (after.who == before.who && after.subject == before.subject && after.detail == before.detail)
    return std::nullopt;
  return after;
}

}  // namespace

std::string ReplacedWords::text() const {
  std::string text;
  const auto add = [&](std::size_t count, std::string_view what) {
    if (count > 0) text += (text.empty() ? "" : "; ") + fmt::format("{} {}", count, what);
  };
  add(remarks_of_others, "remarks in sessions of others");
  add(groups, "names of groups");
  add(lines_about_others, "lines of the audit log about others");
  return text.empty() ? text : "The name was also replaced in: " + text + ". ";
}

bool PersonTraces::hasAllOf(const PersonTraces& now) const {
  const auto holds = [](const std::vector<std::string>& all, const std::vector<std::string>& some) {
    return std::all_of(some.begin(), some.end(), [&](const std::string& one) {
      return std::find(all.begin(), all.end(), one) != all.end();
    });
  };
  // of a session that came later, all remarks and lines are later ones, too
  return holds(names.full_names, now.names.full_names) && holds(names.given, now.names.given) &&
         std::all_of(now.sessions.begin(), now.sessions.end(), [&](std::int64_t session) {
           return session > last_session || sessions.contains(session);
         });
}

Result<FoundNames> ErasureStore::lookForNames(const std::string& name, const ErasureLine& line,
                                              bool with_waiting) {
  FoundNames found;
  {
    ASSIGN_OR_RETURN(const auto view, Transaction::view(connection_));
    RETURN_IF_ERROR(mayErase(name, line, with_waiting));
    ASSIGN_OR_RETURN(found.who, tracesOf(name, line, with_waiting, nullptr));
    // the names of groups that lose the person are no other names, which stay
    ASSIGN_OR_RETURN(const auto groups, groupsWith(found.who.names));
    std::set<std::string> not_others;
    for (const GroupWithName& group : groups)
      if (group.name_after != group.name) not_others.insert(group.name);
    RETURN_IF_ERROR(addOthers(connection_, found.who.names, true, not_others));
  }
  const auto look = [&](bool is_audit, std::string_view sql, std::int64_t last, const auto& make,
                        const auto& is_later) -> Status {
    for (std::int64_t after = -1;;) {
      ASSIGN_OR_RETURN(const auto rows, pageOf(connection_, sql, after, last, make));
      if (rows.empty()) return {};
      std::uint64_t bytes = 0;
      for (const auto& row : rows)
        if (!is_later(row) && replacedIn(row, found.who)) bytes += row.bytes();
      if (bytes > 0) found.pages.push_back({is_audit, after, rows.back().id});
      found.bytes += bytes;
      after = rows.back().id;
    }
  };
  RETURN_IF_ERROR(
      look(false, kRemarkRows, found.who.last_remark, remarkRowOf, [](const RemarkRow&) { return false; }));
  RETURN_IF_ERROR(look(true, kLineRows, found.who.last_line, lineRowOf, [&](const LineRow& row) {
    const bool is_later = saysFullNames(row.line, name);
    if (is_later) found.later_lines.push_back(row.id);
    return is_later;
  }));
  RETURN_IF_ERROR(requireRoom(found.bytes));
  return found;
}

Status ErasureStore::replaceNames(FoundNames& found, const FoundNames::Page& page) {
  RETURN_IF_ERROR(requireRoom());
  return page.is_audit ? replaceInLines(found.who, page.after, page.last, found.replaced, false)
                       : replaceInRemarks(found.who, page.after, page.last, found.replaced);
}

Status ErasureStore::replaceInRemarks(const PersonTraces& who, std::int64_t after, std::int64_t last,
                                      ReplacedWords& replaced) {
  return eachRow(connection_, kRemarkRows, after, last, remarkRowOf, [&](const RemarkRow& remark) -> Status {
    const auto now = replacedIn(remark, who);
    if (!now) return {};
    ++replaced.remarks;
    if (now->text != remark.text && !who.sessions.contains(remark.session)) ++replaced.remarks_of_others;
    RETURN_IF_ERROR(connection_.run("UPDATE annotations SET text = ?, author = ? WHERE id = ?", now->text,
                                    now->author, remark.id));
    return noteRow();
  });
}

Status ErasureStore::replaceInLines(const PersonTraces& who, std::int64_t after, std::int64_t last,
                                    ReplacedWords& replaced, bool with_full_names) {
  // the audit log keeps its lines and their order; only the name changes
  return eachRow(connection_, kLineRows, after, last, lineRowOf, [&](const LineRow& row) -> Status {
    if (!with_full_names && saysFullNames(row.line, who.names.name)) return {};
    const auto now = replacedIn(row, who);
    if (!now) return {};
    ++replaced.lines;
    if (now->detail != row.line.detail && now->subject == row.line.subject &&
        !who.session_ids.contains(row.line.subject))
      ++replaced.lines_about_others;
    AuditChain chain(connection_);
    // what somebody changed keeps its fault, and does not hold up the erasure
    ASSIGN_OR_RETURN(const bool proven, chain.proves(row.id));
    RETURN_IF_ERROR(connection_.run("UPDATE audit SET who = ?, subject = ?, detail = ? WHERE id = ?",
                                    now->who, now->subject, now->detail, row.id));
    RETURN_IF_ERROR(chain.amend(row.id, proven));
    return noteRow();
  });
}

}  // namespace needlelab
