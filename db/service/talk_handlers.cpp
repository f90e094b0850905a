// What an instructor says to a station: whether it may be said, and a line in the audit log before it goes
// out. The running server delivers it (server/live/request_effects.h).
#include <string>

#include "common/base/text.h"
#include "common/profile/aid_list.h"
#include "db/credentials.h"
#include "db/documents.h"
#include "db/service/handlers.h"

namespace needlelab::handlers {
namespace {

Status stationExists(const Context& context, const std::string& name) {
  const auto station = StationStore(context.reader).find(name);
  if (!station) return station.error();
  if (!*station) return Error{ErrorCode::kNotFound, "there is no station named '" + printable(name) + "'"};
  return {};
}

/// The lesson that is meant, where the asker names one.
Status checkMeant(const std::string& session_id) {
  if (session_id.empty()) return {};
  const auto id = sessionId(session_id);
  return id ? Status() : Status(id.error());
}

/// Before it goes out: a station may have read what the server did not live to note.
Result<pb::Reply> noted(const Context& context, const std::string& station, const std::string& detail) {
  const auto status = write(context, station, detail, [](Connection&) { return Status(); });
  if (!status) return status.error();
  return doneReply();
}

std::string meantText(const std::string& session_id) {
  if (session_id.empty()) return {};
  return " (session " + uuidText(*sessionId(session_id)) + ")";
}

}  // namespace

Result<pb::Reply> traineeMessage(const Context& context, const pb::TraineeMessage& call) {
  if (auto valid = checkNote("text", call.text(), 1, kMaxNoteBytes); !valid) return valid.error();
  if (auto known = stationExists(context, call.station()); !known) return known.error();
  return noted(context, call.station(), call.text());
}

Result<pb::Reply> nextExercise(const Context& context, const pb::NextExercise& call) {
  if (auto known = stationExists(context, call.station()); !known) return known.error();
  const auto exercise = CurriculumStore(context.reader).exercise(call.exercise_id());
  if (!exercise) return exercise.error();
  return noted(context, call.station(), call.exercise_id());
}

Result<pb::Reply> setAids(const Context& context, const pb::SetAids& call) {
  if (call.reset() && call.aids_size() > 0)
    return Error{ErrorCode::kInvalidInput,
                 "set_aids: reset goes back to the exercise's aids, give no others"};
  if (auto valid = checkAids("aids", call.aids()); !valid) return valid.error();
  if (auto meant = checkMeant(call.session_id()); !meant) return meant.error();
  if (auto known = stationExists(context, call.station()); !known) return known.error();
  const std::string what = call.reset() ? "as the exercise says" : aidsText(call.aids());
  return noted(context, call.station(), what + meantText(call.session_id()));
}

Result<pb::Reply> stopLesson(const Context& context, const pb::StopLesson& call) {
  if (auto valid = checkNote("reason", call.reason(), 0, kMaxNoteBytes); !valid) return valid.error();
  if (auto meant = checkMeant(call.session_id()); !meant) return meant.error();
  if (auto known = stationExists(context, call.station()); !known) return known.error();
  return noted(context, call.station(), call.reason() + meantText(call.session_id()));
}

}  // namespace needlelab::handlers
