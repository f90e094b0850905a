// Changes sessions: open, append, close. session_reader.cpp reads them.

#include "db/sessions/session_store.h"

#include <fmt/core.h>

#include <algorithm>

#include "common/base/planted_bug.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"
#include "db/audit/audit.h"
#include "db/people/people.h"
#include "db/people/person_refs.h"
#include "db/sessions/session_rows.h"
#include "db/sessions/unknown_trainees.h"
#include "db/teaching/attempts.h"
#include "db/teaching/documents.h"
#include "proto/session_rules.h"

namespace needlelab {
namespace {

/// The description as stored and compared: without trainee and profile, which have their own columns, and
/// without fields that this version does not know, in which a station could hide any text.
std::string bytesOf(pb::SessionDescription description) {
  description.clear_profile_json();
  description.clear_trainee();
  description.DiscardUnknownFields();
  return description.SerializeAsString();
}

std::string times(std::uint64_t count, const char* what) {
  return fmt::format("{} {}", count, what);
}

/// The fields needed to append a chunk to an open session, without the row's profile of some kB.
struct OpenRow {
  std::int64_t number = 0;
  std::uint64_t chunks = 0;
};
/// Nothing if the session is unknown, closed (as erased ones always are) or belongs to another station
/// (empty: any).
Result<std::optional<OpenRow>> findOpen(Connection& connection, const Uuid& session,
                                        std::string_view station) {
  auto query = connection.query(
      "SELECT s.number, p.chunks, s.station FROM sessions s"
      " JOIN session_progress p ON p.session = s.number WHERE s.id = ?",
      ByteView(session));
  ASSIGN_OR_RETURN(const bool found, query.step());
  if (!found || (!station.empty() && textOf(query.bytes(2)) != station)) return std::optional<OpenRow>();
  return std::optional(OpenRow{query.integer(0), query.natural(1)});
}

Error countersMissing(const std::string& name) {
  return {ErrorCode::kCorrupt, name +
                                   " is open, but its counters are not there: nothing is stored; "
                                   "needlelab-admin check names all such sessions"};
}

/// Writes the two rows of a session's next chunk.
Result<Appended> storeChunk(Connection& connection, const OpenRow& row, std::uint64_t seq,
                            std::uint64_t samples, ByteView bytes) {
  RETURN_IF_ERROR(connection.run("INSERT INTO chunks (session, seq, samples, crc, bytes) VALUES (?,?,?,?,?)",
                                 row.number, seq, samples, stationCrcOf(bytes), bytes));
  RETURN_IF_ERROR(
      connection.run("UPDATE session_progress"
                     " SET chunks = chunks + 1, samples = samples + ?,"
                     " stored_bytes = stored_bytes + ? WHERE session = ?",
                     samples, static_cast<std::uint64_t>(bytes.size()), row.number));
  if (connection.changes() != 1) return countersMissing(fmt::format("session number {}", row.number));
  return Appended{Appended::Kind::kStored, row.chunks + 1, {}};
}

/// Stores the next chunk, sound or quarantined. Nothing if it is not what its station sealed.
Result<std::optional<Appended>> takeNext(Connection& connection, const OpenRow& row, const Uuid& session,
                                         std::uint64_t seq, ByteView bytes, std::string_view station) {
  const auto info = checkChunk(bytes);
  const auto samples = info ? std::optional(info->count) : sealedSamples(bytes);
  if (!samples) return std::optional<Appended>();
  ASSIGN_OR_RETURN(auto stored, storeChunk(connection, row, seq, *samples, bytes));
  if (info) return std::optional(std::move(stored));

  stored.quarantined = true;
  stored.text = fmt::format("session {}, chunk {}: {}", uuidText(session), seq, info.error().message);
  auto others = connection.query("SELECT 1 FROM quarantined_chunks WHERE session = ? LIMIT 1", row.number);
  ASSIGN_OR_RETURN(const bool first_was_before, others.step());
  RETURN_IF_ERROR(connection.run("INSERT INTO quarantined_chunks (session, seq, reason) VALUES (?,?,?)",
                                 row.number, seq, info.error().message));
  if (first_was_before) return std::optional(std::move(stored));
  // one line per session: a station must not be able to fill the log
  const std::string who = station.empty() ? "station" : std::string(station);
  RETURN_IF_ERROR(
      AuditStore(connection).add({0, wallNowNs(), who, "chunk quarantine", uuidText(session), stored.text}));
  return std::optional(std::move(stored));
}

/// Refuses a chunk that contradicts the stored one. The session's first contradiction gets a line in the
/// audit log: two recordings share one id. One line per session, which cannot be removed: a station must not
/// be able to fill the log. A note in `meta` saves searching for the line.
Result<Appended> refuseContradicting(Connection& connection, const SessionRow& row, const Uuid& session,
                                     std::string_view station, std::string text) {
  RETURN_IF_ERROR(connection.run("INSERT INTO meta (key, value) VALUES (?, '') ON CONFLICT (key) DO NOTHING",
                                 "contradicted " + uuidText(session)));
  if (connection.changes() > 0) {
    const std::string who = station.empty() ? "station" : std::string(station);
    RETURN_IF_ERROR(
        AuditStore(connection).add({0, wallNowNs(), who, "chunk contradicts", uuidText(session), text}));
  }
  return Appended{Appended::Kind::kContradiction, row.chunks, std::move(text)};
}

/// Compares a chunk with one that retention has removed, using the stored CRC.
Result<Appended> compareWithRemoved(Connection& connection, const SessionRow& row, const Uuid& session,
                                    std::uint64_t seq, ByteView bytes, std::string_view station) {
  const std::string chunk = fmt::format("session {}, chunk {}", uuidText(session), seq);
  auto kept = connection.query("SELECT substr(crcs, ?, 4) FROM removed_originals WHERE session = ?",
                               4 * seq + 1, row.number);
  ASSIGN_OR_RETURN(const bool there, kept.step());
  if (!there || kept.bytes(0).size() != 4)
    return Error{ErrorCode::kCorrupt, chunk + " was removed, but its CRC was not kept"};
  if (stationCrcOf(kept.bytes(0)) == stationCrcOf(bytes) && inspectChunk(bytes).ok())
    return Appended{Appended::Kind::kRepeated, row.chunks, {}};
  ASSIGN_OR_RETURN(const auto why, removalText(connection, row));
  return refuseContradicting(connection, row, session, station,
                             chunk + " was stored with other bytes before " + why + ": it is not taken");
}

}  // namespace

Result<SessionArrival> SessionStore::arrivalOf(const pb::SessionDescription& description) {
  SessionArrival arrival;
  auto known = connection_.query("SELECT state FROM sessions WHERE id = ?", viewOf(description.session_id()));
  ASSIGN_OR_RETURN(const bool found, known.step());
  if (found) {
    arrival.state =
        known.integer(0) == pb::SESSION_OPEN ? SessionArrival::State::kOpen : SessionArrival::State::kClosed;
    return arrival;
  }
  auto open = connection_.query("SELECT count(*) FROM sessions WHERE station = ? AND state = ?",
                                description.station(), static_cast<int>(pb::SESSION_OPEN));
  ASSIGN_OR_RETURN(const bool counted, open.step());
  if (counted) arrival.open_sessions = open.natural(0);
  if (description.trainee().empty() || description.trainee() == kGuestName) return arrival;
  ASSIGN_OR_RETURN(const auto known_name,
                   findPerson(connection_, description.trainee(), Named::kAccountOrTyped));
  arrival.unknown_name = !known_name;
  return arrival;
}

Result<std::uint64_t> SessionStore::open(const pb::SessionDescription& given, std::int64_t now_unix_ns) {
  RETURN_IF_ERROR(checkDescription(given));
  const std::string bytes = bytesOf(given);
  UnknownTraineeStore trainees(connection_);

  // known session: the same description is a reconnect; a different one is an error and must not be stored
  auto known = connection_.query(
      "SELECT coalesce(p.chunks, s.chunks), s.description, s.profile_json, s.erased, s.number"
      " FROM sessions s LEFT JOIN session_progress p ON p.session = s.number WHERE s.id = ?",
      viewOf(given.session_id()));
  ASSIGN_OR_RETURN(const bool found, known.step());
  if (found) {
    ASSIGN_OR_RETURN(const bool same_trainee, trainees.isOf(known.integer(4), given.trainee()));
    if (known.integer(3) != 0 ||
        (textOf(known.bytes(1)) == bytes && known.text(2) == given.profile_json() && same_trainee))
      return known.natural(0);
    return Error{ErrorCode::kAlreadyExists,
                 "session " + sessionText(given.session_id()) +
                     " is known with another description: a session id is used once only"};
  }

  auto station = connection_.query("SELECT 1 FROM stations WHERE name = ?", given.station());
  ASSIGN_OR_RETURN(const bool exists, station.step());
  if (!exists) return Error{ErrorCode::kNotFound, "there is no station named '" + given.station() + "'"};

  ASSIGN_OR_RETURN(auto trainee, trainees.traineeOf(given, now_unix_ns));
  // without a person there is no attempt and no order
  if (isPersonRef(trainee.ref) && !trainee.erased) {
    ASSIGN_OR_RETURN(trainee.begin_unsure, trainees.isBeginUnsure(given, now_unix_ns));
    ASSIGN_OR_RETURN(trainee.not_assigned, trainees.lacksAssignment(trainee.ref, given.exercise_id()));
    trainee.waits = trainee.waits || trainee.begin_unsure || trainee.not_assigned;
    trainee.code_unchecked = trainee.code_unchecked || trainee.begin_unsure || trainee.not_assigned;
  }
  // nothing is lost: the station keeps the recording and asks again at its next start
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(trainee.ref));
  if (person && person->disabled && given.started_unix_ns() >= person->changed_unix_ns)
    return Error{ErrorCode::kDenied,
                 "'" + person->name +
                     "' is disabled and opens no session: ask an administrator; once the person is enabled "
                     "again, the session is taken"};

  RETURN_IF_ERROR(connection_.run(
      "INSERT INTO sessions (id, station, trainee, exercise_id, profile_id,"
      " profile_revision, profile_json, engine_version, rate_hz, started_unix_ns,"
      " description, state, received_unix_ns) VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?)",
      viewOf(given.session_id()), given.station(), trainee.ref, given.exercise_id(), given.profile_id(),
      given.profile_revision(), trainee.erased ? "{}" : given.profile_json(), given.engine_version(),
      given.rate_hz(), given.started_unix_ns(), viewOf(bytes), static_cast<int>(pb::SESSION_OPEN),
      now_unix_ns));
  const auto id = uuidOf(given.session_id());
  if (trainee.erased) {
    RETURN_IF_ERROR(trainees.leaveEmpty(*id, now_unix_ns));
  } else if (trainee.waits) {
    RETURN_IF_ERROR(trainees.flag(*id, trainee));
  }
  // an earlier attempt that arrives late displaces one that counted
  ASSIGN_OR_RETURN(const auto rules, CurriculumStore(connection_).rulesOf(given.exercise_id()));
  if (rules.exam_attempts && isPersonRef(trainee.ref))
    RETURN_IF_ERROR(AttemptStore(connection_).countExam(given.exercise_id(), trainee.ref));
  return std::uint64_t{0};
}

Result<Appended> SessionStore::append(const Uuid& session, std::uint64_t seq, ByteView bytes,
                                      std::string_view station) {
  // fast path: most chunks are the next one of an open session; one look-up, no messages
  ASSIGN_OR_RETURN(const auto open, findOpen(connection_, session, station));
  if (open && seq == open->chunks && bytes.size() <= kMaxStoredChunkBytes) {
    ASSIGN_OR_RETURN(auto taken, takeNext(connection_, *open, session, seq, bytes, station));
    if (taken) return *std::move(taken);
  }

  ASSIGN_OR_RETURN(const auto found, findSession(connection_, session));
  const std::string name = "session " + uuidText(session);
  if (!found || (!station.empty() && found->station != station)) {
    return Appended{Appended::Kind::kUnknownSession, 0,
                    name + " was not opened by this station: open it first"};
  }
  const SessionRow& row = *found;
  const std::string chunk = fmt::format("{}, chunk {}", name, seq);

  // acknowledge it, so that the station's spool drops it, but do not store it
  if (row.erased) return Appended{Appended::Kind::kRepeated, std::max(seq + 1, row.chunks), {}};

  // a chunk with this seq is stored: the bytes are identical, or a contradiction
  if (seq < row.chunks && row.recording != StoredRecording::Kind::kOriginal)
    return compareWithRemoved(connection_, row, session, seq, bytes, station);
  if (seq < row.chunks) {
    // the length alone is in the row's first page: a stored chunk is read only if it has the same length, so
    // that a request costs the writer no more than was sent
    auto stored = connection_.query(
        "SELECT length(bytes) = ?3, CASE WHEN length(bytes) = ?3 THEN bytes END FROM chunks WHERE session = "
        "?1 "
        "AND seq = ?2",
        row.number, seq, bytes.size());
    ASSIGN_OR_RETURN(const bool there, stored.step());
    if (!there)
      return Error{ErrorCode::kCorrupt,
                   chunk + " is missing from the database although later ones are there"};
    const ByteView old = stored.bytes(1);
    if (stored.integer(0) != 0 && std::equal(old.begin(), old.end(), bytes.begin(), bytes.end())) {
      if (planted(PlantedBug::kRepeatedChunkStoredTwice)) return append(session, row.chunks, bytes, station);
      return Appended{Appended::Kind::kRepeated, row.chunks, {}};
    }
    if (planted(PlantedBug::kRepeatedChunkOverwrites)) {
      RETURN_IF_ERROR(connection_.run("UPDATE chunks SET bytes = ?, crc = ? WHERE session = ? AND seq = ?",
                                      bytes, stationCrcOf(bytes), row.number, seq));
      return Appended{Appended::Kind::kRepeated, row.chunks, {}};
    }
    return refuseContradicting(connection_, row, session, station,
                               chunk + " is stored with other bytes: it stays as it was");
  }
  if (row.state != pb::SESSION_OPEN) {
    return refuseContradicting(
        connection_, row, session, station,
        chunk + " comes after the session was closed with " + times(row.chunks, "chunks"));
  }
  if (seq > row.chunks && !planted(PlantedBug::kGapAccepted)) {
    return Appended{Appended::Kind::kGap, row.chunks,
                    fmt::format("{} leaves a gap: send {} first", chunk, row.chunks)};
  }
  if (bytes.size() > kMaxStoredChunkBytes) {
    return Appended{Appended::Kind::kCorrupt, row.chunks,
                    fmt::format("{} has {}, at most {} are taken", chunk, times(bytes.size(), "bytes"),
                                kMaxStoredChunkBytes)};
  }
  ASSIGN_OR_RETURN(auto taken, takeNext(connection_, {row.number, row.chunks}, session, seq, bytes, station));
  if (taken) return *std::move(taken);
  return Appended{Appended::Kind::kCorrupt, row.chunks, chunk + ": " + checkChunk(bytes).error().message};
}

Status SessionStore::append(const ArrivedChunk& chunk) {
  RETURN_IF_ERROR(StationClaims(connection_).require(chunk.claim));
  ASSIGN_OR_RETURN(auto appended, append(chunk.session, chunk.seq, chunk.bytes, chunk.station));
  // last, so that a chunk that was not stored costs its station nothing
  if (appended.kind == Appended::Kind::kStored && chunk.admit) RETURN_IF_ERROR(chunk.admit(appended));
  *chunk.appended = std::move(appended);
  return {};
}

Result<Closed> SessionStore::close(const pb::CloseSession& request, std::int64_t now_unix_ns,
                                   std::string_view station) {
  ASSIGN_OR_RETURN(auto closed, closeHashed(request, now_unix_ns, station, {}));
  if (closed.kind != Closed::Kind::kNotHashed) return closed;
  ASSIGN_OR_RETURN(const auto known, hashChunks(*uuidOf(request.session_id()), request.chunks()));
  return closeHashed(request, now_unix_ns, station, known);
}

Result<Closed> SessionStore::closeHashed(const pb::CloseSession& request, std::int64_t now_unix_ns,
                                         std::string_view station, const std::optional<HashedChunks>& known) {
  const auto id = uuidOf(request.session_id());
  ASSIGN_OR_RETURN(const auto found,
                   id ? findSession(connection_, *id) : Result<std::optional<SessionRow>>(std::nullopt));
  const std::string name = "session " + sessionText(request.session_id());
  if (!found || (!station.empty() && found->station != station)) {
    return Closed{Closed::Kind::kUnknownSession, 0, pb::SESSION_STATE_UNSPECIFIED,
                  name + " was not opened by this station: open it first"};
  }
  const SessionRow& row = *found;
  if (row.erased) return Closed{Closed::Kind::kRepeated, request.chunks(), row.state, {}};
  const auto contradiction = [&](const std::string& what) {
    return Closed{Closed::Kind::kContradiction, row.chunks, row.state, name + " cannot be closed: " + what};
  };

  if (row.state == pb::SESSION_OPEN && request.chunks() > row.chunks) {
    return Closed{Closed::Kind::kIncomplete, row.chunks, row.state,
                  name + " cannot be closed with " + times(request.chunks(), "chunks") + ", " +
                      times(row.chunks, "are stored") + ": send the rest first"};
  }
  if (request.chunks() != row.chunks) {
    return contradiction(fmt::format("{} chunks are stored, not {}", row.chunks, request.chunks()));
  }
  // a station whose disk lost stored chunks knows neither their samples nor the hash
  const bool unverified = request.hash().empty() && request.interrupted();
  if (!unverified && request.samples() != row.samples) {
    return contradiction(fmt::format("{} samples are stored, not {}", row.samples, request.samples()));
  }

  // hash the stored data, not the data in memory
  Digest hash{};
  if (row.hash) {
    hash = *row.hash;
  } else if (known && known->chunks == row.chunks && known->samples == row.samples) {
    hash = known->hash;
  } else {
    return Closed{Closed::Kind::kNotHashed, row.chunks, row.state,
                  name + " cannot be closed: chunks came meanwhile, close it again"};
  }
  if (!unverified && textOf(hash) != request.hash() && !planted(PlantedBug::kHashNotChecked)) {
    return contradiction("the hash over the stored chunks is " + hexOf(hash) +
                         ", which is not the station's");
  }
  if (row.state != pb::SESSION_OPEN) return Closed{Closed::Kind::kRepeated, row.chunks, row.state, {}};
  if (!row.counting) return countersMissing(name);

  const bool whole = !request.interrupted() && request.samples_lost() == 0;
  const auto state = whole ? pb::SESSION_COMPLETE : pb::SESSION_INTERRUPTED;
  // the schema's trigger copies the counters from session_progress to the session's row
  RETURN_IF_ERROR(
      connection_.run("UPDATE sessions SET state = ?, hash = ?, closed_unix_ns = ? WHERE number = ?",
                      static_cast<int>(state), ByteView(hash), now_unix_ns, row.number));
  return Closed{Closed::Kind::kClosed, row.chunks, state, {}};
}

Status SessionStore::setClockOffset(const Uuid& session, std::int64_t offset_ns, std::int64_t round_trip_ns) {
  if (round_trip_ns <= 0) {
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("clock offset of session {}: round_trip_ns is {}, allowed is above 0",
                             uuidText(session), round_trip_ns)};
  }
  ASSIGN_OR_RETURN(const SessionRow row, requireSession(connection_, session));
  return connection_.run(
      "UPDATE sessions SET clock_offset_ns = ?, clock_round_trip_ns = ?"
      " WHERE number = ? AND (clock_round_trip_ns IS NULL OR clock_round_trip_ns > ?)",
      offset_ns, round_trip_ns, row.number, round_trip_ns);
}

Status SessionStore::markSafe(const Uuid& session, std::uint64_t chunks) {
  return connection_.run("UPDATE sessions SET safe_chunks = ? WHERE id = ? AND safe_chunks < ?", chunks,
                         ByteView(session), chunks);
}

}  // namespace needlelab
