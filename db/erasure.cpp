#include "db/erasure.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "db/free_parts.h"
#include "db/people.h"
#include "db/schema.h"
#include "db/session_rows.h"
#include "db/unknown_trainees.h"

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

/// SQL: whether an erasure of the name ?1 takes the session `s`; ?2: those that wait under an account's name,
/// too.
std::string isTaken() {
  return fmt::format(
      "s.trainee = ?1 AND (?2 OR s.number NOT IN {} OR NOT EXISTS (SELECT 1 FROM people WHERE name = ?1))",
      kWaitingSessions);
}

Result<std::int64_t> newestOf(Connection& connection, std::string_view sql) {
  ASSIGN_OR_RETURN(const auto newest,
                   connection.prepare(sql).first([](const Statement& row) { return row.integer(0); }));
  return newest.value_or(0);
}

/// Takes the person out of what a restore left for the log of the next start (service/restore.cpp): "user
/// anna: was disabled; station st1: was revoked".
Status eraseAccess(Connection& connection, const std::string& name) {
  constexpr std::string_view kKey = "access_valid_again", kBetween = "; ";
  MetaStore meta(connection);
  ASSIGN_OR_RETURN(const auto found, meta.get(kKey));
  const std::string_view text = found ? std::string_view(*found) : std::string_view();
  std::string left;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(kBetween, at), text.size());
    const std::string_view one = text.substr(at, end - at);
    if (!one.starts_with("user " + name + ": ")) left.append(left.empty() ? "" : kBetween).append(one);
    at = end + kBetween.size();
  }
  return left == text ? Status() : meta.set(kKey, left);
}

}  // namespace

Status ErasureStore::noteRow() {
  return ++rows_ < kRowsBetweenLooks ? Status() : requireRoom();
}

Result<std::uint64_t> ErasureStore::pragma(std::string_view name) {
  ASSIGN_OR_RETURN(const auto value,
                   connection_.prepare("PRAGMA " + std::string(name)).first([](const Statement& row) {
                     return row.natural(0);
                   }));
  return value.value_or(0);
}

Status ErasureStore::requireRoom(std::uint64_t bytes) {
  rows_ = 0;
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

Result<std::vector<std::string>> ErasureStore::openSessions(std::string_view name, bool with_waiting) {
  return connection_
      .query(
          "SELECT s.id, s.station FROM sessions s WHERE " + isTaken() + " AND s.state = ?3 ORDER BY s.number",
          name, with_waiting, static_cast<int>(pb::SESSION_OPEN))
      .all([](const Statement& row) {
        return sessionText(row.text(0)) + " at station '" + row.text(1) + "'";
      });
}

Status ErasureStore::mayErase(const std::string& name) {
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(name));
  if (person) return PeopleStore(connection_).checkNotLast(*person);
  auto some = connection_.query(
      "SELECT 1 FROM sessions WHERE trainee = ?1 UNION ALL SELECT 1 FROM unknown_trainees WHERE given = ?1"
      " LIMIT 1",
      name);
  ASSIGN_OR_RETURN(const bool found, some.step());
  if (found) return {};
  return Error{ErrorCode::kNotFound, "there is no person named '" + name + "', and no session of one"};
}

Result<PersonTraces> ErasureStore::tracesOf(const std::string& name, const std::string& pseudonym,
                                            bool with_waiting, const PersonTraces* before) {
  PersonTraces who;
  who.names = {name, {}, {}, pseudonym, {}};
  // the log says each name that was changed; all of it is read once
  if (before != nullptr) who.names.full_names = before->names.full_names;
  const auto add = [&](const std::string& full_name) {
    std::erase(who.names.full_names, full_name);
    who.names.full_names.push_back(full_name);
  };
  ASSIGN_OR_RETURN(const auto logged,
                   loggedFullNames(connection_, name, before != nullptr ? before->last_line : -1));
  for (const std::string& full_name : logged) add(full_name);
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(name));
  if (person && !person->full_name.empty()) add(person->full_name);
  // names that its stations gave for this person: a misspelt one names it in its sessions' remarks and lines,
  // unless somebody has it by now
  ASSIGN_OR_RETURN(who.names.given, connection_
                                        .query("SELECT DISTINCT u.given FROM unknown_trainees u"
                                               " JOIN sessions s ON s.number = u.session"
                                               " WHERE s.trainee = ?1 AND u.given <> ?1"
                                               " AND u.given NOT IN (SELECT name FROM people)"
                                               " ORDER BY length(u.given) DESC, u.given",
                                               name)
                                        .all(firstText));
  auto rows = connection_.query(
      "SELECT s.number, s.id, s.trainee = ?1 FROM sessions s WHERE (" + isTaken() + ") OR s.trainee = ?3",
      name, with_waiting, pseudonym);
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) break;
    who.sessions.insert(rows.integer(0));
    if (rows.integer(2) != 0) who.session_ids.insert(sessionText(rows.text(1)));
  }
  ASSIGN_OR_RETURN(who.last_session, newestOf(connection_, "SELECT max(number) FROM sessions"));
  ASSIGN_OR_RETURN(who.last_remark, newestOf(connection_, "SELECT max(id) FROM annotations"));
  ASSIGN_OR_RETURN(who.last_line, newestOf(connection_, "SELECT max(id) FROM audit"));
  return who;
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
  RETURN_IF_ERROR(mayErase(name));
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(name));
  ASSIGN_OR_RETURN(auto who, tracesOf(name, line.pseudonym, with_waiting, found ? &found->who : nullptr));
  ErasedRows done;
  if (found) done.replaced = found->replaced;
  // before the names of groups count as other names, which stay
  ASSIGN_OR_RETURN(done.group_ids, eraseInGroups(who.names, done.replaced));
  RETURN_IF_ERROR(addOthers(connection_, who.names));
  done.erasure.set_pseudonym(line.pseudonym);
  RETURN_IF_ERROR(eraseSessions(who.names, with_waiting, now_unix_ns, by, done.erasure));
  for (const std::string_view sql :
       {"DELETE FROM assignments WHERE trainee = ?", "DELETE FROM consents WHERE person = ?",
        "UPDATE groups SET revision = revision + 1 WHERE id IN (SELECT group_id"
        " FROM group_members WHERE person = ?)",
        "DELETE FROM group_members WHERE person = ?", "DELETE FROM people WHERE name = ?"}) {
    RETURN_IF_ERROR(connection_.run(sql, name));
  }
  ASSIGN_OR_RETURN(const auto pieces,
                   connection_.prepare("SELECT coalesce(sum(length(records)), 0) FROM import_pieces")
                       .first([](const Statement& row) { return row.natural(0); }));
  RETURN_IF_ERROR(requireRoom(pieces.value_or(0)));  // what is deleted is overwritten
  // an id that was not made by chance may have the name
  RETURN_IF_ERROR(
      connection_.run("INSERT INTO import_pieces (import_id, position, records, by_whom, unix_ns)"
                      " SELECT import_id, ?1, '', '', ?2 FROM import_pieces"
                      " WHERE instr(lower(import_id), lower(?3)) = 0"
                      " OR (length(import_id) = 36 AND import_id NOT GLOB '*[^0-9a-f-]*')"
                      " GROUP BY import_id HAVING min(position) > ?1",
                      kDroppedPieces, now_unix_ns, name));
  RETURN_IF_ERROR(connection_.run("DELETE FROM import_pieces WHERE position <> ?", kDroppedPieces));
  RETURN_IF_ERROR(eraseAccess(connection_, name));
  RETURN_IF_ERROR(MetaStore(connection_).set(kFreePartsKey, line.pseudonym));
  // an ANALYZE by a SQLite with STAT4 left samples of the indexes, names among them
  ASSIGN_OR_RETURN(
      const auto samples,
      connection_.prepare("SELECT name FROM sqlite_schema WHERE type = 'table' AND name = 'sqlite_stat4'")
          .first(firstText));
  if (samples) RETURN_IF_ERROR(connection_.run("DELETE FROM sqlite_stat4"));
  RETURN_IF_ERROR(eraseDoers(who.names));
  // what the stations gave for sessions that were assigned; those that wait keep it
  RETURN_IF_ERROR(connection_.run(
      "UPDATE unknown_trainees SET given = ? WHERE given = ? AND by_whom IS NOT NULL", line.pseudonym, name));
  // of the older ones those that have a name were replaced already, unless the person has others since
  const bool is_covered = found && found->who.hasAllOf(who);
  RETURN_IF_ERROR(replaceInRemarks(who, is_covered ? found->who.last_remark : -1, INT64_MAX, done.replaced));
  if (is_covered)
    for (const std::int64_t line_id : found->later_lines)
      RETURN_IF_ERROR(replaceInLines(who, line_id - 1, line_id, done.replaced));
  RETURN_IF_ERROR(replaceInLines(who, is_covered ? found->who.last_line : -1, INT64_MAX, done.replaced));
  done.erasure.set_audit_lines(done.replaced.lines);
  RETURN_IF_ERROR(remember(line, line.without_account && !person, by, withoutNames(reason, who.names, true)));
  done.names = std::move(who.names);
  done.session_ids = std::move(who.session_ids);
  return done;
}

Status ErasureStore::eraseSessions(const ErasedNames& names, bool with_waiting, std::int64_t now_unix_ns,
                                   const std::string& by, pb::Erasure& erasure) {
  const std::string& name = names.name;
  const std::string& pseudonym = names.in_its_place;
  struct Session {
    std::int64_t number = 0;
    pb::SessionState state = pb::SESSION_OPEN;
    int recording = 1;
    std::uint64_t chunks = 0;
    std::string description;
  };
  const auto sessionOf = [](const Statement& row) {
    return Session{row.integer(0), static_cast<pb::SessionState>(row.integer(1)),
                   static_cast<int>(row.integer(2)), row.natural(3), row.text(4)};
  };
  ASSIGN_OR_RETURN(const auto sessions, connection_
                                            .query("SELECT s.number, s.state, s.recording, coalesce(p.chunks,"
                                                   " s.chunks), s.description FROM sessions s"
                                                   " LEFT JOIN session_progress p ON p.session = s.number"
                                                   " WHERE " +
                                                       isTaken(),
                                                   name, with_waiting)
                                            .all(sessionOf));
  constexpr std::string_view kReason = "the data of its person was erased";
  for (const Session& session : sessions) {
    RETURN_IF_ERROR(requireRoom());  // its events and scores have a few MB
    pb::SessionDescription description;
    if (!description.ParseFromString(session.description))
      return Error{ErrorCode::kCorrupt, "the stored description of a session cannot be read"};
    description.set_trainee(pseudonym);
    clearDeviceWords(description);
    RETURN_IF_ERROR(
        connection_.run("UPDATE sessions"
                        " SET trainee = ?, description = ?, profile_json = ?, erased = 1, score_json = NULL,"
                        " passed = NULL, events = 0, recording = 3, clock_offset_ns = NULL,"
                        " clock_round_trip_ns = NULL WHERE number = ?",
                        pseudonym, viewOf(description.SerializeAsString()), kErasedProfile, session.number));
    // close an open session; its hash was never computed, and no chunks will be left to hash
    if (session.state == pb::SESSION_OPEN) {
      RETURN_IF_ERROR(connection_.run(
          "UPDATE sessions SET state = ?, hash = zeroblob(32), closed_unix_ns = ? WHERE number = ?",
          static_cast<int>(pb::SESSION_INTERRUPTED), now_unix_ns, session.number));
    }
    if (session.recording != 3) erasure.set_recordings(erasure.recordings() + (session.chunks > 0 ? 1 : 0));
    // Retention removes the chunks in pieces. Their CRCs are not needed, because chunks that a station sends
    // again are accepted unread.
    RETURN_IF_ERROR(
        connection_.run("INSERT INTO removed_originals (session, removed_unix_ns, deleted_unix_ns,"
                        " reason, by_whom, leftover, crcs)"
                        " VALUES (?1, ?2, ?2, ?3, ?4, 1, zeroblob(4 * ?5)) ON CONFLICT (session)"
                        " DO UPDATE"
                        " SET deleted_unix_ns = ?2, reason = ?3, by_whom = ?4, leftover = 1,"
                        " crcs = excluded.crcs",
                        session.number, now_unix_ns, kReason, by, session.chunks));
    RETURN_IF_ERROR(
        connection_.run("UPDATE derived_recordings SET complete = 0 WHERE session = ?", session.number));
    RETURN_IF_ERROR(connection_.run("DELETE FROM scores WHERE session = ?", session.number));
    erasure.set_scores(erasure.scores() + static_cast<std::uint64_t>(connection_.changes()));
    RETURN_IF_ERROR(connection_.run("DELETE FROM session_events WHERE session = ?", session.number));
    // a misspelt name names the person too
    RETURN_IF_ERROR(connection_.run("DELETE FROM unknown_trainees WHERE session = ?", session.number));
    auto remarks = connection_.query("SELECT count(*) FROM annotations WHERE session = ?", session.number);
    RETURN_IF_ERROR(remarks.step());
    erasure.set_remarks_kept(erasure.remarks_kept() + remarks.natural(0));
  }
  erasure.set_sessions(sessions.size());
  auto left = connection_.query("SELECT count(*) FROM sessions WHERE trainee = ?", name);
  RETURN_IF_ERROR(left.step());
  erasure.set_waiting_sessions(left.natural(0));
  return {};
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

void clearDeviceWords(pb::SessionDescription& description) {
  description.clear_device();
  description.clear_axial_model();
  description.clear_live_effects();
  description.clear_device_notes();
}

}  // namespace needlelab
