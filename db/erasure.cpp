#include "db/erasure.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "common/base/text.h"
#include "db/free_parts.h"
#include "db/retention_store.h"
#include "db/schema.h"

namespace needlelab {
namespace {

struct NameColumn {
  std::string_view table, column;
  std::string_view long_text = "''";  ///< SQL: what makes rows longer than a page
};

/// Columns with the name of the person who did something, or whom a station named. The rows stay. Those of
/// remarks, which are many, are replaceInRemarks()'s.
constexpr std::array kDoers = {
    NameColumn{"profiles", "author", "json"},
    NameColumn{"curricula", "author", "json"},
    NameColumn{"assignments", "by_whom"},
    NameColumn{"groups", "changed_by"},
    NameColumn{"people", "changed_by"},
    NameColumn{"consents", "recorded_by"},
    NameColumn{"exercise_references", "by_whom", "sessions"},
    NameColumn{"retention_policies", "by_whom"},
    NameColumn{"removed_originals", "by_whom", "crcs"},
    NameColumn{"erasures", "by_whom"},
    NameColumn{"unknown_trainees", "by_whom"},
};

constexpr int kRowsBetweenLooks = 16;

/// An ANALYZE by a SQLite with STAT4 leaves samples of the indexes, names among them; PostgreSQL's, too.
Status removeSamplesOfIndexes(Connection& connection) {
  if (connection.sqlite() == nullptr) {
    // what it samples now has no more of the person; PostgreSQL's own tables never had it
    ASSIGN_OR_RETURN(const auto tables,
                     connection
                         .prepare("SELECT string_agg(quote_ident(tablename), ', ') FROM pg_tables"
                                  " WHERE schemaname = current_schema()")
                         .first(firstText));
    return tables && !tables->empty() ? connection.script("ANALYZE " + *tables) : Status();
  }
  ASSIGN_OR_RETURN(
      const auto samples,
      connection.prepare("SELECT name FROM sqlite_schema WHERE type = 'table' AND name = 'sqlite_stat4'")
          .first(firstText));
  return samples ? connection.run("DELETE FROM sqlite_stat4") : Status();
}

/// In why recordings were removed: a policy's author stands at the end (RetentionStore).
Status eraseInReasons(Connection& connection, const std::string& name, const std::string& pseudonym) {
  return connection.run(
      "UPDATE removed_originals SET reason = substr(reason, 1, length(reason) - length(?1)) || ?2"
      " WHERE length(reason) >= length(?1) AND substr(reason, length(reason) - length(?1) + 1) = ?1",
      std::string(kSetBy) + name, std::string(kSetBy) + pseudonym);
}

}  // namespace

Status ErasureStore::noteRow() {
  return ++rows_ < kRowsBetweenLooks ? Status() : requireRoom();
}

Result<std::uint64_t> ErasureStore::pragma(std::string_view name) {
  if (connection_.sqlite() == nullptr) return 0u;
  ASSIGN_OR_RETURN(const auto value,
                   connection_.prepare("PRAGMA " + std::string(name)).first([](const Statement& row) {
                     return row.natural(0);
                   }));
  return value.value_or(0);
}

Status ErasureStore::requireRoom(std::uint64_t bytes) {
  rows_ = 0;
  if (connection_.sqlite() == nullptr) return {};  // its disk is PostgreSQL's own
  ASSIGN_OR_RETURN(const auto pages, pragma("page_count"));
  ASSIGN_OR_RETURN(const auto page_bytes, pragma("page_size"));
  const auto& path = connection_.path();
  std::error_code error;
  const std::uint64_t file = std::filesystem::file_size(path, error);
  if (error) return {};
  // the file grows only when the log is emptied
  const std::uint64_t grown = std::max(pages * page_bytes, file) - file;
  std::optional<std::uint64_t> left;
  if (free_room_) {
    left = free_room_();
  } else if (const auto space = std::filesystem::space(path.parent_path(), error); !error) {
    left = space.available;
  }
  // in the log, and once more in the file
  const std::uint64_t needed = kRoomLeft_bytes + grown + 2 * bytes;
  if (!left || *left >= needed) return {};
  return Error{ErrorCode::kNoRoom,
               fmt::format("the disk of {} has {} MiB left, and the erasure needs {} MiB or more to go on: "
                           "the person is not erased; make room on it, then erase again",
                           path.parent_path().string(), *left >> 20, (needed >> 20) + 1)};
}

Result<pb::Erasure> ErasureStore::erase(const std::string& name, const ErasureLine& line,
                                        const std::string& by, const std::string& reason,
                                        std::int64_t now_unix_ns, bool with_waiting) {
  ASSIGN_OR_RETURN(auto done, eraseRows(name, line, by, reason, now_unix_ns, with_waiting));
  ASSIGN_OR_RETURN(auto text, reportOf(done));
  done.erasure.set_text(std::move(text));
  return std::move(done.erasure);
}

Result<ErasedRows> ErasureStore::eraseRows(const std::string& name, const ErasureLine& line,
                                           const std::string& by, const std::string& reason,
                                           std::int64_t now_unix_ns, bool with_waiting,
                                           const FoundNames* found) {
  RETURN_IF_ERROR(mayErase(name, line, with_waiting));
  ASSIGN_OR_RETURN(auto who, tracesOf(name, line, with_waiting, found ? &found->who : nullptr));
  ErasedRows done;
  done.typed = line.without_account;
  if (found) {
    done.replaced = found->replaced;
    done.erasure = found->sessions;
  }
  // before the names of groups count as other names, which stay
  ASSIGN_OR_RETURN(done.group_ids, eraseInGroups(who.names, done.replaced));
  RETURN_IF_ERROR(addOthers(connection_, who.names));
  done.erasure.set_pseudonym(line.pseudonym);
  ASSIGN_OR_RETURN(const auto own, sessionsToErase(name, line, with_waiting, UINT64_MAX));
  RETURN_IF_ERROR(eraseSessions(own.sessions, who.names, now_unix_ns, by, done.erasure));
  ASSIGN_OR_RETURN(const auto left, connection_.query("SELECT count(*) FROM sessions WHERE trainee = ?", name)
                                        .first([](const Statement& row) { return row.natural(0); }));
  done.erasure.set_waiting_sessions(left.value_or(0));
  if (!done.typed) RETURN_IF_ERROR(eraseAccount(who.names));
  if (!done.typed) RETURN_IF_ERROR(eraseInReasons(connection_, name, line.pseudonym));
  RETURN_IF_ERROR(MetaStore(connection_).set(kFreePartsKey, line.pseudonym));
  RETURN_IF_ERROR(MetaStore(connection_)
                      .set(std::string(kFilesUnseenKey) + line.pseudonym, std::to_string(line.unix_ns)));
  RETURN_IF_ERROR(removeSamplesOfIndexes(connection_));
  // what the stations gave for sessions that were assigned; those that wait keep it
  RETURN_IF_ERROR(connection_.run(
      "UPDATE unknown_trainees SET given = ?1 WHERE given = ?2 AND by_whom IS NOT NULL"
      " AND (?3 = 0 OR session IN (SELECT number FROM sessions WHERE received_unix_ns <= ?4))",
      line.pseudonym, name, done.typed, line.unix_ns));
  // of the older ones those that have a name were replaced already, unless the person has others since
  const bool is_covered = found && found->who.hasAllOf(who);
  RETURN_IF_ERROR(replaceInRemarks(who, is_covered ? found->who.last_remark : -1, INT64_MAX, done.replaced));
  if (is_covered)
    for (const std::int64_t line_id : found->later_lines)
      RETURN_IF_ERROR(replaceInLines(who, line_id - 1, line_id, done.replaced));
  RETURN_IF_ERROR(replaceInLines(who, is_covered ? found->who.last_line : -1, INT64_MAX, done.replaced));
  done.erasure.set_audit_lines(done.replaced.lines);
  RETURN_IF_ERROR(remember(line, by, withoutNames(reason, who.names, true)));
  done.names = std::move(who.names);
  done.names.typed = false;
  done.session_ids = std::move(who.session_ids);
  return done;
}

Result<std::vector<ErasureStore::GroupWithName>> ErasureStore::groupsWith(ErasedNames names) {
  RETURN_IF_ERROR(addOthers(connection_, names, false));
  std::vector<GroupWithName> with_name;
  auto rows = connection_.prepare("SELECT id, name FROM groups ORDER BY id");
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return with_name;
    GroupWithName group{rows.text(0), rows.text(1), {}, false};
    group.name_after = withoutNames(group.name, names, false);
    group.id_has_name = withoutNames(group.id, names, false) != group.id;
    if (group.id_has_name || group.name_after != group.name) with_name.push_back(std::move(group));
  }
}

Result<std::vector<std::string>> ErasureStore::eraseInGroups(const ErasedNames& names,
                                                             ReplacedWords& replaced) {
  ASSIGN_OR_RETURN(const auto groups, groupsWith(names));
  std::vector<std::string> ids;
  for (const GroupWithName& group : groups) {
    if (group.id_has_name) ids.push_back(group.id);
    if (group.name_after == group.name) continue;
    ++replaced.groups;
    // another revision: an edit that was begun before would bring the name back
    RETURN_IF_ERROR(connection_.run("UPDATE groups SET name = ?, revision = revision + 1 WHERE id = ?",
                                    group.name_after, group.id));
  }
  return ids;
}

Status ErasureStore::eraseAccount(const ErasedNames& names) {
  for (const std::string_view sql :
       {"DELETE FROM assignments WHERE trainee = ?", "DELETE FROM consents WHERE person = ?",
        "UPDATE groups SET revision = revision + 1 WHERE id IN (SELECT group_id"
        " FROM group_members WHERE person = ?)",
        "DELETE FROM group_members WHERE person = ?", "DELETE FROM people WHERE name = ?"}) {
    RETURN_IF_ERROR(connection_.run(sql, names.name));
  }
  return eraseDoers(names);
}

Status ErasureStore::eraseDoers(const ErasedNames& names) {
  ASSIGN_OR_RETURN(const auto page_bytes, pragma("page_size"));
  for (const auto& [table, column, long_text] : kDoers) {
    ASSIGN_OR_RETURN(const auto bytes,
                     connection_
                         .query(fmt::format("SELECT coalesce(sum(length({}) + {}), 0) FROM {} WHERE {} = ?",
                                            long_text, page_bytes, table, column),
                                names.name)
                         .first([](const Statement& row) { return row.natural(0); }));
    RETURN_IF_ERROR(requireRoom(bytes.value_or(0)));
    RETURN_IF_ERROR(connection_.run(fmt::format("UPDATE {} SET {} = ? WHERE {} = ?", table, column, column),
                                    names.in_its_place, names.name));
  }
  return {};
}

Result<std::string> ErasureStore::doneUnder(const std::string& name) {
  std::string text;
  const auto look = [&](std::string_view table, std::string_view column) -> Status {
    ASSIGN_OR_RETURN(
        const auto rows,
        connection_.query(fmt::format("SELECT count(*) FROM {} WHERE {} = ?", table, column), name)
            .first([](const Statement& row) { return row.natural(0); }));
    if (rows.value_or(0) > 0)
      text += (text.empty() ? "" : ", ") + fmt::format("{} of {} ({})", *rows, table, column);
    return {};
  };
  RETURN_IF_ERROR(look("annotations", "author"));
  for (const NameColumn& doer : kDoers) RETURN_IF_ERROR(look(doer.table, doer.column));
  if (text.empty()) return text;
  return "Whoever has this name wrote these rows of the database, which keep it: " + text + ". ";
}

Result<std::string> ErasureStore::doersAlike(const NameSearch& search, const std::string& name) {
  constexpr std::size_t kMostNamedDoers = 20;
  std::size_t found = 0;
  std::string text;
  for (const NameColumn& doer : kDoers) {
    auto rows = connection_.prepare(
        fmt::format("SELECT {0}, count(*) FROM {1} WHERE {0} IS NOT NULL GROUP BY {0} ORDER BY {0}",
                    doer.column, doer.table));
    for (;;) {
      ASSIGN_OR_RETURN(const bool more, rows.step());
      if (!more) break;
      const std::string who = rows.text(0);
      if (who == name || !search.finds(who) || ++found > kMostNamedDoers) continue;
      text += (text.empty() ? "" : ", ") +
              fmt::format("'{}' in {} of {} ({})", printable(who), rows.natural(1), doer.table, doer.column);
    }
  }
  if (found == 0) return text;
  if (found > kMostNamedDoers) text += fmt::format(" and {} others", found - kMostNamedDoers);
  return "These who made or changed something have the letters of a name of this person, and stay as they "
         "are; "
         "look whom they mean: " +
         text + ". ";
}

}  // namespace needlelab
