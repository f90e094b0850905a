#include "db/erasure.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <utility>

#include "common/base/text.h"
#include "db/audit_chain.h"
#include "db/documents.h"
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
/// remarks, which are many, are eraseRemarks()'s.
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
constexpr std::uint64_t kPageBytes = 4096;

/// SQL: whether an erasure of the name ?1 takes the session `s`; ?2: those that wait under an account's name,
/// too.
std::string isTaken() {
  return fmt::format(
      "s.trainee = ?1 AND (?2 OR s.number NOT IN {} OR NOT EXISTS (SELECT 1 FROM people WHERE name = ?1))",
      kWaitingSessions);
}

struct TextRow {
  std::int64_t id = 0;
  std::vector<std::string> texts;
};

Result<std::vector<TextRow>> textRows(Statement rows, int texts) {
  return rows.all([&](const Statement& row) {
    TextRow one{row.integer(0), {}};
    for (int i = 1; i <= texts; ++i) one.texts.push_back(row.text(i));
    return one;
  });
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

/// Calls `take` for each row, a page of rows at a time, so that memory does not grow with the table. `sql`
/// takes the last number (?1), the rows of a page (?2) and `values`, and gives rows by number.
template <typename Take, typename... Values>
Status eachRow(Connection& connection, std::string_view sql, int texts, const Take& take,
               const Values&... values) {
  constexpr std::size_t kPage = 256;
  for (std::int64_t last = -1;;) {
    ASSIGN_OR_RETURN(const auto rows,
                     textRows(connection.query(sql, last, std::uint64_t{kPage}, values...), texts));
    for (const TextRow& row : rows) RETURN_IF_ERROR(take(row));
    if (rows.size() < kPage) return {};
    last = rows.back().id;
  }
}

}  // namespace

Status ErasureStore::noteRow() {
  return ++rows_ < kRowsBetweenLooks ? Status() : requireRoom();
}

Status ErasureStore::requireRoom(std::uint64_t bytes) {
  rows_ = 0;
  ASSIGN_OR_RETURN(const auto pages, connection_.prepare("PRAGMA page_count").first([](const Statement& row) {
    return row.natural(0);
  }));
  const auto& path = connection_.path();
  std::error_code error;
  const std::uint64_t file = std::filesystem::file_size(path, error);
  if (error) return {};
  // the file grows only when the log is emptied
  const std::uint64_t grown = std::max(pages.value_or(0) * kPageBytes, file) - file;
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
                           "nothing was erased; make room on it, then erase again",
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

Result<pb::Erasure> ErasureStore::erase(const std::string& name, const ErasureLine& line,
                                        const std::string& by, const std::string& reason,
                                        std::int64_t now_unix_ns, bool with_waiting) {
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(name));
  if (!person) {
    auto some = connection_.query(
        "SELECT 1 FROM sessions WHERE trainee = ?1 UNION ALL SELECT 1 FROM unknown_trainees WHERE given = ?1"
        " LIMIT 1",
        name);
    ASSIGN_OR_RETURN(const bool found, some.step());
    if (!found)
      return Error{ErrorCode::kNotFound, "there is no person named '" + name + "', and no session of one"};
  } else if (auto last = PeopleStore(connection_).change(name, {}, {.disabled = true}, by, now_unix_ns);
             !last) {
    return last.error();  // the last administrator
  }
  ErasedNames names{name, {}, {}, line.pseudonym, {}};
  ASSIGN_OR_RETURN(auto earlier, loggedFullNames(connection_, name));
  names.full_names = std::move(earlier);
  if (person && !person->full_name.empty()) {
    std::erase(names.full_names, person->full_name);
    names.full_names.push_back(person->full_name);
  }
  // names that its stations gave for this person: a misspelt one names it in its sessions' remarks and lines,
  // unless somebody has it by now
  ASSIGN_OR_RETURN(auto given, connection_
                                   .query("SELECT DISTINCT u.given FROM unknown_trainees u JOIN sessions s"
                                          " ON s.number = u.session WHERE s.trainee = ?1 AND u.given <> ?1"
                                          " AND u.given NOT IN (SELECT name FROM people)"
                                          " ORDER BY length(u.given) DESC, u.given",
                                          name)
                                   .all(firstText));
  names.given = std::move(given);
  // before the names of groups count as other names, which stay
  Elsewhere elsewhere;
  ASSIGN_OR_RETURN(const auto group_ids, eraseInGroups(names, elsewhere));
  RETURN_IF_ERROR(addOthers(connection_, names));
  pb::Erasure erasure;
  erasure.set_pseudonym(line.pseudonym);
  std::set<std::string> sessions;
  RETURN_IF_ERROR(eraseSessions(names, with_waiting, now_unix_ns, by, sessions, erasure));
  RETURN_IF_ERROR(eraseRemarks(names, elsewhere));
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
  RETURN_IF_ERROR(connection_.run("DELETE FROM import_pieces"));
  RETURN_IF_ERROR(eraseAccess(connection_, name));
  RETURN_IF_ERROR(MetaStore(connection_).set(kFreePartsKey, line.pseudonym));
  // an ANALYZE by a SQLite with STAT4 left samples of the indexes, names among them
  ASSIGN_OR_RETURN(
      const auto samples,
      connection_.prepare("SELECT name FROM sqlite_schema WHERE type = 'table' AND name = 'sqlite_stat4'")
          .first(firstText));
  if (samples) RETURN_IF_ERROR(connection_.run("DELETE FROM sqlite_stat4"));
  RETURN_IF_ERROR(eraseWords(names, sessions, erasure, elsewhere));
  RETURN_IF_ERROR(remember(line, line.without_account && !person, by, withoutNames(reason, names, true)));
  ASSIGN_OR_RETURN(auto left, leftOver(names, group_ids));
  ASSIGN_OR_RETURN(const auto alike, sessionsAlike(names));
  ASSIGN_OR_RETURN(const auto perhaps, perhapsLeft(names));
  erasure.set_text(alike + elsewhere.text() + left + perhaps);
  return erasure;
}

Status ErasureStore::eraseSessions(const ErasedNames& names, bool with_waiting, std::int64_t now_unix_ns,
                                   const std::string& by, std::set<std::string>& ids, pb::Erasure& erasure) {
  const std::string& name = names.name;
  const std::string& pseudonym = names.in_its_place;
  struct Session {
    std::int64_t number = 0;
    pb::SessionState state = pb::SESSION_OPEN;
    int recording = 1;
    std::uint64_t chunks = 0;
    std::string description, id;
  };
  const auto sessionOf = [](const Statement& row) {
    return Session{row.integer(0),
                   static_cast<pb::SessionState>(row.integer(1)),
                   static_cast<int>(row.integer(2)),
                   row.natural(3),
                   row.text(4),
                   sessionText(row.text(5))};
  };
  ASSIGN_OR_RETURN(const auto sessions, connection_
                                            .query("SELECT s.number, s.state, s.recording, coalesce(p.chunks,"
                                                   " s.chunks), s.description, s.id FROM sessions s"
                                                   " LEFT JOIN session_progress p ON p.session = s.number"
                                                   " WHERE " +
                                                       isTaken(),
                                                   name, with_waiting)
                                            .all(sessionOf));
  constexpr std::string_view kReason = "the data of its person was erased";
  for (const Session& session : sessions) {
    RETURN_IF_ERROR(requireRoom());  // its events and scores have a few MB
    ids.insert(session.id);
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

std::string ErasureStore::Elsewhere::text() const {
  std::string text;
  const auto add = [&](std::size_t count, std::string_view what) {
    if (count > 0) text += (text.empty() ? "" : "; ") + fmt::format("{} {}", count, what);
  };
  add(remarks, "remarks in sessions of others");
  add(groups, "names of groups");
  add(audit_lines, "lines of the audit log about others");
  return text.empty() ? text : "The name was also replaced in: " + text + ". ";
}

Status ErasureStore::eraseRemarks(const ErasedNames& names, Elsewhere& elsewhere) {
  // remarks also name people in other people's sessions; parts of a full name and given names are replaced
  // only in the person's own sessions
  const auto replace = [&](const TextRow& remark) -> Status {
    const bool own = remark.texts[1] == "1";
    const std::string text = withoutNames(remark.texts[0], names, own);
    if (text == remark.texts[0]) return {};
    elsewhere.remarks += own ? 0 : 1;
    RETURN_IF_ERROR(connection_.run("UPDATE annotations SET text = ? WHERE id = ?", text, remark.id));
    return noteRow();
  };
  RETURN_IF_ERROR(eachRow(connection_,
                          "SELECT a.id, a.text, s.trainee = ?3 FROM annotations a"
                          " JOIN sessions s ON s.number = a.session WHERE a.id > ?1 ORDER BY a.id LIMIT ?2",
                          2, replace, names.in_its_place));
  return eachRow(
      connection_, "SELECT id FROM annotations WHERE id > ?1 AND author = ?3 ORDER BY id LIMIT ?2", 0,
      [&](const TextRow& remark) -> Status {
        RETURN_IF_ERROR(
            connection_.run("UPDATE annotations SET author = ? WHERE id = ?", names.in_its_place, remark.id));
        return noteRow();
      },
      names.name);
}

Result<std::vector<std::string>> ErasureStore::eraseInGroups(ErasedNames names, Elsewhere& elsewhere) {
  RETURN_IF_ERROR(addOthers(connection_, names, false));
  struct Group {
    std::string id, name;
  };
  ASSIGN_OR_RETURN(
      const auto groups,
      connection_.prepare("SELECT id, name FROM groups ORDER BY id").all([](const Statement& row) {
        return Group{row.text(0), row.text(1)};
      }));
  std::vector<std::string> ids;
  for (const Group& group : groups) {
    if (withoutNames(group.id, names, false) != group.id) ids.push_back(group.id);
    const std::string name = withoutNames(group.name, names, false);
    if (name == group.name) continue;
    ++elsewhere.groups;
    // another revision: an edit that was begun before would bring the name back
    RETURN_IF_ERROR(
        connection_.run("UPDATE groups SET name = ?, revision = revision + 1 WHERE id = ?", name, group.id));
  }
  return ids;
}

Result<std::string> ErasureStore::leftOver(const ErasedNames& names,
                                           const std::vector<std::string>& group_ids) {
  std::string text;
  for (const std::string& id : group_ids)
    text += (text.empty() ? "" : "; ") + ("the id of the group '" + id + "' (make the group anew)");
  ErasedNames whole = names;  // given names, too, but no parts of full names
  whole.full_names.insert(whole.full_names.end(), names.given.begin(), names.given.end());
  const auto hasName = [&](const std::string& words) { return withoutNames(words, whole, false) != words; };
  ASSIGN_OR_RETURN(const auto documents,
                   connection_
                       .prepare("SELECT 'profile', id, json FROM profiles UNION ALL"
                                " SELECT 'course', id, json FROM curricula")
                       .all([](const Statement& row) {
                         return std::pair{row.text(0) + " '" + row.text(1) + "'", row.text(2)};
                       }));
  std::set<std::string> named;
  for (const auto& [which, json] : documents)
    if (hasName(json)) named.insert(which);
  for (const std::string& which : named)
    text += (text.empty() ? "" : "; ") + ("revisions of the " + which + " (nobody can remove them)");
  // not replaced: a person may be called as a device is, and the station sends its words and its profile
  // again
  constexpr std::size_t kNamed = 3;
  std::size_t found = 0;
  std::string ids;
  std::map<std::size_t, bool> profiles;  // by the hash of their text: many sessions share one
  auto rows = connection_.prepare(
      "SELECT id, description, profile_json FROM sessions WHERE erased = 0 ORDER BY number");
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) break;
    pb::SessionDescription description;
    if (!description.ParseFromString(std::string(textOf(rows.bytes(1))))) continue;  // `check` says it
    const std::string profile = rows.text(2);
    const auto [known, is_new] = profiles.try_emplace(std::hash<std::string>()(profile), false);
    if (is_new) known->second = hasName(profile);
    const auto& notes = description.device_notes();
    if (!known->second && !hasName(description.device()) && !hasName(description.axial_model()) &&
        std::none_of(notes.begin(), notes.end(), hasName))
      continue;
    if (++found <= kNamed) ids += (ids.empty() ? "" : ", ") + sessionText(rows.text(0));
  }
  if (found > 0)
    text += fmt::format("{}the words about device and patient in {} sessions of others, such as {}",
                        text.empty() ? "" : "; ", found, ids);
  return text.empty() ? text : "These have the name and stay as they are: " + text + ". ";
}

Result<std::string> ErasureStore::sessionsAlike(const ErasedNames& names) {
  ErasedNames all = names;
  all.others = {};  // the names of these sessions are among them
  auto rows = connection_.query(
      "SELECT trainee, count(*) FROM sessions WHERE erased = 0 AND trainee NOT IN ('', ?1, ?2)"
      " AND trainee NOT IN (SELECT name FROM people) GROUP BY trainee ORDER BY trainee",
      names.name, kGuestName);
  constexpr std::size_t kNamed = 100;
  const NameSearch search(all);
  std::size_t found = 0;
  std::string text;
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) break;
    const std::string trainee = rows.text(0);
    if (!search.finds(trainee) || ++found > kNamed) continue;
    text += (text.empty() ? "" : ", ") + fmt::format("'{}' ({})", printable(trainee), rows.natural(1));
  }
  if (found == 0) return text;
  if (found > kNamed) text += fmt::format(" and {} names more", found - kNamed);
  return "Sessions under names that nobody has and that are like this person's stay with their recordings: " +
         text +
         ". Whose they are a manager must say: give them to the right person (needlelab-admin session list "
         "--unknown-trainee, session assign), or erase each of these names, too (needlelab-admin person "
         "erase). ";
}

Result<std::string> ErasureStore::perhapsLeft(const ErasedNames& names) {
  struct Place {
    std::string_view what, sql;  // rows: what tells the text from others, and the text
  };
  constexpr Place kTexts[] = {
      {"{} remarks, such as number {}", "SELECT id, text FROM annotations ORDER BY id"},
      {"the names of {} groups, such as {}", "SELECT id, name FROM groups ORDER BY id"},
      {"{} lines of the audit log, such as {}",
       "SELECT id, who || char(10) || subject || char(10) || detail || char(10) || coalesce(imported_by, '')"
       " || char(10) || coalesce(imported_from, '') FROM audit ORDER BY id"},
      {"the reasons of {} erasures, such as {}", "SELECT pseudonym, reason FROM erasures ORDER BY pseudonym"},
      {"the notes of {} consents, such as that of {}", "SELECT person, note FROM consents ORDER BY id"},
      {"{} names that stations gave for sessions of others, such as {}",
       "SELECT given, given FROM unknown_trainees WHERE by_whom IS NOT NULL GROUP BY given ORDER BY given"},
      {"the names of {} stations, such as {}", "SELECT name, name FROM stations ORDER BY name"},
      {"the ids of {} profiles and courses, such as {}",
       "SELECT id, id FROM profiles UNION SELECT id, id FROM curricula ORDER BY 1"},
      {"{} facts about this database (meta), such as {}", "SELECT key, value FROM meta ORDER BY key"},
  };
  // only accounts are surely others: a station or a trainee whom nobody knows may be called after this person
  ASSIGN_OR_RETURN(
      const auto accounts,
      connection_.prepare("SELECT name FROM people UNION SELECT full_name FROM people").all(firstText));
  const std::set<std::string> of_others(accounts.begin(), accounts.end());
  ErasedNames searched = names;
  std::vector<std::string> others = names.others.list();
  std::erase_if(others, [&](const std::string& other) { return !of_others.contains(other); });
  searched.others = OtherNames(std::move(others));
  const NameSearch search(searched);
  constexpr std::size_t kNamed = 3;
  std::string text;
  for (const Place& place : kTexts) {
    std::size_t found = 0;
    std::string some;
    auto rows = connection_.prepare(place.sql);
    for (;;) {
      ASSIGN_OR_RETURN(const bool more, rows.step());
      if (!more) break;
      if (!search.finds(rows.text(1))) continue;
      if (++found <= kNamed) some += (some.empty() ? "" : ", ") + rows.text(0);
    }
    if (found > 0) text += (text.empty() ? "" : "; ") + fmt::format(fmt::runtime(place.what), found, some);
  }
  if (text.empty()) return text;
  return "These have the letters of a name of this person, as a part of another word, as a word of the full "
         "name or as a name that a station gave, and stay as they are; look whom they mean: " +
         text + ". ";
}

Status ErasureStore::eraseWords(const ErasedNames& names, const std::set<std::string>& sessions,
                                pb::Erasure& erasure, Elsewhere& elsewhere) {
  RETURN_IF_ERROR(eraseDoers(names));
  // what the stations gave for sessions that were assigned; those that wait keep it
  RETURN_IF_ERROR(
      connection_.run("UPDATE unknown_trainees SET given = ? WHERE given = ? AND by_whom IS NOT NULL",
                      names.in_its_place, names.name));
  // the audit log keeps its lines and their order; only the name changes
  return eachRow(connection_,
                 "SELECT id, who, action, subject, detail, coalesce(imported_by, '') FROM audit WHERE id > ?1"
                 " ORDER BY id LIMIT ?2",
                 5, [&](const TextRow& line) -> Status {
                   const AuditRow before{
                       0, 0, line.texts[0], line.texts[1], line.texts[2], line.texts[3], line.texts[4]};
                   AuditRow after = withoutNames(before, names, sessions);
                   if (before.imported_by == names.name) after.imported_by = names.in_its_place;
                   if (after.who == before.who && after.subject == before.subject &&
                       after.detail == before.detail && after.imported_by == before.imported_by)
                     return {};
                   erasure.set_audit_lines(erasure.audit_lines() + 1);
                   if (after.detail != before.detail && after.subject == before.subject &&
                       !sessions.contains(before.subject))
                     ++elsewhere.audit_lines;
                   RETURN_IF_ERROR(
                       connection_.run("UPDATE audit SET who = ?1, subject = ?2, detail = ?3,"
                                       " imported_by = nullif(?4, '') WHERE id = ?5",
                                       after.who, after.subject, after.detail, after.imported_by, line.id));
                   RETURN_IF_ERROR(AuditChain(connection_).amend(line.id));
                   return noteRow();
                 });
}

Status ErasureStore::eraseDoers(const ErasedNames& names) {
  for (const auto& [table, column, long_text] : kDoers) {
    ASSIGN_OR_RETURN(const auto bytes,
                     connection_
                         .query(fmt::format("SELECT coalesce(sum(length({}) + {}), 0) FROM {} WHERE {} = ?",
                                            long_text, kPageBytes, table, column),
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
