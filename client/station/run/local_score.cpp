#include "client/station/run/local_score.h"

#include <vector>

#include "common/gesture/chunk.h"
#include "common/scoring/measures.h"
#include "common/scoring/syringe_events.h"

namespace needlelab {
namespace {

constexpr std::uint64_t kMostSamples = 2'000'000;  // half an hour at 1 kHz, half a gigabyte

}  // namespace

Result<LocalScore> localScore(const SpoolSession& session, const StationLesson& lesson, const Pose& X_WL) {
  const SpoolContents contents = session.contents();
  if (contents.samples > kMostSamples)
    return Error{ErrorCode::kInvalidInput, "the session has " + std::to_string(contents.samples) +
                                               " samples, the station scores at most " +
                                               std::to_string(kMostSamples) + "; the server will"};
  std::vector<GestureSample> samples;
  samples.reserve(contents.samples);
  for (std::uint64_t seq = 0; seq < contents.chunks; ++seq) {
    auto chunk = session.readChunk(seq);
    if (!chunk.ok()) return chunk.error();
    auto some = decodeChunk(*chunk);
    if (!some.ok()) return some.error();
    samples.insert(samples.end(), some->begin(), some->end());
  }
  if (samples.empty()) return Error{ErrorCode::kNotFound, "nothing was recorded"};
  const auto measures = scoreGesture(samples, session.description().rate_hz(), lesson.profile, X_WL,
                                     lesson.exercise ? &*lesson.exercise : nullptr);
  const auto events = syringeEvents(samples, session.description().rate_hz(), lesson.profile, X_WL);
  return LocalScore{scoreJson(measures), eventsJson(events), gestureCurve(samples, lesson.model.limb)};
}

}  // namespace needlelab
