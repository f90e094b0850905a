// The end of a session: its hash, its state, its score.
#include <algorithm>
#include <vector>

#include "base/clock.h"
#include "db/annotation_store.h"
#include "db/curriculum_store.h"
#include "gesture/chunk.h"
#include "profile/profile.h"
#include "scoring/measures.h"
#include "service/handlers.h"
#include "service/service.h"

namespace needlelab {
namespace {

constexpr std::size_t kReadBytes = 4u << 20;

Pose poseOf(const google::protobuf::RepeatedField<double>& numbers) {
  Pose pose;
  if (numbers.size() != 7) return pose;
  pose.p = {numbers[0], numbers[1], numbers[2]};
  pose.q = {numbers[3], numbers[4], numbers[5], numbers[6]};
  return pose;
}

Result<std::vector<GestureSample>> allSamples(SessionStore& sessions, const Uuid& id,
                                              const pb::SessionInfo& info) {
  std::vector<GestureSample> samples;
  samples.reserve(info.samples());
  std::uint64_t next = 0;
  while (next < info.chunks()) {
    const auto chunks = sessions.readChunks(id, next, UINT32_MAX, kReadBytes);
    if (!chunks) return chunks.error();
    if (chunks->empty()) break;
    for (const StoredChunk& chunk : *chunks) {
      const auto decoded = decodeChunk(chunk.bytes);
      if (!decoded) return decoded.error();
      samples.insert(samples.end(), decoded->begin(), decoded->end());
    }
    next += chunks->size();
  }
  return samples;
}

// a session that lost samples says so wherever it is looked at: a remark beside it, in the same transaction
Status noteLoss(Connection& writer, const Uuid& id, const pb::CloseSession& request,
                const std::string& station) {
  StoredAnnotation remark;
  remark.session = id;
  remark.tick = std::min<std::uint64_t>(request.lost_from_tick(), INT64_MAX);
  remark.author = station.empty() ? "station" : "station " + station;
  remark.text = std::to_string(request.samples_lost()) + " samples from tick " +
                std::to_string(request.lost_from_tick()) +
                " on were lost at the station: its disk refused them for longer than its memory lasted";
  remark.created_unix_ns = wallNowNs();
  const auto added = AnnotationStore(writer).add(remark);
  return added ? Status() : Status(added.error());
}

}  // namespace

Result<std::string> Service::scoreSession(Connection& reader, const Uuid& session) {
  SessionStore sessions(reader);
  const auto info = sessions.info(session);
  if (!info) return info.error();
  if (info->samples() == 0) return std::string();
  if (info->samples() > kMaxScoredSamples) {
    return Error{ErrorCode::kInvalidInput, "session " + uuidText(session) + " has " +
                                               std::to_string(info->samples()) + " samples, at most " +
                                               std::to_string(kMaxScoredSamples) + " are scored"};
  }
  const auto& description = info->description();
  const auto profile = parseProfile(description.profile_json(), "profile of session " + uuidText(session));
  if (!profile) return profile.error();
  const auto samples = allSamples(sessions, session, *info);
  if (!samples) return samples.error();

  // requirements as they are now; a session of an exercise that is gone gets the plain measures
  std::optional<pb::Exercise> exercise;
  const auto stored = CurriculumStore(reader).exercise(description.exercise_id());
  if (stored) {
    auto parsed = parseExercise(stored->json, "exercise '" + stored->id + "'");
    if (!parsed) return parsed.error();
    exercise = std::move(*parsed);
  } else if (stored.error().code != ErrorCode::kNotFound) {
    return stored.error();
  }
  return scoreJson(scoreGesture(*samples, description.rate_hz(), *profile, poseOf(description.placement()),
                                exercise ? &*exercise : nullptr));
}

Result<CloseOutcome> Service::closeSession(const pb::CloseSession& request, const std::string& station) {
  auto reader = readers_.borrow();
  if (!reader) return reader.error();
  SessionStore sessions(**reader);

  // read and hash here, so that the writer's thread does not have to
  std::optional<HashedChunks> known;
  const auto id = handlers::sessionId(request.session_id());
  if (!id) return id.error();
  if (const auto next = sessions.nextSeq(*id); next && *next == request.chunks()) {
    const auto hashed = sessions.hashChunks(*id, request.chunks());
    if (!hashed) return hashed.error();
    known = *hashed;
  }
  CloseOutcome outcome;
  const auto status = writer_.run([&](Connection& writer) {
    auto closed = SessionStore(writer).close(request, wallNowNs(), station, known);
    if (!closed) return Status(closed.error());
    outcome.closed = std::move(*closed);
    if (outcome.closed.kind == Closed::Kind::kClosed && request.samples_lost() > 0)
      return noteLoss(writer, *id, request, station);
    return Status();
  });
  if (!status) return status.error();
  if (!outcome.closed.taken()) return outcome;

  // a repeated close answers with the score of the first
  if (const auto info = sessions.info(*id); info && !info->score_json().empty()) {
    outcome.score_json = info->score_json();
    return outcome;
  }
  auto score = scoreSession(**reader, *id);
  if (!score) {
    outcome.score_fault = score.error().message;
    return outcome;
  }
  if (score->empty()) return outcome;
  const auto stored =
      writer_.run([&](Connection& writer) { return SessionStore(writer).setScore(*id, *score); });
  if (!stored) return stored.error();
  outcome.score_json = std::move(*score);
  return outcome;
}

}  // namespace needlelab
