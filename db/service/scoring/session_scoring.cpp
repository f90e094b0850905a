#include "db/service/scoring/session_scoring.h"

#include <fmt/core.h>
#include <algorithm>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/base/time/clock.h"
#include "common/profile/profile.h"
#include "common/scoring/measures/syringe_events.h"
#include "db/audit/audit.h"
#include "db/people/person_name.h"
#include "db/service/context/context.h"
#include "db/service/scoring/held_results.h"
#include "db/service/scoring/session_samples.h"
#include "db/sessions/seen_time.h"
#include "db/sessions/session_results.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

// what a station lost, and why; human-readable; empty if nothing was lost
std::string lossText(const pb::CloseSession& request) {
  const std::uint64_t damaged = std::min(request.samples_damaged(), request.samples_lost());
  const std::uint64_t refused = request.samples_lost() - damaged;
  std::string text;
  if (refused > 0)
    text = fmt::format(
        "{} samples from tick {} on were lost at the station: its disk refused them for longer than its "
        "memory lasted",
        refused, request.lost_from_tick());
  if (damaged > 0)
    text += fmt::format(
        "{}{} samples ({} whole chunks) from tick {} on are missing: the station's disk lost them, by damage "
        "or in a power cut",
        text.empty() ? "" : ". ", damaged, request.chunks_damaged(), request.lost_from_tick());
  if (request.hash().empty())
    text += fmt::format(
        "{}The station's disk lost chunks that are stored here, so the recording could not be "
        "held against its hash",
        text.empty() ? "" : ". ");
  return text;
}

// a session that lost samples gets a remark in the same transaction, so that every view shows the loss
Status noteLoss(Connection& writer, const Uuid& id, const pb::CloseSession& request,
                const std::string& station, std::string text) {
  StoredAnnotation remark;
  remark.session = id;
  remark.tick = std::min<std::uint64_t>(request.lost_from_tick(), INT64_MAX);
  remark.author = station.empty() ? "station" : "station " + station;
  remark.text = std::move(text);
  remark.created_unix_ns = wallNowNs();
  const auto added = AnnotationStore(writer).add(remark);
  return added ? Status() : Status(added.error());
}

// two strokes per second for the longest recording that is scored at 1 kHz
static_assert(kMaxSyringeEvents == 2 * kMaxScoredSamples / 1000);

// a recording with more strokes than are kept gets one remark, in the same transaction
Status storeEvents(Connection& writer, const Uuid& id, const std::vector<pb::SyringeEvent>& events) {
  EventStore store(writer);
  bool cut = false;
  if (events.size() >= kMaxSyringeEvents) {
    ASSIGN_OR_RETURN(const auto stored, store.list(id));
    cut = !stored.has_value();
  }
  RETURN_IF_ERROR(store.put(id, events));
  if (!cut) return {};
  StoredAnnotation remark;
  remark.session = id;
  remark.tick = std::min<std::uint64_t>(events.back().end_tick(), INT64_MAX);
  remark.author = kServerName;
  remark.text = fmt::format(
      "The plunger made {} strokes up to here, the most that are kept: later ones are not stored, shown or "
      "scored",
      events.size());
  remark.created_unix_ns = wallNowNs();
  const auto added = AnnotationStore(writer).add(remark);
  return added ? Status() : Status(added.error());
}

// a session in a body whose paths came late gets one remark, in the same transaction
Status noteLatePaths(Connection& writer, const Uuid& id, const GestureScore::LatePaths& late) {
  if (late.kept + late.skipped == 0) return {};
  StoredAnnotation remark;
  remark.session = id;
  remark.tick = std::min<std::uint64_t>(late.first_tick, INT64_MAX);
  remark.author = kServerName;
  remark.text = fmt::format(
      "The station found the body's layers too late in {} ticks, and in {} the needle had passed a layer that "
      "was not felt",
      late.kept, late.skipped);
  remark.created_unix_ns = wallNowNs();
  ASSIGN_OR_RETURN(const auto same, AnnotationStore(writer).find(id, remark.author, remark.text));
  if (same) return {};
  const auto added = AnnotationStore(writer).add(remark);
  return added ? Status() : Status(added.error());
}

constexpr std::size_t kMaxKnownFaults = 1000;

/// Per close; repeated if chunks arrive between the read and the writer's turn.
constexpr std::uint32_t kMaxLooks = 2;

/// Whether the writer will need the hash; it answers a close that contradicts the counters without it.
bool needsHash(const pb::SessionInfo& info, const CloseUnderWay& close) {
  const pb::CloseSession& request = close.request;
  if (info.state() != pb::SESSION_OPEN || info.chunks() != request.chunks()) return false;
  if (!close.station.empty() && info.description().station() != close.station) return false;
  return info.samples() == request.samples() || (request.hash().empty() && request.interrupted());
}

}  // namespace

Result<std::string> SessionScoring::scoreSession(Connection& reader, const Uuid& session) {
  SessionScore score(session);
  for (;;) {
    ASSIGN_OR_RETURN(auto measures, scoreSome(reader, session, score, StepWork::all()));
    if (measures) return *std::move(measures);
  }
}

Result<std::optional<std::string>> SessionScoring::scoreSome(Connection& reader, const Uuid& session,
                                                             SessionScore& score, StepWork work) {
  if (!score.hasBegun()) {
    const std::scoped_lock lock(faults_mutex_);
    if (const auto known = unreadable_.find(session); known != unreadable_.end()) return known->second;
  }
  const auto done = score.step(reader, reference_paths_, work);
  if (done) {
    if (!*done) return std::optional<std::string>();
    if (!score.json()) return score.json().error();
    return std::optional(*score.json());
  }
  if (!score.isRead() && isLasting(done.error())) {
    const std::scoped_lock lock(faults_mutex_);
    if (unreadable_.size() >= kMaxKnownFaults) unreadable_.clear();
    unreadable_.insert_or_assign(session, done.error());
  }
  return done.error();
}

Result<CloseOutcome> SessionScoring::closeSession(const pb::CloseSession& request,
                                                  const std::string& station) {
  CloseUnderWay close{request, station};
  for (;;) {
    ASSIGN_OR_RETURN(auto outcome, closeStep(close));
    if (outcome) return *std::move(outcome);
  }
}

Result<std::optional<CloseOutcome>> SessionScoring::closeStep(CloseUnderWay& close) {
  const pb::CloseSession& request = close.request;
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  SessionStore sessions(*reader);
  ASSIGN_OR_RETURN(const auto id, handlers::sessionId(request.session_id()));
  if (close.unscored) return scoreStep(*reader, id, close);

  // read and hash here, never on the writer's thread
  std::optional<HashedChunks> known;
  if (const auto info = sessions.info(id); info && needsHash(*info, close)) {
    auto hashed = running_hashes_.goOn(sessions, id, request.chunks());
    if (hashed) {
      if (!*hashed) return std::optional<CloseOutcome>();
      known = **hashed;
    } else {
      // an erasure may have removed its recording and closed it meanwhile: then no hash is needed
      const auto now = sessions.info(id);
      if (!now || needsHash(*now, close)) return hashed.error();
    }
  }
  std::optional<CloseOutcome> done(std::in_place);
  CloseOutcome& outcome = *done;
  const Status closed = writer_.run([&](Connection& writer) -> Status {
    RETURN_IF_ERROR(StationClaims(writer).require(close.claim.get()));
    const std::int64_t now_unix_ns = wallNowNs();
    ASSIGN_OR_RETURN(outcome.closed,
                     SessionStore(writer).closeHashed(request, now_unix_ns, close.station, known));
    if (outcome.closed.kind != Closed::Kind::kClosed) return Status();
    if (auto noted = SeenTimeStore(writer).noteClose(id, now_unix_ns); !noted.ok()) return noted;
    std::string lost = lossText(request);
    return lost.empty() ? Status() : noteLoss(writer, id, request, close.station, std::move(lost));
  });
  if (!closed) return closed.error();
  if (outcome.closed.kind == Closed::Kind::kNotHashed) {
    if (++close.looked_again > kMaxLooks) return Error{ErrorCode::kUnavailable, outcome.closed.text};
    return std::optional<CloseOutcome>();
  }
  if (!outcome.closed.taken()) return done;
  running_hashes_.forget(id);

  // a repeated close returns the first score
  if (const auto info = sessions.info(id); info && !info->score_json().empty()) {
    ASSIGN_OR_RETURN(const bool held, isHeld(*reader, id, wallNowNs()));
    if (!held) outcome.score_json = info->score_json();
    return done;
  }
  if (outcome.closed.kind == Closed::Kind::kRepeated) {
    const std::scoped_lock lock(faults_mutex_);
    if (const auto failed = score_faults_.find(id); failed != score_faults_.end()) {
      outcome.score_fault = failed->second;
      return done;
    }
  }
  close.unscored = std::move(outcome);
  return scoreStep(*reader, id, close);
}

Result<std::optional<CloseOutcome>> SessionScoring::scoreStep(Connection& reader, const Uuid& session,
                                                              CloseUnderWay& close) {
  if (!close.is_long) {
    ASSIGN_OR_RETURN(const auto info, SessionStore(reader).info(session));
    close.is_long = info.samples() > kShortScoreSamples;
    if (close.is_long) return std::optional<CloseOutcome>();
  }
  if (!close.score) close.score = std::make_shared<SessionScore>(session);
  ASSIGN_OR_RETURN(auto settled,
                   settle(reader, session, *close.score,
                          close.is_long ? StepWork(kScoredAtOnce) : StepWork::all(), close.claim.get()));
  if (settled.is_pending) return std::optional<CloseOutcome>();
  std::optional<CloseOutcome> done = close.unscored;
  CloseOutcome& outcome = *done;
  ASSIGN_OR_RETURN(const bool held, isHeld(reader, session, wallNowNs()));
  if (!held) outcome.score_json = std::move(settled.score_json);
  outcome.event_bytes = settled.event_bytes;
  if (settled.fault) {
    outcome.score_fault = settled.fault->message;
    const std::scoped_lock lock(faults_mutex_);
    if (score_faults_.size() >= kMaxKnownFaults) score_faults_.clear();
    score_faults_[session] = outcome.score_fault;
  }
  return done;
}

Result<SessionScoring::Settled> SessionScoring::settle(Connection& reader, const Uuid& session,
                                                       SessionScore& score, StepWork work,
                                                       const StationClaim* claim) {
  // an exception (out of memory) concerns this session only
  try {
    auto settled = settleOrThrow(reader, session, score, work, claim);
    if (settled && (!settled->fault || settled->final)) return settled;
    // an erasure may have removed it meanwhile: treat it as if it had come first
    const auto now = SessionStore(reader).info(session);
    if (!now || !now->has_removed_original()) return settled;
    Settled gone;
    gone.fault = originalRemoved(session, *now);
    gone.final = true;
    return gone;
  } catch (const std::exception& thrown) {
    Settled settled;
    settled.fault = Error{ErrorCode::kFailed, fmt::format("scoring failed inside: {}", thrown.what())};
    return settled;
  }
}

Result<SessionScoring::Settled> SessionScoring::settleOrThrow(Connection& reader, const Uuid& session,
                                                              SessionScore& score, StepWork work,
                                                              const StationClaim* claim) {
  Settled settled;
  if (!score.hasBegun()) {
    ASSIGN_OR_RETURN(const auto never, whyNeverScored(reader, session));
    if (never) {
      settled.fault = Error{ErrorCode::kInvalidInput, *never};
      settled.final = true;
      return settled;
    }
  }
  const auto done = score.step(reader, reference_paths_, work);
  if (!done) {
    settled.fault = done.error();
    settled.final = !score.isRead() && done.error().code == ErrorCode::kInvalidInput;
    if (!settled.final) return settled;
    ASSIGN_OR_RETURN(const auto info, SessionStore(reader).info(session));
    // an invalid profile is detected before anything is decoded
    if (info.has_removed_original() || !parseProfile(info.description().profile_json(), "profile"))
      return settled;
    const Status noted = writer_.run([&](Connection& writer) -> Status {
      RETURN_IF_ERROR(StationClaims(writer).require(claim));
      return noteNeverScored(writer, session, settled.fault->message);
    });
    if (!noted) return noted.error();
    return settled;
  }
  settled.is_pending = !*done;
  if (settled.is_pending) return settled;
  const Result<std::string>& json = score.json();
  if (!json) settled.fault = json.error();
  const std::vector<pb::SyringeEvent>& events = score.events();
  const Status written = writer_.run([&](Connection& writer) -> Status {
    RETURN_IF_ERROR(StationClaims(writer).require(claim));
    RETURN_IF_ERROR(storeEvents(writer, session, events));
    RETURN_IF_ERROR(noteLatePaths(writer, session, score.latePaths()));
    return json && !json->empty() ? ScoreStore(writer).put(newScore(session, *json)) : Status();
  });
  if (!written) return written.error();
  for (const pb::SyringeEvent& event : events) settled.event_bytes += event.ByteSizeLong();
  if (json) settled.score_json = *json;
  return settled;
}

Status SessionScoring::settleRecording(const Uuid& session) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  ASSIGN_OR_RETURN(const auto info, SessionStore(*reader).info(session));
  ASSIGN_OR_RETURN(const auto events, EventStore(*reader).list(session));
  // keep an existing score: it was made when the session was closed
  if (!info.score_json().empty() && events.has_value()) return {};
  if (!info.score_json().empty()) {
    const auto read = samplesOf(*reader, session);
    if (!read) return read.error().code == ErrorCode::kInvalidInput ? Status() : Status(read.error());
    const auto made = eventsOf(*read);
    RETURN_IF_ERROR(read->samples.fault());
    return writer_.run([&](Connection& writer) { return storeEvents(writer, session, made); });
  }
  SessionScore score(session);
  Settled settled;
  do {
    ASSIGN_OR_RETURN(settled, settle(*reader, session, score, StepWork::all()));
  } while (settled.is_pending);
  if (!settled.fault || settled.final) return {};
  return Error{settled.fault->code,
               "session " + uuidText(session) +
                   " has no score yet, and it cannot be made now: " + settled.fault->message};
}

Result<pb::Reply> SessionScoring::rescore(const Principal& principal, const pb::RescoreSession& call,
                                          RequestUnderWay& under_way) {
  ASSIGN_OR_RETURN(const auto id, handlers::sessionId(call.session_id()));
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  ASSIGN_OR_RETURN(const auto info, SessionStore(*reader).info(id));
  const std::string name = "session " + uuidText(id);
  if (info.state() == pb::SESSION_OPEN)
    return Error{ErrorCode::kUnavailable, name + " is still open: it is scored when it is closed"};
  // a thinned recording does not give the original's measures (README of common/gesture, thinning)
  const Error gone{ErrorCode::kUnavailable,
                   name + ": its original recording is gone, its scores stay as they are"};
  if (info.has_removed_original()) return gone;
  if (!under_way.is_long && info.samples() > kShortScoreSamples) {
    under_way.is_long = under_way.more = true;
    return pb::Reply();
  }
  if (!under_way.score) under_way.score = std::make_shared<SessionScore>(id);
  const auto scored =
      scoreSome(*reader, id, *under_way.score, under_way.is_long ? StepWork(kScoredAtOnce) : StepWork::all());
  if (!scored) {
    // a retention run may have removed it meanwhile
    const auto now = SessionStore(*reader).info(id);
    return now && now->has_removed_original() ? gone : scored.error();
  }
  const auto& measures = *scored;
  under_way.more = !measures;
  if (!measures) return pb::Reply();
  if (measures->empty()) return Error{ErrorCode::kInvalidInput, name + " has nothing to measure"};
  const pb::Score score = newScore(id, *measures);
  const Status written = writer_.run([&](Connection& writer) -> Status {
    RETURN_IF_ERROR(checkAccess(writer, principal));
    RETURN_IF_ERROR(ScoreStore(writer).put(score));
    return AuditStore(writer).add({0, wallNowNs(), principal.name, "rescore", uuidText(id),
                                   fmt::format("definition version {}", score.definition_version())});
  });
  if (!written) return written.error();
  ASSIGN_OR_RETURN(auto kept, ScoreStore(*reader).get(id, score.definition_version()));
  pb::Reply reply;
  *reply.mutable_score() = std::move(kept);
  return reply;
}

void SessionScoring::forgetRecordings() {
  reference_paths_.forget();
  const std::scoped_lock lock(faults_mutex_);
  unreadable_.clear();
}

}  // namespace needlelab
