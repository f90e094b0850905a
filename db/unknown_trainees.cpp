#include "db/unknown_trainees.h"

#include <optional>

#include "common/base/text.h"
#include "db/people.h"
#include "db/session_rows.h"
#include "needlelab/types.pb.h"

namespace needlelab {

Status UnknownTraineeStore::flag(const Uuid& session) {
  return connection_.run(
      "INSERT INTO unknown_trainees (session, given) SELECT number, trainee FROM sessions WHERE id = ?"
      " AND trainee NOT IN ('', ?) AND NOT EXISTS (SELECT 1 FROM people WHERE name = trainee)",
      ByteView(session), kGuestName);
}

Status UnknownTraineeStore::assign(const Uuid& session, const std::string& trainee, const std::string& by,
                                   std::int64_t now_unix_ns) {
  struct Row {
    std::int64_t number = 0;
    bool open = false, erased = false, flagged = false;
    std::string trainee, description;
  };
  ASSIGN_OR_RETURN(const auto row,
                   connection_
                       .query("SELECT s.number, s.state, s.erased, u.session IS NOT NULL, s.trainee,"
                              " s.description FROM sessions s LEFT JOIN unknown_trainees u"
                              " ON u.session = s.number WHERE s.id = ?",
                              ByteView(session))
                       .first([](const Statement& found) {
                         return Row{found.integer(0),      found.integer(1) == pb::SESSION_OPEN,
                                    found.integer(2) != 0, found.integer(3) != 0,
                                    found.text(4),         std::string(textOf(found.bytes(5)))};
                       }));
  if (!row) return unknownSession(session);
  const std::string name = "session " + uuidText(session);
  if (row->erased)
    return Error{ErrorCode::kInvalidInput, name + " cannot be assigned: the data of its person was erased"};
  if (!row->flagged)
    return Error{ErrorCode::kInvalidInput,
                 name + " is of '" + row->trainee +
                     "', whom the server knew when it came: only sessions of unknown trainees are assigned"};
  if (row->open)
    return Error{ErrorCode::kInvalidInput, name + " is still open: assign it once its station has closed it"};
  if (trainee != kGuestName) {
    ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(trainee));
    if (!person)
      return Error{ErrorCode::kNotFound,
                   "there is no person named '" + trainee + "': add the person first, or give another name"};
  }
  pb::SessionDescription description;
  if (!description.ParseFromString(row->description))
    return Error{ErrorCode::kCorrupt, "the stored description of " + name + " cannot be read"};
  description.set_trainee(trainee);
  RETURN_IF_ERROR(connection_.run("UPDATE sessions SET trainee = ?, description = ? WHERE number = ?",
                                  trainee, viewOf(description.SerializeAsString()), row->number));
  return connection_.run("UPDATE unknown_trainees SET by_whom = ?, assigned_unix_ns = ? WHERE session = ?",
                         by, now_unix_ns, row->number);
}

}  // namespace needlelab
