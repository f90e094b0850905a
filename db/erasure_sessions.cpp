// Which sessions of a name an erasure takes, and erasing them, in pages or in the erasure's transaction.
#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "db/erasure.h"
#include "db/people.h"
#include "db/session_rows.h"
#include "db/session_words.h"
#include "db/text_pages.h"
#include "db/unknown_trainees.h"

namespace needlelab {
namespace {

/// SQL: whether an erasure of the name ?1 takes the session `s`. ?2: those that wait under an account's name,
/// too. ?3: untilOf() its line.
std::string isTaken() {
  return fmt::format(
      "s.trainee = ?1 AND CASE WHEN CAST(?3 AS BIGINT) IS NULL THEN ?2 = 1 OR s.number NOT IN {0} OR NOT "
      "EXISTS ({1})"
      " ELSE s.received_unix_ns <= ?3 AND NOT EXISTS ({1} AND created_unix_ns <= ?3)"
      " AND (s.number IN {0} OR NOT EXISTS ({1})) END",
      kWaitingSessions, "SELECT 1 FROM people WHERE name = ?1");
}

/// Of a name that nobody had, the time up to which it goes: what comes later is another's.
std::optional<std::int64_t> untilOf(const ErasureLine& line) {
  return line.without_account ? std::optional(line.unix_ns) : std::nullopt;
}

Result<std::int64_t> newestOf(Connection& connection, std::string_view sql) {
  ASSIGN_OR_RETURN(const auto newest,
                   connection.prepare(sql).first([](const Statement& row) { return row.integer(0); }));
  return newest.value_or(0);
}

}  // namespace

Result<std::vector<std::string>> ErasureStore::openSessions(std::string_view name, bool with_waiting) {
  return connection_
      .query(
          "SELECT s.id, s.station FROM sessions s WHERE " + isTaken() + " AND s.state = ?4 ORDER BY s.number",
          name, with_waiting, std::optional<std::int64_t>(), static_cast<int>(pb::SESSION_OPEN))
      .all([](const Statement& row) {
        return sessionText(row.text(0)) + " at station '" + row.text(1) + "'";
      });
}

Result<std::int64_t> ErasureStore::erasedAt(std::string_view name, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto newest,
                   connection_
                       .query("SELECT max(made) FROM (SELECT created_unix_ns AS made FROM people"
                              " WHERE name = ?1 UNION ALL SELECT received_unix_ns FROM sessions"
                              " WHERE trainee = ?1 UNION ALL SELECT s.received_unix_ns"
                              " FROM unknown_trainees u JOIN sessions s ON s.number = u.session"
                              " WHERE u.given = ?1) AS traces",
                              name)
                       .first([](const Statement& row) { return row.integer(0); }));
  return std::max(now_unix_ns, newest.value_or(0));
}

Status ErasureStore::mayErase(const std::string& name, const ErasureLine& line, bool with_waiting) {
  if (!line.without_account) {
    ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(name));
    if (person) return PeopleStore(connection_).checkNotLast(*person);
  }
  auto some = connection_.query(
      "SELECT 1 FROM sessions s WHERE " + isTaken() +
          " UNION ALL SELECT 1 FROM unknown_trainees u JOIN sessions s ON s.number = u.session"
          " WHERE u.given = ?1 AND (CAST(?3 AS BIGINT) IS NULL OR (s.received_unix_ns <= ?3"
          " AND NOT EXISTS (SELECT 1 FROM people WHERE name = ?1))) LIMIT 1",
      name, with_waiting, untilOf(line));
  ASSIGN_OR_RETURN(const bool found, some.step());
  if (found) return {};
  return Error{ErrorCode::kNotFound, "there is no person named '" + name + "', and no session of one"};
}

Result<PersonTraces> ErasureStore::tracesOf(const std::string& name, const ErasureLine& line,
                                            bool with_waiting, const PersonTraces* before) {
  PersonTraces who;
  who.names = {name, {}, {}, line.pseudonym, {}, line.without_account};
  const auto addLast = [](std::vector<std::string>& all, const std::string& one) {
    std::erase(all, one);
    all.push_back(one);
  };
  if (!line.without_account) {
    // the log says each name that was changed; all of it is read once
    if (before != nullptr) who.names.full_names = before->names.full_names;
    ASSIGN_OR_RETURN(const auto logged,
                     loggedFullNames(connection_, name, before != nullptr ? before->last_line : -1));
    for (const std::string& full_name : logged) addLast(who.names.full_names, full_name);
    ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(name));
    if (person && !person->full_name.empty()) addLast(who.names.full_names, person->full_name);
  }
  // names that its stations gave for this person: a misspelt one names it in its sessions' remarks and lines,
  // unless somebody has it by now
  ASSIGN_OR_RETURN(who.names.given, connection_
                                        .query("SELECT u.given FROM unknown_trainees u"
                                               " JOIN sessions s ON s.number = u.session WHERE " +
                                                   isTaken() +
                                                   " AND u.given <> ?1"
                                                   " AND u.given NOT IN (SELECT name FROM people)"
                                                   " GROUP BY u.given ORDER BY length(u.given) DESC, u.given",
                                               name, with_waiting, untilOf(line))
                                        .all(firstText));
  // the sessions that are erased already no longer have theirs
  if (before != nullptr)
    for (const std::string& given : before->names.given) addLast(who.names.given, given);
  auto rows =
      connection_.query("SELECT s.number, s.id FROM sessions s WHERE (" + isTaken() + ") OR s.trainee = ?4",
                        name, with_waiting, untilOf(line), line.pseudonym);
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) break;
    who.sessions.insert(rows.integer(0));
    who.session_ids.insert(sessionText(rows.text(1)));
  }
  ASSIGN_OR_RETURN(who.last_session, newestOf(connection_, "SELECT max(number) FROM sessions"));
  ASSIGN_OR_RETURN(who.last_remark, newestOf(connection_, "SELECT max(id) FROM annotations"));
  ASSIGN_OR_RETURN(who.last_line, newestOf(connection_, "SELECT max(id) FROM audit"));
  return who;
}

Result<ErasureStore::OwnSessions> ErasureStore::sessionsToErase(const std::string& name,
                                                                const ErasureLine& line, bool with_waiting,
                                                                std::uint64_t most_bytes) {
  OwnSessions own;
  const std::string some =
      "SELECT s.number, s.state, s.recording, coalesce(p.chunks, s.chunks), s.description,"
      " length(s.profile_json) + length(s.description) + coalesce(length(s.score_json), 0)"
      " + 4 * coalesce(p.chunks, s.chunks)"
      " + (SELECT coalesce(sum(length(measures)), 0) FROM scores WHERE session = s.number)"
      " + (SELECT coalesce(sum(256 + length(begin_tissue) + length(end_tissue) + length(hazards)), 0)"
      " FROM session_events WHERE session = s.number)"
      " FROM sessions s LEFT JOIN session_progress p ON p.session = s.number WHERE " +
      isTaken() + " AND s.number > ?4 ORDER BY s.number LIMIT ?5";
  RowsAtOnce at_once(most_bytes);
  std::uint64_t bytes = 0;
  for (std::int64_t after = -1;;) {
    auto rows = connection_.query(some, name, with_waiting, untilOf(line), after, at_once.count());
    for (bool all = false; !all;) {
      ASSIGN_OR_RETURN(const bool there, rows.step());
      if (!there) return own;
      if (bytes >= most_bytes) {
        own.more = true;
        return own;
      }
      own.sessions.push_back({rows.integer(0), static_cast<pb::SessionState>(rows.integer(1)),
                              static_cast<int>(rows.integer(2)), rows.natural(3), rows.text(4)});
      after = rows.integer(0);
      bytes += rows.natural(5);
      all = at_once.took(rows.natural(5));
    }
  }
}

Result<bool> ErasureStore::eraseSomeSessions(const std::string& name, const ErasureLine& line,
                                             const std::string& by, std::int64_t now_unix_ns,
                                             bool with_waiting, FoundNames& found) {
  RETURN_IF_ERROR(mayErase(name, line, with_waiting));
  ASSIGN_OR_RETURN(const auto own, sessionsToErase(name, line, with_waiting, kBytesOfPage));
  if (!own.more) return false;
  pb::Erasure counts = found.sessions;  // what is undone does not count
  RETURN_IF_ERROR(eraseSessions(own.sessions, found.who.names, now_unix_ns, by, counts));
  found.sessions = std::move(counts);
  return true;
}

Status ErasureStore::eraseSessions(const std::vector<OwnSession>& sessions, const ErasedNames& names,
                                   std::int64_t now_unix_ns, const std::string& by, pb::Erasure& erasure) {
  constexpr std::string_view kReason = "the data of its person was erased";
  ErasedDescriptions descriptions(connection_, names);
  for (const OwnSession& session : sessions) {
    RETURN_IF_ERROR(requireRoom());  // its events and scores have a few MB
    pb::SessionDescription description;
    if (!description.ParseFromString(session.description))
      return Error{ErrorCode::kCorrupt, "the stored description of a session cannot be read"};
    RETURN_IF_ERROR(descriptions.erase(description));
    RETURN_IF_ERROR(
        connection_.run("UPDATE sessions"
                        " SET trainee = ?, exercise_id = ?, profile_id = ?, engine_version = ?,"
                        " description = ?, profile_json = ?, erased = 1, score_json = NULL,"
                        " passed = NULL, events = 0, recording = 3, clock_offset_ns = NULL,"
                        " clock_round_trip_ns = NULL WHERE number = ?",
                        description.trainee(), description.exercise_id(), description.profile_id(),
                        description.engine_version(), viewOf(description.SerializeAsString()), kErasedProfile,
                        session.number));
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
  erasure.set_sessions(erasure.sessions() + sessions.size());
  return {};
}

}  // namespace needlelab
