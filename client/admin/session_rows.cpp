#include "client/admin/session_rows.h"

#include "common/base/uuid.h"

namespace needlelab {
namespace {

const char* stateName(pb::SessionState state) {
  switch (state) {
    case pb::SESSION_OPEN:
      return "open";
    case pb::SESSION_COMPLETE:
      return "complete";
    case pb::SESSION_INTERRUPTED:
      return "interrupted";
    default:
      return "unknown";
  }
}

std::string idText(const std::string& bytes) {
  Uuid id;
  if (bytes.size() != id.size()) return hexOfBytes(bytes);
  std::copy(bytes.begin(), bytes.end(), id.begin());
  return uuidText(id);
}

}  // namespace

std::string hexOfBytes(const std::string& bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  text.reserve(bytes.size() * 2);
  for (const char c : bytes) {
    text += kDigits[static_cast<unsigned char>(c) >> 4];
    text += kDigits[static_cast<unsigned char>(c) & 15];
  }
  return text;
}

Json sessionRow(const pb::SessionInfo& session) {
  const auto& d = session.description();
  const auto& r = d.resolution();
  Json row = {{"session_id", idText(d.session_id())},
              {"state", stateName(session.state())},
              {"station", d.station()},
              {"trainee", d.trainee()},
              {"exercise_id", d.exercise_id()},
              {"profile_id", d.profile_id()},
              {"profile_revision", d.profile_revision()},
              {"engine_version", d.engine_version()},
              {"device", d.device()},
              {"rate_hz", d.rate_hz()},
              {"resolution",
               {{"length_m", r.length_m()},
                {"quaternion", r.quaternion()},
                {"force_n", r.force_n()},
                {"torque_nm", r.torque_nm()},
                {"time_s", r.time_s()},
                {"speed_m_s", r.speed_m_s()}}},
              {"placement", std::vector<double>(d.placement().begin(), d.placement().end())},
              {"tool", std::vector<double>(d.tool().begin(), d.tool().end())},
              {"started_unix_ns", d.started_unix_ns()},
              {"started_steady_ns", d.started_steady_ns()},
              {"received_unix_ns", session.received_unix_ns()},
              {"closed_unix_ns", session.closed_unix_ns()},
              {"samples", session.samples()},
              {"chunks", session.chunks()},
              {"stored_bytes", session.stored_bytes()},
              {"hash", nullptr},
              {"clock_offset_ns", nullptr},
              {"clock_round_trip_ns", nullptr}};
  row["verdict"] = session.has_passed() ? Json(session.passed() ? "passed" : "failed") : Json();
  if (session.figures_size() > 0) {
    Json& figures = row["figures"] = Json::object();
    for (const pb::Figure& figure : session.figures())
      figures[figure.measure()] = figure.has_value() ? Json(figure.value()) : Json();
  }
  row["recording"] = "original";
  if (session.has_removed_original()) {
    const auto& removed = session.removed_original();
    const bool thinned = removed.fate() == pb::RemovedOriginal::THINNED;
    row["recording"] = thinned ? "thinned" : "deleted";
    row["removed_original"] = {{"removed_unix_ns", removed.removed_unix_ns()},
                               {"deleted_unix_ns", removed.deleted_unix_ns()},
                               {"reason", removed.reason()},
                               {"chunks", removed.chunks()},
                               {"samples", removed.samples()},
                               {"stored_bytes", removed.stored_bytes()},
                               {"hash", hexOfBytes(removed.hash())}};
    if (thinned) row["removed_original"]["thinned_rate_hz"] = removed.thinned_rate_hz();
  }
  if (!session.hash().empty()) row["hash"] = hexOfBytes(session.hash());
  if (session.clock_round_trip_ns() != 0) {
    row["clock_offset_ns"] = session.clock_offset_ns();
    row["clock_round_trip_ns"] = session.clock_round_trip_ns();
  }
  return row;
}

}  // namespace needlelab
