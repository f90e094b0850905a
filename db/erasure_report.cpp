// What an erasure leaves, for the administrator: texts that have the name and stay, sessions under names that
// are alike, and what a plain search finds. On any connection: it only reads.
#include <fmt/core.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/text.h"
#include "db/erasure.h"
#include "db/session_rows.h"
#include "db/session_words.h"
#include "db/text_pages.h"
#include "db/unknown_trainees.h"

namespace needlelab {
namespace {

/// As many rows as one kind of place names.
constexpr std::size_t kMostNamedRows = 3;

/// What a station wrote with a session.
struct SessionRowOfText {
  std::int64_t id = 0;  ///< the number
  std::string session, description, profile, columns;
  bool erased = false;
  [[nodiscard]] std::size_t bytes() const { return description.size() + profile.size() + columns.size(); }
};
// the columns have what the description has, but where damage made them differ
constexpr std::string_view kSessionRows =
    "SELECT number, id, description, profile_json,"
    " exercise_id || '\n' || profile_id || '\n' || engine_version, erased"
    " FROM sessions WHERE number > ?1 AND number <= ?2 ORDER BY number";
SessionRowOfText sessionRowOf(const Statement& row) {
  return {row.integer(0), row.text(1), row.text(2), row.text(3), row.text(4), row.integer(5) != 0};
}

struct NumberedText {
  std::int64_t id = 0;
  std::string text, which;
  [[nodiscard]] std::size_t bytes() const { return text.size() + which.size(); }
};
NumberedText numberedTextOf(const Statement& row) {
  return {row.integer(0), row.text(1), row.text(2)};
}

/// The names that are replaced as whole words: given names, too, but no parts of full names.
ErasedNames wholeNames(ErasedNames names) {
  names.full_names.insert(names.full_names.end(), names.given.begin(), names.given.end());
  return names;
}

bool hasName(const std::string& words, const ErasedNames& whole) {
  return withoutNames(words, whole, false) != words;
}

}  // namespace

void ErasureStore::Counted::add(const std::string& which) {
  if (++count <= kMostNamedRows) some += (some.empty() ? "" : ", ") + which;
}

Result<std::string> ErasureStore::reportOf(const ErasedRows& done) {
  ASSIGN_OR_RETURN(const auto alike, sessionsAlike(done.names));
  ASSIGN_OR_RETURN(const auto search, plainSearch(done.names));
  ASSIGN_OR_RETURN(const auto sessions, sessionsWithName(done.names, search));
  ASSIGN_OR_RETURN(const auto left, leftOver(done.names, done.group_ids, sessions));
  ASSIGN_OR_RETURN(const auto perhaps, perhapsLeft(search, sessions));
  ASSIGN_OR_RETURN(const auto doers, doersAlike(search, done.names.name));
  std::string authors;
  if (done.typed) {
    ASSIGN_OR_RETURN(authors, doneUnder(done.names.name));
  }
  return alike + done.replaced.text() + left + perhaps + doers + authors;
}

Result<NameSearch> ErasureStore::plainSearch(ErasedNames names) {
  // only accounts are surely others: a station or a trainee whom nobody knows may be called after this person
  ASSIGN_OR_RETURN(
      const auto accounts,
      connection_.prepare("SELECT name FROM people UNION SELECT full_name FROM people").all(firstText));
  const std::set<std::string> of_others(accounts.begin(), accounts.end());
  std::vector<std::string> others = names.others.list();
  std::erase_if(others, [&](const std::string& other) { return !of_others.contains(other); });
  names.others = OtherNames(std::move(others));
  return NameSearch(names);
}

Result<ErasureStore::SessionsWithName> ErasureStore::sessionsWithName(const ErasedNames& names,
                                                                      const NameSearch& search) {
  // not replaced in sessions of others: a person may be called as a device is, and the station sends its
  // words and its profile again
  const ErasedNames whole = wholeNames(names);
  SessionsWithName found;
  std::map<std::size_t, bool> profiles;  // by the hash of their text: many sessions share one
  RETURN_IF_ERROR(eachRow(
      connection_, kSessionRows, -1, INT64_MAX, sessionRowOf, [&](const SessionRowOfText& session) -> Status {
        std::string words = session.columns + "\n";
        pb::SessionDescription description;
        // what cannot be read, `check` says
        words += description.ParseFromString(session.description) ? wordsOf(std::move(description))
                                                                  : session.description;
        const auto [profile, is_new] = profiles.try_emplace(std::hash<std::string>()(session.profile), false);
        if (is_new) profile->second = hasName(session.profile, whole);
        if (!session.erased && (profile->second || hasName(words, whole)))
          found.of_others.add(sessionText(session.session));
        else if (search.finds(words))
          found.perhaps.add(sessionText(session.session));
        return {};
      }));
  return found;
}

Result<std::string> ErasureStore::leftOver(const ErasedNames& names,
                                           const std::vector<std::string>& group_ids,
                                           const SessionsWithName& sessions) {
  std::string text;
  for (const std::string& id : group_ids)
    text += (text.empty() ? "" : "; ") + ("the id of the group '" + id + "' (make the group anew)");
  const ErasedNames whole = wholeNames(names);
  std::set<std::string> named;
  struct Document {
    std::string id;
    std::int64_t revision = 0;
  };
  // one text at a time
  for (const auto& [kind, table] : {std::pair("profile", "profiles"), std::pair("course", "curricula")}) {
    ASSIGN_OR_RETURN(
        const auto documents,
        connection_.prepare(fmt::format("SELECT id, revision FROM {}", table)).all([](const Statement& row) {
          return Document{row.text(0), row.integer(1)};
        }));
    for (const Document& document : documents) {
      const std::string which = fmt::format("{} '{}'", kind, document.id);
      if (named.contains(which)) continue;
      ASSIGN_OR_RETURN(const auto json,
                       connection_
                           .query(fmt::format("SELECT json FROM {} WHERE id = ? AND revision = ?", table),
                                  document.id, document.revision)
                           .first(firstText));
      if (json && hasName(*json, whole)) named.insert(which);
    }
  }
  for (const std::string& which : named)
    text += (text.empty() ? "" : "; ") + ("revisions of the " + which + " (nobody can remove them)");
  if (sessions.of_others.count > 0)
    text += fmt::format(
        "{}what stations wrote about device, patient and exercise in {} sessions of others, such as {}",
        text.empty() ? "" : "; ", sessions.of_others.count, sessions.of_others.some);
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

Result<std::string> ErasureStore::perhapsLeft(const NameSearch& search, const SessionsWithName& sessions) {
  struct Place {
    std::string_view what, sql;  // rows: what tells the text from others, and the text
    bool in_pages = false;  // the table may have GB: number, text, and what to say of rows above ?1, up to ?2
    bool of_sessions = false;  // that is a session's id
  };
  constexpr Place kTexts[] = {
      {"{} remarks, such as number {}",
       "SELECT id, text || '\n' || author, id FROM annotations WHERE id > ?1 AND id <= ?2 ORDER BY id", true},
      {"the names of {} groups, such as {}", "SELECT id, name FROM groups ORDER BY id"},
      {"{} lines of the audit log, such as {}",
       "SELECT id, who || '\n' || subject || '\n' || detail, id"
       " FROM audit WHERE id > ?1 AND id <= ?2 ORDER BY id",
       true},
      {"the reasons of {} erasures, such as {}", "SELECT pseudonym, reason FROM erasures ORDER BY pseudonym"},
      {"the notes of {} consents, such as that of {}", "SELECT person, note FROM consents ORDER BY id"},
      {"{} names that stations gave for sessions of others, such as {}",
       "SELECT given, given FROM unknown_trainees WHERE by_whom IS NOT NULL GROUP BY given ORDER BY given"},
      {"the names of {} stations, such as {}", "SELECT name, name FROM stations ORDER BY name"},
      {"the ids of {} profiles, courses and exercises, such as {}",
       "SELECT id, id FROM profiles UNION SELECT id, id FROM curricula UNION SELECT id, id FROM exercises"
       " UNION SELECT exercise_id, exercise_id FROM retention_policies"
       " UNION SELECT exercise_id, exercise_id FROM exercise_references"
       " UNION SELECT exercise_id, exercise_id FROM assignments"
       " UNION SELECT course_id, course_id FROM assignments ORDER BY 1"},
      {"the reasons of {} removed recordings, such as that of session {}",
       "SELECT r.session, r.reason, s.id FROM removed_originals r JOIN sessions s ON s.number = r.session"
       " WHERE r.session > ?1 AND r.session <= ?2 ORDER BY r.session",
       true, true},
      {"{} facts about this database (meta), such as {}", "SELECT key, value FROM meta ORDER BY key"},
  };
  std::string text;
  const auto name = [&](std::string_view what, const Counted& found) {
    if (found.count > 0)
      text += (text.empty() ? "" : "; ") + fmt::format(fmt::runtime(what), found.count, found.some);
  };
  for (const Place& place : kTexts) {
    Counted found;
    if (place.in_pages) {
      RETURN_IF_ERROR(eachRow(connection_, place.sql, -1, INT64_MAX, numberedTextOf,
                              [&](const NumberedText& row) -> Status {
                                if (search.finds(row.text))
                                  found.add(place.of_sessions ? sessionText(row.which) : row.which);
                                return {};
                              }));
    } else {
      auto rows = connection_.prepare(place.sql);
      for (;;) {
        ASSIGN_OR_RETURN(const bool more, rows.step());
        if (!more) break;
        if (search.finds(rows.text(1))) found.add(rows.text(0));
      }
    }
    name(place.what, found);
  }
  name("what stations wrote with {} sessions, such as {}", sessions.perhaps);
  if (text.empty()) return text;
  return "These have the letters of a name of this person, as a part of another word, as a word of the full "
         "name or as a name that a station gave, and stay as they are; look whom they mean: " +
         text + ". ";
}

}  // namespace needlelab
