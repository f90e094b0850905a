#include "db/service/scoring/session_samples.h"

#include <fmt/core.h>

#include <charconv>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"
#include "common/haptics/scene_spec.h"
#include "common/profile/profile.h"
#include "common/scoring/measures/syringe_events.h"
#include "common/scoring/motion/motion_cost.h"
#include "db/people/person_name.h"
#include "db/sessions/session_results.h"
#include "db/sessions/session_store.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

constexpr std::size_t kReadBytes = 4u << 20;
/// A chunk's fixed cost, in samples.
constexpr std::uint64_t kChunkAsSamples = 100;

const std::string kUnscoredText = "cannot be scored: ";

std::string unscoredKey(const Uuid& session) {
  return "unscored " + uuidText(session);
}

// 0.1 points per sample at 1 kHz: the limit is twice the motion of the longest session
static_assert(kMaxMotionPoints == 2 * kMaxScoredSamples / 10);

Result<std::vector<GestureSample>> samplesOfChunk(Connection& reader, const Uuid& id, std::uint64_t seq) {
  ASSIGN_OR_RETURN(const auto chunks, SessionStore(reader).readChunks(id, seq, 1, kReadBytes));
  if (chunks.empty())
    return Error{ErrorCode::kUnavailable,
                 fmt::format("session {}, chunk {} was removed while the session was read: try again",
                             uuidText(id), seq)};
  return decodeChunk(chunks.front().bytes);
}

/// One view for all chunks of a step: on PostgreSQL one per chunk would cost two more round trips each. In
/// SQLite a view costs nothing, and a long one keeps its log from being emptied.
Result<std::optional<Transaction>> viewOfStep(Connection& reader) {
  if (reader.sqlite() != nullptr) return std::optional<Transaction>();
  return Transaction::view(reader);
}

}  // namespace

Pose storedPlacement(const pb::SessionDescription& session) {
  const auto& numbers = session.placement();
  Pose X_WL;
  if (numbers.size() != 7) return X_WL;
  X_WL.p = {numbers[0], numbers[1], numbers[2]};
  X_WL.q = {numbers[3], numbers[4], numbers[5], numbers[6]};
  return X_WL;
}

Status SessionReading::begin(Connection& reader) {
  ASSIGN_OR_RETURN(all_.info, SessionStore(reader).info(session_));
  const pb::SessionInfo& info = all_.info;
  if (info.has_removed_original()) return originalRemoved(session_, info);
  if (info.samples() == 0) return {};
  if (info.samples() > kMaxScoredSamples) {
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("session {} has {} samples, at most {} are scored", uuidText(session_),
                             info.samples(), kMaxScoredSamples)};
  }
  if (const std::uint64_t most = kScoredChunksBesides + info.samples() / 500; info.chunks() > most) {
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("session {} has its {} samples in {} chunks, at most {} are scored",
                             uuidText(session_), info.samples(), info.chunks(), most)};
  }
  ASSIGN_OR_RETURN(all_.profile, parseProfile(info.description().profile_json(),
                                              "profile of session " + uuidText(session_)));
  all_.X_WL = storedPlacement(info.description());
  all_.samples = RecordedSamples::ofBlocks([read_by = reader_, session = session_](std::size_t seq) {
    return samplesOfChunk(**read_by, session, seq);
  });
  return {};
}

Result<bool> SessionReading::step(Connection& reader, StepWork& work) {
  readBy(reader);
  ASSIGN_OR_RETURN(const auto view, viewOfStep(reader));
  if (!has_begun_) RETURN_IF_ERROR(begin(reader));
  has_begun_ = true;
  if (all_.info.samples() == 0) return true;
  for (; chunks_ < all_.info.chunks(); ++chunks_) {
    if (work.isOver()) return false;
    ASSIGN_OR_RETURN(const std::size_t samples, all_.samples.addBlock());
    work.spend(kChunkAsSamples + samples);
  }
  if (!motion_) motion_.emplace(all_.samples, all_.info.description().rate_hz());
  const bool is_counted = motion_->step(work);
  RETURN_IF_ERROR(all_.samples.fault());
  if (!is_counted) return false;
  if (const Status motion = motion_->status(); !motion)
    return Error{motion.error().code, "session " + uuidText(session_) + ": " + motion.error().message};
  return true;
}

Result<SessionSamples> samplesOf(Connection& reader, const Uuid& session) {
  SessionReading reading(session);
  StepWork all = StepWork::all();
  RETURN_IF_ERROR(reading.step(reader, all));
  return std::move(reading.samples());
}

Error originalRemoved(const Uuid& session, const pb::SessionInfo& info) {
  return {ErrorCode::kInvalidInput,
          "session " + uuidText(session) + ": its original was removed (" + info.removed_original().reason() +
              "); scores and events are made from originals only, those stored stay"};
}

bool isLasting(const Error& error) {
  return error.code == ErrorCode::kInvalidInput || error.code == ErrorCode::kCorrupt;
}

std::vector<pb::SyringeEvent> eventsOf(const SessionSamples& session) {
  if (session.info.samples() == 0) return {};
  return syringeEvents(session.samples, session.info.description().rate_hz(), session.profile, session.X_WL);
}

Result<bool> SessionEvents::step(Connection& reader, StepWork& work) {
  SessionSamples& session = reading_.samples();
  if (!is_read_) {
    ASSIGN_OR_RETURN(is_read_, reading_.step(reader, work));
    if (!is_read_) return false;
    const double rate_hz = session.info.description().rate_hz();
    if (session.info.samples() == 0 || !(rate_hz >= kMinRateHz && rate_hz <= kMaxRateHz)) return true;
    events_ = syringeEventsInSteps(session.samples, rate_hz, session.profile, session.X_WL);
  }
  reading_.readBy(reader);
  for (; next_ < session.samples.size() && !work.isOver(); ++next_) {
    work.spend(1);
    events_->add(next_);
  }
  const bool is_done = next_ == session.samples.size() && events_->finish(work);
  RETURN_IF_ERROR(session.samples.fault());
  return is_done;
}

Result<std::optional<std::string>> whyNeverScored(Connection& reader, const Uuid& session) {
  ASSIGN_OR_RETURN(const auto number, MetaStore(reader).get(unscoredKey(session)));
  if (!number) return std::optional<std::string>();
  std::uint64_t id = 0;
  if (std::from_chars(number->data(), number->data() + number->size(), id).ec != std::errc())
    return std::optional<std::string>();
  ASSIGN_OR_RETURN(const auto text, AnnotationStore(reader).textOf(session, id));
  if (!text || !text->starts_with(kUnscoredText)) return std::optional<std::string>();
  return std::optional(text->substr(kUnscoredText.size()));
}

Status noteNeverScored(Connection& writer, const Uuid& session, const std::string& why) {
  StoredAnnotation remark;
  remark.session = session;
  remark.author = kServerName;
  remark.text = kUnscoredText + why;
  remark.created_unix_ns = wallNowNs();
  // a restored `meta` may lack its number
  ASSIGN_OR_RETURN(const auto same, AnnotationStore(writer).find(session, remark.author, remark.text));
  if (same) {
    remark.id = *same;
  } else {
    ASSIGN_OR_RETURN(remark.id, AnnotationStore(writer).add(remark));
  }
  return MetaStore(writer).set(unscoredKey(session), std::to_string(remark.id));
}

}  // namespace needlelab
