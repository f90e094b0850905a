#include <fmt/core.h>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>

#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"
#include "common/profile/profile.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/measures/syringe_events.h"
#include "db/people/look_alikes.h"
#include "db/service/context/long_work.h"
#include "db/service/requests/handlers.h"
#include "db/service/requests/lessons/profile_section.h"
#include "db/service/scoring/held_results.h"
#include "db/service/scoring/session_samples.h"
#include "db/service/scoring/session_scoring.h"
#include "db/sessions/session_results.h"
#include "db/sessions/session_store.h"
#include "db/sessions/unknown_trainees.h"
#include "db/store/connection.h"

namespace needlelab::handlers {
namespace {

void fill(pb::Annotation& annotation, const StoredAnnotation& stored) {
  annotation.set_id(stored.id);
  annotation.set_session_id(stored.session.data(), stored.session.size());
  annotation.set_tick(stored.tick);
  annotation.set_text(stored.text);
  annotation.set_author(stored.author);
  annotation.set_created_unix_ns(stored.created_unix_ns);
}

/// The last remark of the previous page, as "TICK.ID". Nothing: the first page. kInvalidInput.
Result<std::optional<AnnotationPlace>> placeOfPage(const std::string& page) {
  std::optional<AnnotationPlace> place;
  if (page.empty()) return place;
  place.emplace();
  const char* const end = page.data() + page.size();
  const auto tick = std::from_chars(page.data(), end, place->tick);
  if (tick.ec == std::errc() && tick.ptr != end && *tick.ptr == '.') {
    const auto id = std::from_chars(tick.ptr + 1, end, place->id);
    if (id.ec == std::errc() && id.ptr == end && place->tick <= INT64_MAX && place->id <= INT64_MAX)
      return place;
  }
  return Error{ErrorCode::kInvalidInput, "page: give back the next_page of the reply before"};
}

/// Replaces the whole score of several kilobytes with the main measures. An unreadable score gives no
/// measures, and the list continues.
void figuresForScore(pb::SessionInfo& session) {
  const auto measures = parseScore(session.score_json());
  session.clear_score_json();
  if (!measures) return;
  for (const std::string_view name : measuresIn(&MeasureKind::in_lists)) {
    const auto found = std::find_if(measures->begin(), measures->end(),
                                    [name](const Measure& measure) { return measure.name == name; });
    if (found == measures->end()) continue;
    pb::Figure& figure = *session.add_figures();
    figure.set_measure(found->name);
    if (found->measured) figure.set_value(found->value);
    figure.set_unit(found->unit);
  }
}

/// Notes that someone reads the samples of another person's session: who, which session, whose.
Status noteView(const Context& context, const pb::SessionInfo& info) {
  const std::string& trainee = info.description().trainee();
  if (context.who.role == pb::TRAINEE || trainee == context.who.name) return {};
  return noteRead(context, uuidText(*sessionId(info.description().session_id())),
                  "samples of '" + trainee + "'");
}

}  // namespace

Result<pb::SessionInfo> visibleSession(const Context& context, const std::string& bytes) {
  ASSIGN_OR_RETURN(const auto id, sessionId(bytes));
  auto info = SessionStore(context.reader).info(id);
  // a session that waits for a manager may belong to someone else who had this name
  if (info && context.who.role == pb::TRAINEE &&
      (info->description().trainee() != context.who.name || info->unknown_trainee())) {
    return Error{ErrorCode::kNotFound, "there is no session " + uuidText(id)};
  }
  if (info) RETURN_IF_ERROR(WithheldResults(context).leaveOutOf(*info));
  return info;
}

Result<pb::Reply> listSessions(const Context& context, const pb::ListSessions& call) {
  const bool own = context.who.role == pb::TRAINEE;
  if (own && !call.trainee().empty() && call.trainee() != context.who.name) {
    return Error{ErrorCode::kDenied, "a trainee sees own sessions only"};
  }
  std::optional<Uuid> after;
  if (!call.page().empty()) {
    const auto id = sessionId(call.page());
    if (!id) return Error{ErrorCode::kInvalidInput, "page: give back the next_page of the reply before"};
    after = *id;
  }
  pb::ListSessions wanted = call;
  if (own) wanted.set_trainee(context.who.name);
  PageRoom room;
  bool full = false;
  WithheldResults held(context);
  Status left_out;
  ASSIGN_OR_RETURN(auto sessions, SessionStore(context.reader)
                                      .list(
                                          wanted, after, own,
                                          [&](pb::SessionInfo& session) {
                                            left_out = held.leaveOutOf(session);
                                            figuresForScore(session);
                                            full = !room.take(session);
                                            return left_out.ok() && !full;
                                          },
                                          own ? context.now_unix_ns : 0));
  RETURN_IF_ERROR(left_out);
  if (sessions.empty() && !own) {
    RETURN_IF_ERROR(checkSpelling(context.reader, Thing::kStation, call.station()));
    RETURN_IF_ERROR(checkSpelling(context.reader, Thing::kExercise, call.exercise_id()));
  }
  // a page that is not full is the last one
  const std::uint32_t most = call.limit() == 0 ? kMaxListed : std::min(call.limit(), kMaxListed);
  pb::Reply reply;
  auto* list = reply.mutable_sessions();
  if (!sessions.empty() && (full || sessions.size() == most))
    list->set_next_page(sessions.back().description().session_id());
  for (pb::SessionInfo& session : sessions) *list->add_sessions() = std::move(session);
  return reply;
}

Result<pb::Reply> getSession(const Context& context, const pb::GetSession& call) {
  ASSIGN_OR_RETURN(auto info, visibleSession(context, call.session_id()));
  pb::Reply reply;
  *reply.mutable_session() = std::move(info);
  return reply;
}

Result<pb::Reply> assignSession(const Context& context, const pb::AssignSession& call) {
  ASSIGN_OR_RETURN(const auto id, sessionId(call.session_id()));
  RETURN_IF_ERROR(checkName("trainee", call.trainee()));
  RETURN_IF_ERROR(checkNote("reason", call.reason(), 0, kMaxNoteBytes));
  const auto seen = call.has_was() ? std::optional(call.was()) : std::nullopt;
  pb::Reply reply;
  std::string detail;
  RETURN_IF_ERROR(write(context, uuidText(id), detail, [&](Connection& writer) -> Status {
    ASSIGN_OR_RETURN(const auto was,
                     UnknownTraineeStore(writer).assign(
                         id, call.trainee(), seen, context.who.name, context.now_unix_ns,
                         call.has_started_unix_ns() ? std::optional(call.started_unix_ns()) : std::nullopt));
    detail = "from " + was + " to " + call.trainee() +
             (call.has_started_unix_ns() ? ", began " + utcTime(call.started_unix_ns()) : "") +
             (call.reason().empty() ? "" : ": " + call.reason());
    ASSIGN_OR_RETURN(*reply.mutable_session(), SessionStore(writer).info(id));
    return {};
  }));
  return reply;
}

Result<pb::Reply> readChunks(const Context& context, const pb::ReadChunks& call) {
  ASSIGN_OR_RETURN(const auto info, visibleSession(context, call.session_id()));
  RETURN_IF_ERROR(noteView(context, info));
  return readChunksUnnoted(context, call);
}

Result<pb::Reply> readChunksUnnoted(const Context& context, const pb::ReadChunks& call) {
  // one view, so that the session's row matches the chunks
  ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
  ASSIGN_OR_RETURN(const auto info, visibleSession(context, call.session_id()));
  RETURN_IF_ERROR(requireShown(info));
  constexpr std::uint32_t kMaxChunks = 4096;
  // texts about damaged chunks take space in the reply: read fewer chunks
  const std::uint32_t bound = call.skip_damaged() ? kMaxChunks / 16 : kMaxChunks;
  const std::uint32_t most = call.max_chunks() == 0 ? bound : std::min(call.max_chunks(), bound);
  // each chunk adds an envelope of 40 bytes, each damaged one a text
  constexpr std::size_t kMaxFaultText = 300;
  constexpr std::size_t kMostBytes = kMaxReplyBytes - kMaxChunks * 40;
  const auto id = sessionId(call.session_id());
  // return only the requested recording, never parts of two recordings of one session
  if (!call.hash().empty() && call.hash() != info.hash()) {
    return Error{
        ErrorCode::kUnavailable,
        "session " + uuidText(*id) + " was " +
            (info.removed_original().fate() == pb::RemovedOriginal::DELETED ? "deleted" : "thinned") +
            " while it was read: start again"};
  }
  ASSIGN_OR_RETURN(auto read,
                   SessionStore(context.reader).readAround(*id, call.from_seq(), most, kMostBytes));
  std::uint64_t next = read.next_seq;
  if (!call.skip_damaged() && !read.damaged.empty()) {
    next = read.damaged.front().seq;
    if (next == call.from_seq()) return Error{ErrorCode::kCorrupt, read.damaged.front().text};
  }
  pb::Reply reply;
  auto* list = reply.mutable_chunks();
  for (const StoredChunk& chunk : read.chunks) {
    if (chunk.seq >= next) break;
    auto* entry = list->add_chunks();
    entry->set_session_id(call.session_id());
    entry->set_seq(chunk.seq);
    entry->set_data(chunk.bytes.data(), chunk.bytes.size());
  }
  if (call.skip_damaged()) {
    for (const ChunkFault& fault : read.damaged) {
      auto* damaged = list->add_damaged();
      damaged->set_seq(fault.seq);
      damaged->set_text(fault.text.substr(0, kMaxFaultText));
    }
  }
  list->set_next_seq(next);
  list->set_end(next >= info.chunks());
  return reply;
}

Result<pb::Reply> seekSession(const Context& context, const pb::SeekSession& call) {
  RETURN_IF_ERROR(visibleSession(context, call.session_id()));
  SeekTo to;
  if (call.at_case() == pb::SeekSession::kTick) {
    to.tick = call.tick();
  } else if (call.at_case() == pb::SeekSession::kSeconds && std::abs(call.seconds()) <= 1e9) {
    to.seconds = call.seconds();
  } else {
    return Error{ErrorCode::kInvalidInput, "seek_session, at: give a tick, or seconds within 1e9"};
  }
  ASSIGN_OR_RETURN(const auto sought, SessionStore(context.reader).seek(*sessionId(call.session_id()), to));
  pb::Reply reply;
  auto* found = reply.mutable_sought();
  found->set_seq(sought.seq);
  found->set_first_tick(sought.first_tick);
  found->set_first_time_ns(sought.first_time_ns);
  found->set_recording_first_tick(sought.recording_first_tick);
  found->set_recording_first_time_ns(sought.recording_first_time_ns);
  found->set_chunks_read(sought.chunks_read);
  return reply;
}

Result<pb::Reply> verifySession(const Context& context, const pb::VerifySession& call) {
  ASSIGN_OR_RETURN(const auto id, sessionId(call.session_id()));
  const CancelScope may_end(context.reader, &context.parts.long_work.cancelled);
  RequestUnderWay& under_way = context.under_way;
  if (!under_way.check) under_way.check.emplace();
  ASSIGN_OR_RETURN(const auto check,
                   SessionStore(context.reader).verifyOn(id, kVerifiedBytesAtOnce, *under_way.check));
  pb::Reply reply;
  under_way.more = !check;
  if (under_way.more) return reply;
  auto* verified = reply.mutable_verified();
  verified->set_ok(check->ok);
  verified->set_chunks(check->chunks);
  verified->set_samples(check->samples);
  verified->set_hash(check->hash.data(), check->hash.size());
  verified->set_text(check->text);
  return reply;
}

Result<pb::Reply> annotate(const Context& context, const pb::Annotate& call) {
  ASSIGN_OR_RETURN(const auto id, sessionId(call.session_id()));
  StoredAnnotation annotation{0, id, call.tick(), call.text(), context.who.name, context.now_unix_ns};
  RETURN_IF_ERROR(write(context, uuidText(id), fmt::format("tick {}", call.tick()), [&](Connection& writer) {
    const auto added = AnnotationStore(writer).add(annotation);
    if (!added) return Status(added.error());
    annotation.id = *added;
    return Status();
  }));
  pb::Reply reply;
  fill(*reply.mutable_annotation(), annotation);
  return reply;
}

Result<pb::Reply> listAnnotations(const Context& context, const pb::ListAnnotations& call) {
  RETURN_IF_ERROR(visibleSession(context, call.session_id()));
  const auto id = sessionId(call.session_id());
  ASSIGN_OR_RETURN(const auto after, placeOfPage(call.page()));
  PageRoom room;
  bool full = false;
  ASSIGN_OR_RETURN(const auto annotations,
                   AnnotationStore(context.reader).list(*id, after, [&](const StoredAnnotation& annotation) {
                     full = !room.take(annotation.text.size() + kMaxNameBytes + 256);
                     return !full;
                   }));
  pb::Reply reply;
  auto* list = reply.mutable_annotations();
  for (const StoredAnnotation& annotation : annotations) fill(*list->add_annotations(), annotation);
  if (full && !annotations.empty())
    list->set_next_page(fmt::format("{}.{}", annotations.back().tick, annotations.back().id));
  return reply;
}

Result<pb::Reply> listEvents(const Context& context, const pb::ListEvents& call) {
  ASSIGN_OR_RETURN(const auto info, visibleSession(context, call.session_id()));
  const auto id = sessionId(call.session_id());
  if (info.state() == pb::SESSION_OPEN)
    return Error{ErrorCode::kUnavailable,
                 "session " + uuidText(*id) + " is still open: its events are worked out when it is closed"};
  RETURN_IF_ERROR(requireShown(info));
  ASSIGN_OR_RETURN(const auto from, numberOfPage(call.page()));
  auto stored = EventStore(context.reader).list(*id);
  if (!stored) return stored.error();
  pb::Reply reply;
  auto* list = reply.mutable_events();
  list->set_stored(stored->has_value());
  // a session that could not be scored when it was closed
  if (!*stored) {
    // a session with a score was read later, by a program with other limits
    if (info.score_json().empty()) {
      ASSIGN_OR_RETURN(const auto never, whyNeverScored(context.reader, *id));
      if (never) return Error{ErrorCode::kInvalidInput, *never};
    }
    // like a score: a long one in steps, which wait for their place
    RequestUnderWay& under_way = context.under_way;
    if (!under_way.is_long && info.samples() > kShortScoreSamples) {
      under_way.is_long = under_way.more = true;
      return reply;
    }
    if (!under_way.events) under_way.events = std::make_shared<SessionEvents>(*id);
    StepWork work = under_way.is_long ? StepWork(kScoredAtOnce) : StepWork::all();
    ASSIGN_OR_RETURN(const bool is_done, under_way.events->step(context.reader, work));
    under_way.more = !is_done;
    if (!is_done) return reply;
    *stored = under_way.events->take();
  } else if (const auto profile = parseProfile(info.description().profile_json(), "profile")) {
    nameLayers(*profile, **stored);
  }
  PageRoom room;
  for (std::uint64_t i = from; i < (*stored)->size(); ++i) {
    pb::SyringeEvent& event = (**stored)[i];
    if (!room.take(event)) {
      list->set_next_page(std::to_string(i));
      break;
    }
    *list->add_events() = std::move(event);
  }
  return reply;
}

namespace {

/// Where the needle first came into tissue, in the profile's frame; nothing: it never did. Damaged chunks are
/// left out.
Result<std::optional<NeedleEntry>> firstEntry(const Context& context, const Uuid& id,
                                              const pb::SessionInfo& info) {
  constexpr std::uint32_t kChunksAtOnce = 64;
  constexpr std::size_t kBytesAtOnce = std::size_t{1} << 20;
  const Pose X_LW = inverse(storedPlacement(info.description()));
  for (std::uint64_t seq = 0; seq < info.chunks();) {
    if (context.parts.long_work.cancelled.load(std::memory_order_relaxed))
      return Error{ErrorCode::kUnavailable, "the server ends"};
    ASSIGN_OR_RETURN(const auto read,
                     SessionStore(context.reader).readAround(id, seq, kChunksAtOnce, kBytesAtOnce));
    for (const StoredChunk& chunk : read.chunks) {
      const auto samples = decodeChunk(chunk.bytes);
      if (!samples) continue;
      for (const GestureSample& s : *samples) {
        if (s.layer < 0) continue;
        const Quat q_WT{s.q_WT[0], s.q_WT[1], s.q_WT[2], s.q_WT[3]};
        return std::optional(
            NeedleEntry{X_LW * Vec3{s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]}, rotate(X_LW.q, zAxis(q_WT))});
      }
    }
    if (read.next_seq <= seq) break;
    seq = read.next_seq;
  }
  return std::optional<NeedleEntry>();
}

}  // namespace

Result<pb::Reply> getSection(const Context& context, const pb::GetSection& call) {
  ASSIGN_OR_RETURN(const auto info, visibleSession(context, call.session_id()));
  RETURN_IF_ERROR(requireShown(info));
  const auto id = *sessionId(call.session_id());
  ASSIGN_OR_RETURN(const auto profile,
                   parseProfile(info.description().profile_json(), "profile of session " + uuidText(id)));
  if (!profile.has_volume())
    return Error{ErrorCode::kInvalidInput,
                 "profile of session " + uuidText(id) + ", volume: is missing: only a body can be cut"};
  ASSIGN_OR_RETURN(const auto needle, firstEntry(context, id, info));
  pb::Reply reply;
  RETURN_IF_ERROR(addSection(profile, *reply.mutable_section(), needle));
  return reply;
}

}  // namespace needlelab::handlers
