#include "db/unknown_trainees.h"

#include <optional>

#include "common/base/text.h"
#include "db/erasure.h"
#include "db/lab_settings.h"
#include "db/people.h"
#include "db/session_rows.h"
#include "needlelab/types.pb.h"

namespace needlelab {

Status UnknownTraineeStore::flag(const Uuid& session, bool code_checked, bool may_be_erased) {
  ASSIGN_OR_RETURN(const bool required, LabSettingsStore(connection_).codesRequired());
  return connection_.run(
      "INSERT INTO unknown_trainees (session, given, code_unchecked)"
      " SELECT s.number, s.trainee, CASE WHEN p.name IS NULL THEN 0 ELSE 1 END"
      " FROM sessions s LEFT JOIN people p ON p.name = s.trainee"
      " WHERE s.id = ?1 AND s.trainee NOT IN ('', ?2)"
      " AND (p.name IS NULL OR ?5 = 1 OR (?3 = 0 AND (?4 = 1 OR p.code_hash IS NOT NULL)))",
      ByteView(session), kGuestName, code_checked, required, may_be_erased);
}

Result<std::string> UnknownTraineeStore::assign(const Uuid& session, const std::string& trainee,
                                                const std::optional<std::string>& was, const std::string& by,
                                                std::int64_t now_unix_ns) {
  struct Row {
    std::int64_t number = 0, began_unix_ns = 0;
    bool open = false, erased = false, flagged = false;
    std::string trainee, given, description;
  };
  ASSIGN_OR_RETURN(const auto row,
                   connection_
                       .query("SELECT s.number, s.state, s.erased, u.session IS NOT NULL, s.trainee,"
                              " s.description, min(s.started_unix_ns, s.received_unix_ns), coalesce(u.given, "
                              "'') FROM sessions s LEFT "
                              "JOIN unknown_trainees u"
                              " ON u.session = s.number WHERE s.id = ?",
                              ByteView(session))
                       .first([](const Statement& found) {
                         return Row{found.integer(0),
                                    found.integer(6),
                                    found.integer(1) == pb::SESSION_OPEN,
                                    found.integer(2) != 0,
                                    found.integer(3) != 0,
                                    found.text(4),
                                    found.text(7),
                                    std::string(textOf(found.bytes(5)))};
                       }));
  if (!row) return unknownSession(session);
  const std::string name = "session " + uuidText(session);
  if (row->erased)
    return Error{ErrorCode::kInvalidInput, name + " cannot be assigned: the data of its person was erased"};
  if (!row->flagged)
    return Error{ErrorCode::kInvalidInput,
                 name + " is of '" + row->trainee +
                     "', whom the server knew when it came: only sessions that wait are assigned"};
  if (was && *was != row->trainee)
    return Error{ErrorCode::kConflict, name + " was given to '" + row->trainee + "' meanwhile, not '" + *was +
                                           "': look at it, and assign it again if that is wrong"};
  if (row->open)
    return Error{ErrorCode::kInvalidInput, name + " is still open: assign it once its station has closed it"};
  if (trainee != kGuestName) {
    ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(trainee));
    if (!person)
      return Error{ErrorCode::kNotFound,
                   "there is no person named '" + trainee + "': add the person first, or give another name"};
    // the person who had that name then was erased; whoever has the name now came later. While the clock is
    // behind the account (ErasureStore::addedAt), times do not tell that
    ASSIGN_OR_RETURN(const auto erased, ErasureStore(connection_).erasedSince(trainee, row->began_unix_ns));
    if (erased && person->created_unix_ns <= now_unix_ns)
      return Error{ErrorCode::kInvalidInput,
                   name + " began before a person named '" + trainee +
                       "' was erased, and cannot be another's of that name: give it to '" +
                       std::string(kGuestName) + "', or erase '" + row->given + "'"};
  }
  pb::SessionDescription description;
  if (!description.ParseFromString(row->description))
    return Error{ErrorCode::kCorrupt, "the stored description of " + name + " cannot be read"};
  description.set_trainee(trainee);
  RETURN_IF_ERROR(connection_.run("UPDATE sessions SET trainee = ?, description = ? WHERE number = ?",
                                  trainee, viewOf(description.SerializeAsString()), row->number));
  // an erasure left the name of its person with a session that waited, and with no other
  ASSIGN_OR_RETURN(const auto pseudonym,
                   ErasureStore(connection_).erasedSince(row->given, row->began_unix_ns));
  RETURN_IF_ERROR(connection_.run(
      "UPDATE unknown_trainees SET given = ?, by_whom = ?, assigned_unix_ns = ? WHERE session = ?",
      pseudonym.value_or(row->given), by, now_unix_ns, row->number));
  return row->trainee;
}

}  // namespace needlelab
