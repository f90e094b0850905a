// Stations, and an instructor's messages to a station, which are checked and logged here before they are
// sent. The running server delivers them (server/live/port/request_effects.h).
#include <string>

#include "common/base/bytes.h"
#include "common/base/text/text.h"
#include "common/profile/aid_list.h"
#include "db/login/credentials.h"
#include "db/people/look_alikes.h"
#include "db/service/requests/handlers.h"

namespace needlelab::handlers {
namespace {

Status stationExists(const Context& context, const std::string& name) {
  return requireThing(context.reader, Thing::kStation, name);
}

/// Checks the requested lesson's session id, if there is one.
Status checkMeant(const std::string& session_id) {
  if (session_id.empty()) return {};
  const auto id = sessionId(session_id);
  return id ? Status() : Status(id.error());
}

/// Logs the message before it is sent: a station may have read a message just before a server crash.
Result<pb::Reply> noted(const Context& context, const std::string& station, const std::string& detail) {
  RETURN_IF_ERROR(write(context, station, detail, [](Connection&) { return Status(); }));
  return doneReply();
}

std::string meantText(const std::string& session_id) {
  if (session_id.empty()) return {};
  return " (session " + uuidText(*sessionId(session_id)) + ")";
}

}  // namespace

Result<pb::Reply> traineeMessage(const Context& context, const pb::TraineeMessage& call) {
  RETURN_IF_ERROR(checkNote("text", call.text(), 1, kMaxNoteBytes));
  RETURN_IF_ERROR(stationExists(context, call.station()));
  return noted(context, call.station(), call.text());
}

Result<pb::Reply> nextExercise(const Context& context, const pb::NextExercise& call) {
  RETURN_IF_ERROR(stationExists(context, call.station()));
  RETURN_IF_ERROR(requireThing(context.reader, Thing::kExercise, call.exercise_id()));
  return noted(context, call.station(), call.exercise_id());
}

namespace {

/// kDenied if the given lesson (empty: the station's current one) is an exam.
Status noExam(const Context& context, const std::string& station, const std::string& session_id) {
  const auto nameOf = [](const Statement& row) { return row.text(0); };
  const std::string_view exam =
      "SELECT e.name FROM sessions s JOIN exercises e ON e.id = s.exercise_id AND e.exam_attempts IS NOT NULL"
      " WHERE ";
  ASSIGN_OR_RETURN(
      const auto name,
      session_id.empty()
          ? context.reader
                .query(std::string(exam) +
                           "s.number = (SELECT number FROM sessions WHERE station = ? AND state = ?"
                           " ORDER BY started_unix_ns DESC, number DESC LIMIT 1)",
                       station, static_cast<int>(pb::SESSION_OPEN))
                .first(nameOf)
          : context.reader.query(std::string(exam) + "s.id = ?", viewOf(session_id)).first(nameOf));
  if (!name) return {};
  return Error{ErrorCode::kDenied, "\"" + *name + "\" is an exam: its aids cannot be changed"};
}

}  // namespace

Result<pb::Reply> setAids(const Context& context, const pb::SetAids& call) {
  if (call.reset() && call.aids_size() > 0)
    return Error{ErrorCode::kInvalidInput,
                 "set_aids: reset goes back to the exercise's aids, give no others"};
  RETURN_IF_ERROR(checkAids("aids", call.aids()));
  RETURN_IF_ERROR(checkMeant(call.session_id()));
  RETURN_IF_ERROR(stationExists(context, call.station()));
  RETURN_IF_ERROR(noExam(context, call.station(), call.session_id()));
  const std::string what = call.reset() ? "as the exercise says" : aidsText(call.aids());
  return noted(context, call.station(), what + meantText(call.session_id()));
}

Result<pb::Reply> stopLesson(const Context& context, const pb::StopLesson& call) {
  RETURN_IF_ERROR(checkNote("reason", call.reason(), 0, kMaxNoteBytes));
  RETURN_IF_ERROR(checkMeant(call.session_id()));
  RETURN_IF_ERROR(stationExists(context, call.station()));
  return noted(context, call.station(), call.reason() + meantText(call.session_id()));
}

Result<pb::Reply> addStation(const Context& context, const pb::AddStation& call) {
  const StationKeyBytes key = makeStationKey();
  RETURN_IF_ERROR(write(context, call.name(), "", [&](Connection& writer) {
    return StationStore(writer).add(call.name(), hashStationKey(key), context.now_unix_ns);
  }));
  pb::Reply reply;
  reply.mutable_station_key()->set_name(call.name());
  reply.mutable_station_key()->set_key(key.data(), key.size());
  return reply;
}

Result<pb::Reply> revokeStation(const Context& context, const pb::RevokeStation& call) {
  ASSIGN_OR_RETURN(const auto station, StationStore(context.reader).find(call.name()));
  if (station && station->revoked) {  // already so, perhaps by a request whose result was lost
    noteAccessChanged(context);
    return doneReply();
  }
  const Status written = writeIfChanged(context, call.name(), "", [&](Connection& writer) -> Result<bool> {
    ASSIGN_OR_RETURN(const auto now, StationStore(writer).find(call.name()));
    const bool changes = !now || !now->revoked;
    if (changes) RETURN_IF_ERROR(StationStore(writer).revoke(call.name()));
    noteAccessChanged(context);
    return changes;
  });
  if (!written) return written.error();
  return doneReply();
}

Result<pb::Reply> listStations(const Context& context, const pb::ListStations& call) {
  ASSIGN_OR_RETURN(const auto stations, StationStore(context.reader).list());
  pb::Reply reply;
  auto* list = reply.mutable_stations();
  PageRoom room;
  for (const Station& station : stations) {
    if (station.name <= call.page()) continue;
    // leaves room for each station's current status, which the server adds
    if (!room.take(station.name.size() + 512)) {
      list->set_next_page(list->stations().rbegin()->name());
      break;
    }
    auto* info = list->add_stations();
    info->set_name(station.name);
    info->set_revoked(station.revoked);
    info->set_created_unix_ns(station.created_unix_ns);
  }
  return reply;
}

}  // namespace needlelab::handlers
