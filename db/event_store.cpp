#include "db/event_store.h"

#include <algorithm>
#include <string>

#include "db/session_row.h"

namespace needlelab {
namespace {

constexpr std::string_view kInsert =
    "INSERT INTO session_events (session, position, kind, begin_tick, end_tick, begin_s, end_s, plunger_from,"
    " plunger_to, in_tissue_share, in_target_share, begin_x_m, begin_y_m, begin_z_m, begin_layer, "
    "begin_tissue,"
    " begin_insertion_m, begin_depth_m, begin_target, begin_target_distance_m, begin_hazard, end_x_m, "
    "end_y_m,"
    " end_z_m, end_layer, end_tissue, end_insertion_m, end_depth_m, end_target, end_target_distance_m,"
    " end_hazard, hazards) VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)";
constexpr std::string_view kSelectEvents =
    "SELECT kind, begin_tick, end_tick, begin_s, end_s, plunger_from, plunger_to, in_tissue_share,"
    " in_target_share, begin_x_m, begin_y_m, begin_z_m, begin_layer, begin_tissue, begin_insertion_m,"
    " begin_depth_m, begin_target, begin_target_distance_m, begin_hazard, end_x_m, end_y_m, end_z_m, "
    "end_layer,"
    " end_tissue, end_insertion_m, end_depth_m, end_target, end_target_distance_m, end_hazard, hazards"
    " FROM session_events WHERE session = ? ORDER BY position";
constexpr int kPlaceColumns = 10;

void bindPlace(Statement& statement, const pb::SyringePlace& place) {
  statement.bind(place.x_m()).bind(place.y_m()).bind(place.z_m());
  statement.bind(place.in_tissue() ? place.layer() : -1).bind(place.tissue());
  statement.bind(place.insertion_m()).bind(place.depth_m());
  statement.bind(place.target()).bind(place.target_distance_m()).bind(place.hazard());
}

void readPlace(const Statement& row, int column, pb::SyringePlace& place) {
  place.set_x_m(row.real(column));
  place.set_y_m(row.real(column + 1));
  place.set_z_m(row.real(column + 2));
  place.set_layer(static_cast<std::int32_t>(row.integer(column + 3)));
  place.set_in_tissue(place.layer() >= 0);
  place.set_tissue(row.text(column + 4));
  place.set_insertion_m(row.real(column + 5));
  place.set_depth_m(row.real(column + 6));
  place.set_target(row.text(column + 7));
  place.set_target_distance_m(row.real(column + 8));
  place.set_hazard(row.text(column + 9));
}

pb::SyringeEvent eventOf(const Statement& row) {
  pb::SyringeEvent event;
  event.set_kind(static_cast<pb::SyringeEvent::Kind>(row.integer(0)));
  event.set_begin_tick(row.natural(1));
  event.set_end_tick(row.natural(2));
  event.set_begin_s(row.real(3));
  event.set_end_s(row.real(4));
  event.set_plunger_from(row.real(5));
  event.set_plunger_to(row.real(6));
  event.set_in_tissue_share(row.real(7));
  event.set_in_target_share(row.real(8));
  readPlace(row, 9, *event.mutable_begin());
  readPlace(row, 9 + kPlaceColumns, *event.mutable_end());
  // one hazard a line
  const std::string hazards = row.text(9 + 2 * kPlaceColumns);
  for (std::size_t at = 0; at < hazards.size();) {
    const std::size_t end = std::min(hazards.find('\n', at), hazards.size());
    event.add_hazards(hazards.substr(at, end - at));
    at = end + 1;
  }
  return event;
}

}  // namespace

Status EventStore::put(const Uuid& session, std::span<const pb::SyringeEvent> events) {
  const auto found = findSession(connection_, session);
  if (!found) return found.error();
  if (!*found) return unknownSession(session);
  if ((*found)->state == pb::SESSION_OPEN)
    return Error{ErrorCode::kInvalidInput, "session " + uuidText(session) + " is open: close it first"};
  if (auto done = connection_.run("UPDATE sessions SET events = ? WHERE number = ? AND events IS NULL",
                                  static_cast<std::uint64_t>(events.size()), (*found)->number);
      !done)
    return done;
  if (connection_.changes() == 0) return {};
  for (std::size_t i = 0; i < events.size(); ++i) {
    const pb::SyringeEvent& event = events[i];
    std::string hazards;
    for (const std::string& hazard : event.hazards()) hazards += (hazards.empty() ? "" : "\n") + hazard;
    Statement insert = connection_.prepare(kInsert);
    insert.bind((*found)->number).bind(static_cast<std::uint64_t>(i)).bind(static_cast<int>(event.kind()));
    insert.bind(event.begin_tick()).bind(event.end_tick()).bind(event.begin_s()).bind(event.end_s());
    insert.bind(event.plunger_from()).bind(event.plunger_to());
    insert.bind(event.in_tissue_share()).bind(event.in_target_share());
    bindPlace(insert, event.begin());
    bindPlace(insert, event.end());
    if (auto done = insert.bind(hazards).run(); !done) return done;
  }
  return {};
}

Result<std::optional<std::vector<pb::SyringeEvent>>> EventStore::list(const Uuid& session) {
  auto known = connection_.query("SELECT number, events FROM sessions WHERE id = ?", ByteView(session));
  const auto found = known.step();
  if (!found) return found.error();
  if (!*found) return unknownSession(session);
  if (known.isNull(1)) return std::optional<std::vector<pb::SyringeEvent>>();
  std::vector<pb::SyringeEvent> events;
  auto rows = connection_.query(kSelectEvents, known.integer(0));
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return std::optional(std::move(events));
    events.push_back(eventOf(rows));
  }
}

}  // namespace needlelab
