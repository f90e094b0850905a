// What an erasure leaves, for the administrator: texts that have the name and stay, sessions under names that
// are alike, and what a plain search finds. On any connection: it only reads.
#include <fmt/core.h>

#include <algorithm>
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
#include "db/text_pages.h"
#include "db/unknown_trainees.h"

namespace needlelab {
namespace {

/// What a station wrote with a session.
struct SessionRowOfText {
  std::int64_t id = 0;  ///< the number
  std::string session, description, profile;
  [[nodiscard]] std::size_t bytes() const { return description.size() + profile.size(); }
};
SessionRowOfText sessionRowOf(const Statement& row) {
  return {row.integer(0), row.text(1), row.text(2), row.text(3)};
}

struct NumberedText {
  std::int64_t id = 0;
  std::string text;
  [[nodiscard]] std::size_t bytes() const { return text.size(); }
};
NumberedText numberedTextOf(const Statement& row) {
  return {row.integer(0), row.text(1)};
}

}  // namespace

Result<std::string> ErasureStore::reportOf(const ErasedRows& done) {
  ASSIGN_OR_RETURN(const auto alike, sessionsAlike(done.names));
  ASSIGN_OR_RETURN(const auto left, leftOver(done.names, done.group_ids));
  ASSIGN_OR_RETURN(const auto perhaps, perhapsLeft(done.names));
  std::string authors;
  if (done.typed) {
    ASSIGN_OR_RETURN(authors, doneUnder(done.names.name));
  }
  return alike + done.replaced.text() + left + perhaps + authors;
}

Result<std::string> ErasureStore::leftOver(const ErasedNames& names,
                                           const std::vector<std::string>& group_ids) {
  std::string text;
  for (const std::string& id : group_ids)
    text += (text.empty() ? "" : "; ") + ("the id of the group '" + id + "' (make the group anew)");
  ErasedNames whole = names;  // given names, too, but no parts of full names
  whole.full_names.insert(whole.full_names.end(), names.given.begin(), names.given.end());
  const auto hasName = [&](const std::string& words) { return withoutNames(words, whole, false) != words; };
  std::set<std::string> named;
  auto documents = connection_.prepare(
      "SELECT 'profile', id, json FROM profiles UNION ALL SELECT 'course', id, json FROM curricula");
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, documents.step());
    if (!more) break;
    if (hasName(documents.text(2))) named.insert(documents.text(0) + " '" + documents.text(1) + "'");
  }
  for (const std::string& which : named)
    text += (text.empty() ? "" : "; ") + ("revisions of the " + which + " (nobody can remove them)");
  // not replaced: a person may be called as a device is, and the station sends its words and its profile
  // again
  constexpr std::size_t kNamed = 3;
  std::size_t found = 0;
  std::string ids;
  std::map<std::size_t, bool> profiles;  // by the hash of their text: many sessions share one
  const auto look = [&](const SessionRowOfText& session) -> Status {
    pb::SessionDescription description;
    if (!description.ParseFromString(session.description)) return {};  // `check` says it
    const auto [known, is_new] = profiles.try_emplace(std::hash<std::string>()(session.profile), false);
    if (is_new) known->second = hasName(session.profile);
    const auto& notes = description.device_notes();
    if (!known->second && !hasName(description.device()) && !hasName(description.axial_model()) &&
        std::none_of(notes.begin(), notes.end(), hasName))
      return {};
    if (++found <= kNamed) ids += (ids.empty() ? "" : ", ") + sessionText(session.session);
    return {};
  };
  RETURN_IF_ERROR(eachRow(connection_,
                          "SELECT number, id, description, profile_json FROM sessions"
                          " WHERE number > ?1 AND number <= ?2 AND erased = 0 ORDER BY number",
                          -1, INT64_MAX, sessionRowOf, look));
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
    bool in_pages = false;       // the table may have GB: rows by number, above ?1 and up to ?2
  };
  constexpr Place kTexts[] = {
      {"{} remarks, such as number {}",
       "SELECT id, text FROM annotations WHERE id > ?1 AND id <= ?2 ORDER BY id", true},
      {"the names of {} groups, such as {}", "SELECT id, name FROM groups ORDER BY id"},
      {"{} lines of the audit log, such as {}",
       "SELECT id, who || char(10) || subject || char(10) || detail || char(10) || coalesce(imported_by, '')"
       " || char(10) || coalesce(imported_from, '') FROM audit WHERE id > ?1 AND id <= ?2 ORDER BY id",
       true},
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
    const auto look = [&](const std::string& which, const std::string& words) {
      if (search.finds(words) && ++found <= kNamed) some += (some.empty() ? "" : ", ") + which;
    };
    if (place.in_pages) {
      RETURN_IF_ERROR(eachRow(connection_, place.sql, -1, INT64_MAX, numberedTextOf,
                              [&](const NumberedText& row) -> Status {
                                look(std::to_string(row.id), row.text);
                                return {};
                              }));
    } else {
      auto rows = connection_.prepare(place.sql);
      for (;;) {
        ASSIGN_OR_RETURN(const bool more, rows.step());
        if (!more) break;
        look(rows.text(0), rows.text(1));
      }
    }
    if (found > 0) text += (text.empty() ? "" : "; ") + fmt::format(fmt::runtime(place.what), found, some);
  }
  if (text.empty()) return text;
  return "These have the letters of a name of this person, as a part of another word, as a word of the full "
         "name or as a name that a station gave, and stay as they are; look whom they mean: " +
         text + ". ";
}

}  // namespace needlelab
