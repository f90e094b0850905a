#include "db/service/session_samples.h"

#include <fmt/core.h>

#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include "common/base/clock.h"
#include "common/gesture/chunk.h"
#include "common/profile/profile.h"
#include "common/scoring/motion_cost.h"
#include "common/scoring/syringe_events.h"
#include "db/people.h"
#include "db/schema.h"
#include "db/session_results.h"
#include "db/session_store.h"

namespace needlelab {
namespace {

constexpr std::size_t kReadBytes = 4u << 20;

const std::string kUnscoredText = "cannot be scored: ";

std::string unscoredKey(const Uuid& session) {
  return "unscored " + uuidText(session);
}

// 0.1 points a sample at 1 kHz: the longest session has room for twice its motion
static_assert(kMostMotionPoints == 2 * kMaxScoredSamples / 10);

Pose poseOf(const google::protobuf::RepeatedField<double>& numbers) {
  Pose pose;
  if (numbers.size() != 7) return pose;
  pose.p = {numbers[0], numbers[1], numbers[2]};
  pose.q = {numbers[3], numbers[4], numbers[5], numbers[6]};
  return pose;
}

Result<std::vector<GestureSample>> samplesOfChunk(Connection& reader, const Uuid& id, std::uint64_t seq) {
  ASSIGN_OR_RETURN(const auto chunks, SessionStore(reader).readChunks(id, seq, 1, kReadBytes));
  if (chunks.empty())
    return Error{ErrorCode::kUnavailable,
                 fmt::format("session {}, chunk {} was removed while the session was read: try again",
                             uuidText(id), seq)};
  return decodeChunk(chunks.front().bytes);
}

}  // namespace

Result<SessionSamples> samplesOf(Connection& reader, const Uuid& session) {
  SessionStore sessions(reader);
  ASSIGN_OR_RETURN(auto info, sessions.info(session));
  SessionSamples all{std::move(info), {}, {}, RecordedSamples(std::span<const GestureSample>())};
  if (all.info.has_removed_original()) {
    return Error{ErrorCode::kInvalidInput,
                 "session " + uuidText(session) + ": its original was removed (" +
                     all.info.removed_original().reason() +
                     "); scores and events are made from originals only, those stored stay"};
  }
  if (all.info.samples() == 0) return all;
  if (all.info.samples() > kMaxScoredSamples) {
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("session {} has {} samples, at most {} are scored", uuidText(session),
                             all.info.samples(), kMaxScoredSamples)};
  }
  if (const std::uint64_t most = kScoredChunksBesides + all.info.samples() / 500; all.info.chunks() > most) {
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("session {} has its {} samples in {} chunks, at most {} are scored",
                             uuidText(session), all.info.samples(), all.info.chunks(), most)};
  }
  ASSIGN_OR_RETURN(auto profile, parseProfile(all.info.description().profile_json(),
                                              "profile of session " + uuidText(session)));
  all.profile = std::move(profile);
  all.X_WL = poseOf(all.info.description().placement());
  ASSIGN_OR_RETURN(auto samples,
                   RecordedSamples::inBlocks(all.info.chunks(), [&reader, session](std::size_t seq) {
                     return samplesOfChunk(reader, session, seq);
                   }));
  all.samples = std::move(samples);
  const Status motion = checkMotion(all.samples, all.info.description().rate_hz());
  RETURN_IF_ERROR(all.samples.fault());
  if (!motion)
    return Error{motion.error().code, "session " + uuidText(session) + ": " + motion.error().message};
  return all;
}

bool isLasting(const Error& error) {
  return error.code == ErrorCode::kInvalidInput || error.code == ErrorCode::kCorrupt;
}

std::vector<pb::SyringeEvent> eventsOf(const SessionSamples& session) {
  if (session.info.samples() == 0) return {};
  return syringeEvents(session.samples, session.info.description().rate_hz(), session.profile, session.X_WL);
}

Result<std::optional<std::string>> whyNeverScored(Connection& reader, const Uuid& session) {
  ASSIGN_OR_RETURN(const auto number, MetaStore(reader).get(unscoredKey(session)));
  if (!number) return std::optional<std::string>();
  ASSIGN_OR_RETURN(const auto remarks, AnnotationStore(reader).list(session));
  for (const StoredAnnotation& remark : remarks) {
    if (std::to_string(remark.id) == *number && remark.text.starts_with(kUnscoredText))
      return std::optional(remark.text.substr(kUnscoredText.size()));
  }
  return std::optional<std::string>();
}

Status noteNeverScored(Connection& writer, const Uuid& session, const std::string& why) {
  StoredAnnotation remark;
  remark.session = session;
  remark.author = kServerName;
  remark.text = kUnscoredText + why;
  remark.created_unix_ns = wallNowNs();
  ASSIGN_OR_RETURN(const auto remarks, AnnotationStore(writer).list(session));
  // an older program wrote the same, and no number
  const auto same = std::find_if(remarks.begin(), remarks.end(), [&](const StoredAnnotation& one) {
    return one.author == remark.author && one.text == remark.text;
  });
  if (same != remarks.end()) {
    remark.id = same->id;
  } else {
    ASSIGN_OR_RETURN(remark.id, AnnotationStore(writer).add(remark));
  }
  return MetaStore(writer).set(unscoredKey(session), std::to_string(remark.id));
}

}  // namespace needlelab
