#include "db/sessions/session_results.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/text/text.h"
#include "db/people/look_alikes.h"
#include "db/sessions/session_rows.h"
#include "db/store/rows.h"

namespace needlelab {
namespace {

constexpr std::string_view kScore =
    "SELECT s.id, c.definition_version, c.measures, c.passed, c.made_unix_ns,"
    " c.first, c.engine_version FROM scores c JOIN sessions s ON s.number = c.session"
    " WHERE s.id = ?1 ";
constexpr std::size_t kMaxReferences = 200;

pb::Score scoreOfRow(const Statement& row) {
  pb::Score score;
  score.set_session_id(row.text(0));
  score.set_definition_version(row.natural32(1));
  score.set_measures_json(row.text(2));
  if (!row.isNull(3)) score.set_passed(row.integer(3) != 0);
  score.set_made_unix_ns(row.integer(4));
  score.set_first(row.integer(5) != 0);
  score.set_engine_version(row.text(6));
  return score;
}

/// Ids as a JSON list of texts: ["…","…"].
std::string idsJson(const std::vector<Uuid>& ids) {
  std::string json;
  for (const Uuid& id : ids) json += (json.empty() ? "\"" : ",\"") + uuidText(id) + "\"";
  return "[" + json + "]";
}

/// Reads as much as is valid.
std::vector<Uuid> idsInJson(const std::string& text) {
  std::vector<Uuid> ids;
  const auto list = nlohmann::json::parse(text, nullptr, false);
  if (!list.is_array()) return ids;
  for (const auto& one : list) {
    if (!one.is_string()) continue;
    if (const auto id = parseUuid(one.get<std::string>())) ids.push_back(*id);
  }
  return ids;
}

constexpr std::array kEventColumns = {"kind",
                                      "begin_tick",
                                      "end_tick",
                                      "begin_s",
                                      "end_s",
                                      "plunger_from",
                                      "plunger_to",
                                      "in_tissue_share",
                                      "in_target_share",
                                      "begin_x_m",
                                      "begin_y_m",
                                      "begin_z_m",
                                      "begin_layer",
                                      "begin_tissue",
                                      "begin_insertion_m",
                                      "begin_depth_m",
                                      "begin_target",
                                      "begin_target_distance_m",
                                      "begin_hazard",
                                      "end_x_m",
                                      "end_y_m",
                                      "end_z_m",
                                      "end_layer",
                                      "end_tissue",
                                      "end_insertion_m",
                                      "end_depth_m",
                                      "end_target",
                                      "end_target_distance_m",
                                      "end_hazard",
                                      "hazards"};
constexpr int kPlaceColumns = 10;

/// `to`: a Statement, or EventLists.
template <typename To>
void bindPlace(To& to, const pb::SyringePlace& place) {
  to.bind(place.x_m()).bind(place.y_m()).bind(place.z_m());
  to.bind(place.in_tissue() ? place.layer() : -1).bind(place.tissue());
  to.bind(place.insertion_m()).bind(place.depth_m());
  to.bind(place.target()).bind(place.target_distance_m()).bind(place.hazard());
}

/// Binds kEventColumns.
template <typename To>
void bindEvent(To& to, const pb::SyringeEvent& event) {
  std::string hazards;
  for (const std::string& hazard : event.hazards()) hazards += (hazards.empty() ? "" : "\n") + hazard;
  to.bind(static_cast<int>(event.kind()));
  to.bind(event.begin_tick()).bind(event.end_tick()).bind(event.begin_s()).bind(event.end_s());
  to.bind(event.plunger_from()).bind(event.plunger_to());
  to.bind(event.in_tissue_share()).bind(event.in_target_share());
  bindPlace(to, event.begin());
  bindPlace(to, event.end());
  to.bind(hazards);
}

std::string eventColumn(std::size_t column) {
  return kEventColumns[column];
}

/// "a, b, …": each of kEventColumns, formatted by `make`.
template <typename Make>
std::string eventColumns(const Make& make) {
  std::string text;
  for (std::size_t i = 0; i < kEventColumns.size(); ++i) text += (i == 0 ? "" : ", ") + make(i);
  return text;
}

/// All events, as one list per column for one statement: PostgreSQL needs a round trip per statement.
class EventLists {
 public:
  void add(const pb::SyringeEvent& event) {
    at_ = 0;
    bindEvent(*this, event);
  }
  EventLists& bind(double value) {
    Column& column = columns_[at_++];
    column.is_real = true;
    column.texts.push_back(fmt::format("{}", value));  // the shortest text that reads back as the same number
    return *this;
  }
  EventLists& bind(const std::string& value) {
    columns_[at_++].texts.push_back(value);
    return *this;
  }
  EventLists& bind(std::int64_t value) {
    Column& column = columns_[at_++];
    column.is_integer = true;
    column.integers.push_back(value);
    return *this;
  }
  EventLists& bind(std::int32_t value) { return bind(static_cast<std::int64_t>(value)); }
  EventLists& bind(std::uint64_t value) {
    fits_ = fits_ && value <= static_cast<std::uint64_t>(INT64_MAX);
    return bind(static_cast<std::int64_t>(value));
  }

  Status insert(Connection& connection, std::int64_t session) const {
    const std::string sql = fmt::format(
        "INSERT INTO session_events (session, position, {}) SELECT ?1, e.place - 1, {} FROM unnest({})"
        " WITH ORDINALITY AS e ({}, place)",
        eventColumns(eventColumn), eventColumns([&](std::size_t i) {
          return columns_[i].is_real ? fmt::format("CAST(e.{} AS DOUBLE PRECISION)", eventColumn(i))
                                     : "e." + eventColumn(i);
        }),
        eventColumns([](std::size_t i) { return fmt::format("?{}", i + 2); }), eventColumns(eventColumn));
    if (!fits_) return Error{ErrorCode::kInvalidInput, "an event has a tick of 2^63 or more"};
    Statement statement = connection.query(sql, session);
    for (const Column& column : columns_) {
      if (column.is_integer) {
        statement.bindList(std::span<const std::int64_t>(column.integers));
        continue;
      }
      const std::vector<std::string_view> texts(column.texts.begin(), column.texts.end());
      statement.bindList(std::span<const std::string_view>(texts));
    }
    return statement.run();
  }

 private:
  struct Column {
    bool is_real = false, is_integer = false;
    std::vector<std::int64_t> integers;
    std::vector<std::string> texts;  ///< numbers as well: there are no lists of reals
  };
  std::array<Column, kEventColumns.size()> columns_;
  std::size_t at_ = 0;
  bool fits_ = true;
};

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
  // one hazard per line
  const std::string hazards = row.text(9 + 2 * kPlaceColumns);
  for (std::size_t at = 0; at < hazards.size();) {
    const std::size_t end = std::min(hazards.find('\n', at), hazards.size());
    event.add_hazards(hazards.substr(at, end - at));
    at = end + 1;
  }
  return event;
}

}  // namespace

Status ScoreStore::put(const pb::Score& score) {
  const auto id = uuidOf(score.session_id());
  if (!id || score.definition_version() == 0)
    return Error{ErrorCode::kInvalidInput,
                 "score: wants a session_id of 16 bytes and a definition_version from 1"};
  std::int64_t number = 0;
  bool has_first = false;
  {
    auto row = connection_.query(
        "SELECT number, erased, EXISTS (SELECT 1 FROM scores WHERE session = number"
        " AND first = 1) FROM sessions WHERE id = ?",
        ByteView(*id));
    ASSIGN_OR_RETURN(const bool found, row.step());
    if (!found) return unknownSession(*id);
    if (row.integer(1) != 0)
      return Error{ErrorCode::kUnavailable,
                   "session " + uuidText(*id) + ": its person's data was erased, it gets no score"};
    number = row.integer(0);
    has_first = row.integer(2) != 0;
  }
  const int passed = score.has_passed() ? (score.passed() ? 1 : 0) : -1;
  RETURN_IF_ERROR(
      connection_.run("INSERT INTO scores (session, definition_version, measures, passed, first,"
                      " engine_version, made_unix_ns) VALUES (?,?,?,nullif(?, -1),?,?,?)"
                      " ON CONFLICT (session, definition_version) DO UPDATE"
                      " SET measures = excluded.measures, passed = excluded.passed,"
                      " engine_version = excluded.engine_version,"
                      " made_unix_ns = excluded.made_unix_ns WHERE scores.first = 0",
                      number, score.definition_version(), score.measures_json(), passed, !has_first,
                      score.engine_version(), score.made_unix_ns()));
  return connection_.run(
      "UPDATE sessions SET (score_json, passed) = (SELECT measures, passed"
      " FROM scores WHERE session = number AND first = 1) WHERE number = ?",
      number);
}

Result<pb::Score> ScoreStore::get(const Uuid& session, std::uint32_t version) {
  auto row = connection_.query(
      std::string(kScore) +
          "AND (?2 = 0 OR c.definition_version = ?2) ORDER BY c.definition_version DESC LIMIT 1",
      ByteView(session), version);
  ASSIGN_OR_RETURN(const bool found, row.step());
  if (found) return scoreOfRow(row);
  return Error{ErrorCode::kNotFound,
               "session " + uuidText(session) + " has no score" +
                   (version == 0 ? std::string() : fmt::format(" of definition version {}", version))};
}

Result<std::vector<pb::Score>> ScoreStore::list(const Uuid& session) {
  return connection_.query(std::string(kScore) + "ORDER BY c.definition_version", ByteView(session))
      .all(scoreOfRow);
}

Result<pb::Reference> ReferenceStore::put(const std::string& exercise_id, const std::vector<Uuid>& sessions,
                                          std::uint32_t base, const std::string& by,
                                          std::int64_t now_unix_ns) {
  RETURN_IF_ERROR(requireThing(connection_, Thing::kExercise, exercise_id));
  ASSIGN_OR_RETURN(const auto before, get(exercise_id));
  const std::string name = "the reference of exercise '" + exercise_id + "'";
  RETURN_IF_ERROR(checkBase(name, base, {before.revision(), before.changed_by(), before.changed_unix_ns()}));
  if (sessions.size() > kMaxReferences)
    return Error{ErrorCode::kInvalidInput, fmt::format("{}, session_ids: has {}, allowed are at most {}",
                                                       name, sessions.size(), kMaxReferences)};
  std::set<Uuid> seen;
  for (const Uuid& session : sessions) {
    const std::string which = name + ", session " + uuidText(session);
    if (!seen.insert(session).second) return Error{ErrorCode::kInvalidInput, which + ": is named twice"};
    auto row = connection_.query("SELECT exercise_id, state FROM sessions WHERE id = ?", ByteView(session));
    ASSIGN_OR_RETURN(const bool found, row.step());
    if (!found) return unknownSession(session);
    if (row.text(0) != exercise_id)
      return Error{ErrorCode::kInvalidInput, which + ": is of exercise '" + row.text(0) + "'"};
    if (row.integer(1) == pb::SESSION_OPEN) return Error{ErrorCode::kInvalidInput, which + ": is still open"};
  }
  RETURN_IF_ERROR(
      connection_.run("INSERT INTO exercise_references (exercise_id, revision, sessions, by_whom,"
                      " created_unix_ns) VALUES (?,?,?,?,?)",
                      exercise_id, before.revision() + 1, idsJson(sessions), by, now_unix_ns));
  return get(exercise_id);
}

Result<pb::Reference> ReferenceStore::get(std::string_view exercise_id) {
  pb::Reference reference;
  reference.set_exercise_id(std::string(exercise_id));
  auto row = connection_.query(
      "SELECT revision, by_whom, created_unix_ns, sessions FROM exercise_references"
      " WHERE exercise_id = ? ORDER BY revision DESC LIMIT 1",
      exercise_id);
  ASSIGN_OR_RETURN(const bool found, row.step());
  if (!found) return reference;
  reference.set_revision(row.natural32(0));
  reference.set_changed_by(row.text(1));
  reference.set_changed_unix_ns(row.integer(2));
  // only existing sessions: those of erased people are gone
  for (const Uuid& id : idsInJson(row.text(3))) {
    ASSIGN_OR_RETURN(const auto there,
                     connection_.query("SELECT 1 FROM sessions WHERE id = ? AND erased = 0", ByteView(id))
                         .first([](const Statement& session) { return session.integer(0); }));
    if (there) reference.add_session_ids(id.data(), id.size());
  }
  return reference;
}

Status EventStore::put(const Uuid& session, std::span<const pb::SyringeEvent> events) {
  ASSIGN_OR_RETURN(const SessionRow row, requireSession(connection_, session));
  if (row.state == pb::SESSION_OPEN)
    return Error{ErrorCode::kInvalidInput, "session " + uuidText(session) + " is open: close it first"};
  RETURN_IF_ERROR(connection_.run("UPDATE sessions SET events = ? WHERE number = ? AND events IS NULL",
                                  static_cast<std::uint64_t>(events.size()), row.number));
  if (connection_.changes() == 0) return {};
  if (events.empty()) return {};
  if (connection_.sqlite() == nullptr) {
    EventLists lists;
    for (const pb::SyringeEvent& event : events) lists.add(event);
    return lists.insert(connection_, row.number);
  }
  static const std::string insert_one =
      fmt::format("INSERT INTO session_events (session, position, {}) VALUES (?, ?, {})",
                  eventColumns(eventColumn), eventColumns([](std::size_t) { return std::string("?"); }));
  for (std::size_t i = 0; i < events.size(); ++i) {
    Statement insert = connection_.query(insert_one, row.number, static_cast<std::uint64_t>(i));
    bindEvent(insert, events[i]);
    RETURN_IF_ERROR(insert.run());
  }
  return {};
}

Result<std::optional<std::vector<pb::SyringeEvent>>> EventStore::list(const Uuid& session) {
  auto known = connection_.query("SELECT number, events FROM sessions WHERE id = ?", ByteView(session));
  ASSIGN_OR_RETURN(const bool found, known.step());
  if (!found) return unknownSession(session);
  if (known.isNull(1)) return std::optional<std::vector<pb::SyringeEvent>>();
  static const std::string select = fmt::format(
      "SELECT {} FROM session_events WHERE session = ? ORDER BY position", eventColumns(eventColumn));
  ASSIGN_OR_RETURN(auto events, connection_.query(select, known.integer(0)).all(eventOf));
  return std::optional(std::move(events));
}

Result<std::uint64_t> AnnotationStore::add(const StoredAnnotation& annotation) {
  RETURN_IF_ERROR(checkNote("annotation, text", annotation.text, 1, kMaxNoteBytes));
  ASSIGN_OR_RETURN(const auto session, findSession(connection_, annotation.session));
  if (!session) return unknownSession(annotation.session);
  ASSIGN_OR_RETURN(
      const auto id,
      connection_.insert(
          "INSERT INTO annotations (session, tick, text, author, created_unix_ns) VALUES (?,?,?,?,?)"
          " RETURNING id",
          session->number, annotation.tick, annotation.text, annotation.author, annotation.created_unix_ns));
  return static_cast<std::uint64_t>(id);
}

Result<std::vector<StoredAnnotation>> AnnotationStore::list(
    const Uuid& session, const std::optional<AnnotationPlace>& after,
    const std::function<bool(const StoredAnnotation&)>& take) {
  ASSIGN_OR_RETURN(const SessionRow found, requireSession(connection_, session));
  const auto annotationOf = [&](const Statement& row) {
    return StoredAnnotation{row.natural(0), session,     row.natural(1),
                            row.text(2),    row.text(3), row.integer(4)};
  };
  std::vector<StoredAnnotation> annotations;
  // without `after`: start before the first tick
  std::int64_t tick = after ? static_cast<std::int64_t>(after->tick) : -1;
  std::uint64_t id = after ? after->id : 0;
  for (RowsAtOnce at_once(kBytesOfPage);;) {
    at_once.goOn();
    auto rows = connection_.query(
        "SELECT id, tick, text, author, created_unix_ns FROM annotations"
        " WHERE session = ? AND (tick, id) > (?, ?) ORDER BY tick, id LIMIT ?",
        found.number, tick, id, at_once.count());
    for (bool all = false; !all;) {
      ASSIGN_OR_RETURN(auto annotation, rows.first(annotationOf));
      if (!annotation || (take && !take(*annotation))) return annotations;
      tick = rows.integer(1);
      id = annotation->id;
      all = at_once.took(annotation->text.size());
      annotations.push_back(*std::move(annotation));
    }
  }
}

Result<std::optional<std::string>> AnnotationStore::textOf(const Uuid& session, std::uint64_t id) {
  ASSIGN_OR_RETURN(const SessionRow found, requireSession(connection_, session));
  return connection_.query("SELECT text FROM annotations WHERE id = ? AND session = ?", id, found.number)
      .first(firstText);
}

Result<std::optional<std::uint64_t>> AnnotationStore::find(const Uuid& session, std::string_view author,
                                                           std::string_view text) {
  ASSIGN_OR_RETURN(const SessionRow found, requireSession(connection_, session));
  return connection_
      .query(
          "SELECT id FROM annotations WHERE session = ? AND author = ? AND text = ?"
          " ORDER BY tick, id LIMIT 1",
          found.number, author, text)
      .first([](const Statement& row) { return row.natural(0); });
}

}  // namespace needlelab
