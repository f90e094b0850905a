#include "db/sessions/unknown_trainees.h"

#include <algorithm>

#include "common/base/text/text.h"
#include "db/people/people.h"
#include "db/people/person_name.h"
#include "db/people/person_refs.h"
#include "db/store/schema.h"
#include "db/teaching/assignments.h"
#include "db/teaching/attempts.h"
#include "db/teaching/documents.h"

namespace needlelab {
namespace {

/// The form in which it is stored: with a leading "@" it would be taken for an id.
std::string_view typedText(std::string_view name) {
  name = trimmedName(name);
  name.remove_prefix(std::min(name.find_first_not_of('@'), name.size()));
  return name.empty() ? "unknown" : name;
}

}  // namespace

Result<SessionTrainee> UnknownTraineeStore::traineeOf(const pb::SessionDescription& description,
                                                      std::int64_t now_unix_ns) {
  const std::string& given = description.trainee();
  if (given.empty() || given == kGuestName) return SessionTrainee{given};
  if (given.starts_with('@') && parseUuid(given.substr(1)).ok())
    return traineeOfUuid(description, now_unix_ns);
  ASSIGN_OR_RETURN(const bool was_erased,
                   wasErased(connection_, given, description.started_unix_ns(), now_unix_ns));
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).findNamed(given));
  if (!person || was_erased) {
    SessionTrainee trainee{{}, false, true};
    ASSIGN_OR_RETURN(trainee.ref, typedName(given, now_unix_ns));
    return trainee;
  }
  return ofAccount(*person, description);
}

Result<SessionTrainee> UnknownTraineeStore::ofAccount(const Person& person,
                                                      const pb::SessionDescription& description) {
  ASSIGN_OR_RETURN(const bool required, LabSettingsStore(connection_).codesRequired());
  const bool unchecked = !description.code_checked() && (required || !person.code_hash.empty());
  return SessionTrainee{person.ref, false, unchecked, unchecked};
}

Result<SessionTrainee> UnknownTraineeStore::traineeOfUuid(const pb::SessionDescription& description,
                                                          std::int64_t now_unix_ns) {
  const std::string_view outer_ref = description.trainee();
  ASSIGN_OR_RETURN(const Uuid uuid, parseUuid(outer_ref.substr(1)));
  ASSIGN_OR_RETURN(const bool erased, isErased(connection_, uuid));
  ASSIGN_OR_RETURN(auto ref, findPerson(connection_, outer_ref));
  if (!ref) {
    // a restored backup does not know people added after it
    ASSIGN_OR_RETURN(
        ref, addTypedName(connection_, "unknown " + std::string(outer_ref.substr(outer_ref.size() - 12)),
                          now_unix_ns));
    RETURN_IF_ERROR(connection_.run("UPDATE people SET uuid = ?, erased_unix_ns = ? WHERE ref = ?",
                                    ByteView(uuid), erased ? std::optional(now_unix_ns) : std::nullopt,
                                    *ref));
    if (erased)
      RETURN_IF_ERROR(
          connection_.run("DELETE FROM names WHERE person = (SELECT id FROM people WHERE ref = ?)", *ref));
    return SessionTrainee{*ref, erased, !erased};
  }
  if (erased) {
    ASSIGN_OR_RETURN(const bool stays, LabSettingsStore(connection_).keepsRecordingsOfErased());
    return SessionTrainee{*ref, !stays};
  }
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(*ref));
  if (!person) return SessionTrainee{*ref, false, true};
  return ofAccount(*person, description);
}

Result<std::string> UnknownTraineeStore::typedName(std::string_view name, std::int64_t now_unix_ns) {
  const std::string_view typed = typedText(name);
  ASSIGN_OR_RETURN(const auto known,
                   connection_.query("SELECT ref FROM called WHERE folded = ? AND typed = 1", nameKey(typed))
                       .first(firstText));
  if (known) return *known;
  return addTypedName(connection_, typed, now_unix_ns);
}

Result<bool> UnknownTraineeStore::isBeginUnsure(const pb::SessionDescription& description,
                                                std::int64_t now_unix_ns) {
  constexpr std::int64_t kOff_ns = 300'000'000'000;
  const std::int64_t begun_ns = description.started_unix_ns();
  if (description.begin_clock() == pb::SessionDescription::BEGIN_CLOCK_UNSPECIFIED) return false;
  if (begun_ns > now_unix_ns + kOff_ns) return true;
  if (description.begin_clock() == pb::SessionDescription::OWN_CLOCK_BEHIND) return true;
  if (description.begin_clock() != pb::SessionDescription::OWN_CLOCK_ALONE) return false;
  ASSIGN_OR_RETURN(const auto newest,
                   connection_
                       .query("SELECT started_unix_ns FROM sessions WHERE station = ? AND state <> ?"
                              " AND started_unix_ns <= ? AND NOT EXISTS (SELECT 1 FROM unknown_trainees WHERE"
                              " session = number AND begin_unsure = 1)"
                              " ORDER BY started_unix_ns DESC LIMIT 1",
                              description.station(), static_cast<int>(pb::SESSION_OPEN), now_unix_ns)
                       .first([](const Statement& row) { return row.integer(0); }));
  return newest && begun_ns < *newest - kOff_ns;
}

Result<bool> UnknownTraineeStore::lacksAssignment(std::string_view trainee, std::string_view exercise_id) {
  const auto exercise = CurriculumStore(connection_).exercise(exercise_id);
  if (!exercise && exercise.error().code != ErrorCode::kNotFound) return exercise.error();
  if (!exercise || !exercise->rules.assigned_only) return false;
  ASSIGN_OR_RETURN(const bool assigned,
                   AssignmentStore(connection_).isAssigned(trainee, exercise_id, exercise->curriculum_id));
  return !assigned;
}

Result<bool> UnknownTraineeStore::isOf(std::int64_t number, std::string_view trainee) {
  ASSIGN_OR_RETURN(const auto ref, findPerson(connection_, trainee, Named::kAccountOrTyped));
  ASSIGN_OR_RETURN(
      const auto found,
      connection_
          .query("SELECT s.trainee FROM sessions s LEFT JOIN unknown_trainees u ON u.session ="
                 " s.number LEFT JOIN called c ON c.ref = coalesce(u.given, s.trainee)"
                 " WHERE s.number = ?1 AND (s.trainee IN (?2, ?3) OR u.given = ?3 OR c.folded = ?4)",
                 number, trainee, ref.value_or(std::string(trainee)), nameKey(typedText(trainee)))
          .first(firstText));
  return found.has_value();
}

Status UnknownTraineeStore::flag(const Uuid& session, const SessionTrainee& trainee) {
  return connection_.run(
      "INSERT INTO unknown_trainees (session, given, code_unchecked, begin_unsure, not_assigned)"
      " SELECT number, ?, ?, ?, ? FROM sessions WHERE id = ?",
      trainee.ref, trainee.code_unchecked, trainee.begin_unsure, trainee.not_assigned, ByteView(session));
}

Status UnknownTraineeStore::leaveEmpty(const Uuid& session, std::int64_t now_unix_ns) {
  RETURN_IF_ERROR(
      connection_.run("UPDATE sessions"
                      " SET state = ?, erased = 1, recording = 3, events = 0, hash = zeroblob(32),"
                      " closed_unix_ns = ? WHERE id = ?",
                      static_cast<int>(pb::SESSION_INTERRUPTED), now_unix_ns, ByteView(session)));
  return connection_.run(
      "INSERT INTO removed_originals (session, removed_unix_ns, deleted_unix_ns,"
      " reason, by_whom, leftover, crcs)"
      " SELECT number, ?1, ?1, 'the data of its person was erased before it came',"
      " 'erasure', 0, zeroblob(0) FROM sessions WHERE id = ?2",
      now_unix_ns, ByteView(session));
}

Result<std::string> UnknownTraineeStore::assign(const Uuid& session, const std::string& trainee,
                                                const std::optional<std::string>& was, const std::string& by,
                                                std::int64_t now_unix_ns,
                                                std::optional<std::int64_t> started_unix_ns) {
  struct Row {
    std::int64_t number = 0;
    bool open = false, erased = false, flagged = false, begin_unsure = false;
    std::string trainee, exercise_id;
  };
  ASSIGN_OR_RETURN(const auto row, connection_
                                       .query("SELECT s.number, s.state, s.erased, u.session IS NOT NULL,"
                                              " coalesce(u.begin_unsure, 0), s.trainee, s.exercise_id FROM "
                                              "sessions s LEFT JOIN unknown_trainees u"
                                              " ON u.session = s.number WHERE s.id = ?",
                                              ByteView(session))
                                       .first([](const Statement& found) {
                                         return Row{
                                             found.integer(0),      found.integer(1) == pb::SESSION_OPEN,
                                             found.integer(2) != 0, found.integer(3) != 0,
                                             found.integer(4) != 0, found.text(5),
                                             found.text(6)};
                                       }));
  if (!row) return unknownSession(session);
  const std::string name = "session " + uuidText(session);
  if (row->erased)
    return Error{ErrorCode::kInvalidInput, name + " cannot be assigned: the data of its person was erased"};
  if (!row->flagged)
    return Error{ErrorCode::kInvalidInput,
                 name + " is of '" + row->trainee +
                     "', whom the server knew when it came: only sessions that wait are assigned"};
  ASSIGN_OR_RETURN(const auto shown, shownName(connection_, row->trainee));
  if (was && *was != shown && *was != row->trainee)
    return Error{ErrorCode::kConflict, name + " was given to '" + row->trainee + "' meanwhile, not '" + *was +
                                           "': look at it, and assign it again if that is wrong"};
  if (row->open)
    return Error{ErrorCode::kInvalidInput, name + " is still open: assign it once its station has closed it"};
  if (trainee != kGuestName) {
    ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(trainee));
    if (!person)
      return Error{ErrorCode::kNotFound,
                   "there is no person named '" + trainee + "': add the person first, or give another name"};
  }
  if (started_unix_ns) {
    if (!row->begin_unsure)
      return Error{ErrorCode::kInvalidInput,
                   name + " began when its station says: nothing there needs to be corrected"};
    if (*started_unix_ns <= 0 || *started_unix_ns > now_unix_ns)
      return Error{ErrorCode::kInvalidInput, "started_unix_ns: must be a time that has passed"};
    RETURN_IF_ERROR(connection_.run("UPDATE sessions SET started_unix_ns = ? WHERE number = ?",
                                    *started_unix_ns, row->number));
  }
  RETURN_IF_ERROR(connection_.run("UPDATE sessions SET trainee = ? WHERE number = ?", trainee, row->number));
  RETURN_IF_ERROR(
      connection_.run("UPDATE unknown_trainees SET by_whom = ?, assigned_unix_ns = ? WHERE session = ?", by,
                      now_unix_ns, row->number));
  for (const std::string& one : {row->trainee, trainee})
    if (isPersonRef(one)) RETURN_IF_ERROR(AttemptStore(connection_).countExam(row->exercise_id, one));
  return row->trainee;
}

}  // namespace needlelab
