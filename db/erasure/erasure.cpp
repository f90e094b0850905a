#include "db/erasure/erasure.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>
#include <sstream>
#include <string>

#include "common/base/bytes.h"
#include "common/base/files/files.h"
#include "db/people/people.h"
#include "db/people/person_name.h"
#include "db/people/person_refs.h"
#include "db/people/pseudonyms.h"
#include "db/sessions/session_rows.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

/// The sessions that an erasure of ?1 covers; ?2: also those that wait for its code.
constexpr std::string_view kTaken =
    "SELECT number FROM sessions WHERE trainee = ?1 AND erased = 0"
    " AND (?2 = 1 OR NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number))";

Uuid uuidAt(const Statement& row, int at) {
  return uuidOf(textOf(row.bytes(at))).value_or(Uuid{});  // a CHECK guarantees the length
}

}  // namespace

Result<std::vector<std::string>> ErasureStore::openSessions(std::string_view ref, bool with_waiting) {
  ASSIGN_OR_RETURN(auto open, connection_
                                  .query(fmt::format("SELECT id, station FROM sessions WHERE number IN ({})"
                                                     " AND state = ?3 ORDER BY number",
                                                     kTaken),
                                         ref, with_waiting, static_cast<int>(pb::SESSION_OPEN))
                                  .all([](const Statement& row) {
                                    return sessionText(row.text(0)) + " at station '" + row.text(1) + "'";
                                  }));
  ASSIGN_OR_RETURN(const auto typed, typedAs(ref));
  if (!with_waiting || !typed) return open;
  ASSIGN_OR_RETURN(const auto others, openSessions(*typed, true));
  open.insert(open.end(), others.begin(), others.end());
  return open;
}

Result<std::optional<std::string>> ErasureStore::typedAs(std::string_view ref) {
  return connection_
      .query(
          "SELECT t.ref FROM called a JOIN called t ON t.folded = a.folded"
          " WHERE a.ref = ? AND a.typed = 0 AND t.typed = 1",
          ref)
      .first(firstText);
}

Result<Uuid> ErasureStore::lab() {
  ASSIGN_OR_RETURN(const auto id, MetaStore(connection_).get(kLabKey));
  return parseUuid(id.value_or(""));
}

Result<ErasureLine> ErasureStore::lineOf(std::string_view ref, std::int64_t unix_ns) {
  ErasureLine line;
  line.unix_ns = unix_ns;
  ASSIGN_OR_RETURN(line.lab, lab());
  ASSIGN_OR_RETURN(const auto uuid,
                   connection_.query("SELECT uuid FROM people WHERE ref = ? AND erased_unix_ns IS NULL", ref)
                       .first([](const Statement& row) { return uuidAt(row, 0); }));
  if (!uuid) return Error{ErrorCode::kNotFound, fmt::format("there is no person named '{}'", ref)};
  line.person = *uuid;
  return line;
}

Result<pb::Erasure> ErasureStore::erase(const std::string& ref, const ErasureOrder& order) {
  ASSIGN_OR_RETURN(const auto line, lineOf(ref, order.now_unix_ns));
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(ref));
  if (person) RETURN_IF_ERROR(PeopleStore(connection_).checkNotLast(*person));
  pb::Erasure erasure;
  erasure.set_pseudonym(erasedName(ref));
  ASSIGN_OR_RETURN(const auto typed, typedAs(ref));

  // a misspelt name also names the person if all its sessions turned out to be theirs
  ASSIGN_OR_RETURN(
      const auto ids,
      connection_
          .query("SELECT id FROM people WHERE ref = ?1 OR (role = 0 AND NOT EXISTS (SELECT 1 FROM sessions"
                 " WHERE trainee = people.ref) AND EXISTS (SELECT 1 FROM unknown_trainees u JOIN sessions s"
                 " ON s.number = u.session WHERE u.given = people.ref AND s.trainee = ?1) AND NOT EXISTS"
                 " (SELECT 1 FROM unknown_trainees u JOIN sessions s ON s.number = u.session"
                 " WHERE u.given = people.ref AND s.trainee <> ?1))",
                 ref)
          .all(firstText));
  const std::string gone = fmt::format("{}", fmt::join(ids, ","));
  ASSIGN_OR_RETURN(const bool sessions_stay, LabSettingsStore(connection_).keepsRecordingsOfErased());
  if (sessions_stay)
    erasure.set_text("The sessions stay, as of " + erasedName(ref) + ": the lab keeps them. ");
  else
    RETURN_IF_ERROR(eraseSessions(ref, order, erasure));
  ASSIGN_OR_RETURN(
      const auto names,
      connection_.prepare(fmt::format("SELECT name FROM names WHERE person IN ({})", gone)).all(firstText));
  ASSIGN_OR_RETURN(const auto key, PseudonymKey::ofFolder(connection_.path().parent_path()));
  for (const std::string& name : names)
    RETURN_IF_ERROR(
        connection_.run("INSERT INTO erased_names (hash, until_unix_ns) VALUES (?,?)"
                        " ON CONFLICT (hash) DO UPDATE SET until_unix_ns = excluded.until_unix_ns",
                        ByteView(key.nameHash(nameKey(name))), order.now_unix_ns + kErasedNamesKept_ns));
  RETURN_IF_ERROR(rewriteNames(gone));
  for (const char* const sql :
       {"DELETE FROM assignments WHERE trainee = ?", "DELETE FROM consents WHERE person = ?",
        "DELETE FROM group_members WHERE person = ?"})
    RETURN_IF_ERROR(connection_.run(sql, ref));
  RETURN_IF_ERROR(
      connection_.run("UPDATE people SET password_hash = NULL, code_hash = NULL, disabled = 1,"
                      " erased_unix_ns = ? WHERE ref = ?",
                      order.now_unix_ns, ref));
  RETURN_IF_ERROR(
      connection_.run("INSERT INTO erasures (uuid, erased_unix_ns, by_whom, reason) VALUES (?,?,?,?)"
                      " ON CONFLICT (uuid) DO NOTHING",
                      ByteView(line.person), order.now_unix_ns, order.by, order.reason));
  ASSIGN_OR_RETURN(
      const auto waiting,
      connection_
          .query("SELECT count(*) FROM sessions WHERE erased = 0 AND ((trainee = ?2 AND ?1 <> ?2)"
                 " OR (trainee = ?1 AND EXISTS"
                 " (SELECT 1 FROM uncounted_sessions WHERE session = number)))",
                 ref, typed.value_or(ref))
          .first([](const Statement& row) { return row.natural(0); }));
  erasure.set_waiting_sessions(waiting.value_or(0));
  if (!typed || !order.with_waiting) return erasure;
  ASSIGN_OR_RETURN(const auto more, erase(*typed, order));
  erasure.set_sessions(erasure.sessions() + more.sessions());
  erasure.set_recordings(erasure.recordings() + more.recordings());
  erasure.set_scores(erasure.scores() + more.scores());
  erasure.set_remarks_kept(erasure.remarks_kept() + more.remarks_kept());
  erasure.set_waiting_sessions(0);
  return erasure;
}

Status ErasureStore::eraseSessions(const std::string& ref, const ErasureOrder& order, pb::Erasure& erasure) {
  constexpr std::string_view kReason = "the data of its person was erased";
  const auto run = [&](std::string_view sql) {
    return connection_.run(fmt::format(fmt::runtime(sql), kTaken), ref, order.with_waiting);
  };
  const auto count = [&](std::string_view sql) -> Result<std::uint64_t> {
    ASSIGN_OR_RETURN(const auto found,
                     connection_.query(fmt::format(fmt::runtime(sql), kTaken), ref, order.with_waiting)
                         .first([](const Statement& row) { return row.natural(0); }));
    return found.value_or(0);
  };
  ASSIGN_OR_RETURN(const auto sessions, count("SELECT count(*) FROM ({}) AS taken"));
  erasure.set_sessions(sessions);
  if (sessions == 0) return {};
  ASSIGN_OR_RETURN(
      const auto recordings,
      count("SELECT count(*) FROM sessions s LEFT JOIN session_progress p ON p.session = s.number"
            " WHERE s.number IN ({}) AND s.recording <> 3 AND coalesce(p.chunks, s.chunks) > 0"));
  erasure.set_recordings(recordings);
  ASSIGN_OR_RETURN(const auto remarks, count("SELECT count(*) FROM annotations WHERE session IN ({})"));
  erasure.set_remarks_kept(remarks);
  // Retention removes the chunks in pieces. Their CRCs are not needed, because chunks that a station resends
  // are accepted unread.
  RETURN_IF_ERROR(connection_.run(
      fmt::format(
          "INSERT INTO removed_originals (session, removed_unix_ns, deleted_unix_ns, reason, by_whom,"
          " leftover, crcs) SELECT s.number, ?3, ?3, ?4, ?5, 1, zeroblob(4 * coalesce(p.chunks, s.chunks))"
          " FROM sessions s LEFT JOIN session_progress p ON p.session = s.number WHERE s.number IN ({})"
          " ON CONFLICT (session) DO UPDATE SET deleted_unix_ns = excluded.deleted_unix_ns,"
          " reason = excluded.reason, by_whom = excluded.by_whom, leftover = 1, crcs = excluded.crcs",
          kTaken),
      ref, order.with_waiting, order.now_unix_ns, kReason, order.by));
  RETURN_IF_ERROR(run("UPDATE derived_recordings SET complete = 0 WHERE session IN ({})"));
  RETURN_IF_ERROR(run("DELETE FROM scores WHERE session IN ({})"));
  erasure.set_scores(static_cast<std::uint64_t>(connection_.changes()));
  RETURN_IF_ERROR(run("DELETE FROM session_events WHERE session IN ({})"));
  RETURN_IF_ERROR(run("DELETE FROM unknown_trainees WHERE by_whom IS NULL AND session IN ({})"));
  // closes an open session; its hash was never computed, and no chunks will be left to hash
  RETURN_IF_ERROR(
      connection_.run(fmt::format("UPDATE sessions SET state = ?3, hash = zeroblob(32), closed_unix_ns = ?4"
                                  " WHERE number IN ({}) AND state = ?5",
                                  kTaken),
                      ref, order.with_waiting, static_cast<int>(pb::SESSION_INTERRUPTED), order.now_unix_ns,
                      static_cast<int>(pb::SESSION_OPEN)));
  return run(
      "UPDATE sessions SET erased = 1, score_json = NULL, passed = NULL, events = 0, recording = 3,"
      " profile_json = '{{}}', clock_offset_ns = NULL, clock_round_trip_ns = NULL WHERE number IN ({})");
}

Status ErasureStore::rewriteNames(std::string_view gone) {
  // SQLite moves rows within a page and leaves their bytes behind. Deleting all rows clears the pages
  // (secure_delete); the remaining names are then written to clean pages.
  struct Row {
    std::int64_t person = 0;
    std::string name, folded, full_name;
    bool typed = false;
  };
  if (connection_.sqlite() == nullptr)
    return connection_.script(fmt::format("DELETE FROM needlelab.names WHERE person IN ({})", gone));
  RETURN_IF_ERROR(connection_.script(fmt::format("DELETE FROM names WHERE person IN ({})", gone)));
  ASSIGN_OR_RETURN(
      const auto rows,
      connection_.prepare("SELECT person, name, folded, full_name, typed FROM names ORDER BY person")
          .all([](const Statement& row) {
            return Row{row.integer(0), row.text(1), row.text(2), row.text(3), row.integer(4) != 0};
          }));
  RETURN_IF_ERROR(connection_.script("DELETE FROM names"));
  for (const Row& row : rows)
    RETURN_IF_ERROR(
        connection_.run("INSERT INTO names (person, name, folded, full_name, typed) VALUES (?,?,?,?,?)",
                        row.person, row.name, row.folded, row.full_name, row.typed));
  return {};
}

Result<std::vector<ErasureLine>> ErasureStore::known() {
  ASSIGN_OR_RETURN(const Uuid of, lab());
  return connection_.prepare("SELECT uuid, erased_unix_ns FROM erasures ORDER BY erased_unix_ns")
      .all([&](const Statement& row) {
        return ErasureLine{of, uuidAt(row, 0), row.integer(1)};
      });
}

Result<std::optional<std::string>> ErasureStore::refNotErased(const Uuid& person) {
  return connection_
      .query("SELECT ref FROM people WHERE uuid = ? AND erased_unix_ns IS NULL", ByteView(person))
      .first(firstText);
}

Result<bool> ErasureStore::isAnyBack(const std::vector<ErasureLine>& lines) {
  ASSIGN_OR_RETURN(const Uuid of, lab());
  for (const ErasureLine& line : lines) {
    if (line.lab != of) continue;
    ASSIGN_OR_RETURN(const auto ref, refNotErased(line.person));
    if (ref) return true;
  }
  return false;
}

Result<std::size_t> ErasureStore::repeat(const std::vector<ErasureLine>& lines, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const Uuid of, lab());
  std::size_t erased = 0;
  for (const ErasureLine& line : lines) {
    if (line.lab != of) continue;
    ASSIGN_OR_RETURN(const auto ref, refNotErased(line.person));
    if (ref) {
      const auto done =
          erase(*ref, {std::string(kServerName), "from the list beside the database", now_unix_ns});
      // the last administrator stays until there is another one; a later start will erase them
      if (!done && done.error().code == ErrorCode::kDenied) continue;
      RETURN_IF_ERROR(done);
      ++erased;
    }
    // for people added after the backup: a station may still deliver sessions of theirs
    RETURN_IF_ERROR(connection_.run(
        "INSERT INTO erasures (uuid, erased_unix_ns, by_whom, reason) VALUES (?,?,?,?)"
        " ON CONFLICT (uuid) DO NOTHING",
        ByteView(line.person), line.unix_ns, kServerName, "from the list beside the database"));
  }
  return erased;
}

namespace {

constexpr std::size_t kMostBytes = 16 << 20;

Result<ErasureLine> lineOf(const std::string& text) {
  std::istringstream cells(text);
  std::string lab, person, rest;
  ErasureLine line;
  cells >> lab >> person >> line.unix_ns;
  if (!cells || cells >> rest) return Error{ErrorCode::kCorrupt, "is not two UUIDs and a time"};
  ASSIGN_OR_RETURN(line.lab, parseUuid(lab));
  ASSIGN_OR_RETURN(line.person, parseUuid(person));
  return line;
}

}  // namespace

Result<std::vector<ErasureLine>> readErasures(const std::filesystem::path& folder, const char* file) {
  std::vector<ErasureLine> lines;
  const auto path = folder / file;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return lines;
  ASSIGN_OR_RETURN(const auto text, readWholeFile(path, kMostBytes));
  std::istringstream in(text);
  for (std::string row; std::getline(in, row);) {
    auto line = lineOf(row);
    if (!line)
      return Error{ErrorCode::kCorrupt,
                   fmt::format("{}: line {}: {}; the file says whom a restored backup must not bring back: "
                               "put back the copy that lies beside the backups ({})",
                               path.string(), lines.size() + 1, line.error().message, kErasuresCopy)};
    lines.push_back(*line);
  }
  return lines;
}

Status addErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                   const char* file) {
  ASSIGN_OR_RETURN(auto all, readErasures(folder, file));
  const auto before = all.size();
  for (const ErasureLine& line : lines)
    if (std::none_of(all.begin(), all.end(), [&](const ErasureLine& known) {
          return known.lab == line.lab && known.person == line.person;
        }))
      all.push_back(line);
  return all.size() == before ? Status() : writeErasures(folder, all, file);
}

Status writeErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                     const char* file) {
  std::string text;
  for (const ErasureLine& line : lines)
    text += fmt::format("{} {} {}\n", uuidText(line.lab), uuidText(line.person), line.unix_ns);
  return writeFileAtomically(folder / file, viewOf(text), 0600);
}

}  // namespace needlelab
