/// Aspirations and injections, computed from a recording alone: pure functions, no files, no clock.
///
/// A stroke is a movement of the plunger in one direction by at least `kMinStroke`. Drawing back is an
/// ASPIRATION, pressing is an INJECTION.
/// - The plunger is averaged over 10 ms, and a movement begins when it leaves a band of `kBand` around its
///   rest: trembling on the plunger is not a stroke. A movement that reverses by less than `kTurnBack`
///   continues.
/// - A rest of less than `kPause_s` does not end a stroke; movements slower than about `kBand` in that time
///   (2.5 min for the whole stroke) count as rest.
/// - A stroke begins when the plunger leaves one end and ends when it reaches the other, to within the 10 ms
///   and the time it needs for half a band.
/// - Missing ticks: the plunger's change during them counts as a movement between the neighbouring samples.
///
/// The place is the needle's opening: `openingBehindTip_m` (haptics/needle_spec.h) behind the tip along the
/// axis. It is in tissue when the engine reports the needle inserted and the opening itself is under the
/// surface; its layer is the layer at its depth.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/scoring/motion/recorded_samples.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

inline constexpr double kMinStroke = 0.02;  ///< share of the plunger's whole travel
inline constexpr double kBand = 0.002;      ///< movements within it count as rest; same unit
inline constexpr double kTurnBack = 0.01;   ///< a reversal by this share ends a stroke
inline constexpr double kPause_s = 0.3;
/// Maximum per recording: two strokes per second without rest over the 30 min at 1 kHz that are scored
/// (kMaxScoredSamples). A hand makes a few per lesson; a malicious recording with one every 10 ms would cost
/// the server a hundred times this.
inline constexpr std::size_t kMaxSyringeEvents = 3600;
/// Maximum total length of one event's hazard names: a needle is in a few hazards at once, with names of
/// about 20 bytes. The rest are replaced by a last name "and 12 more".
inline constexpr std::size_t kMaxEventHazardBytes = 512;

/// Returns the first kMaxSyringeEvents aspirations and injections, in order of time. Skips the samples that
/// `scoreGesture` skips; returns nothing outside 50-40,000 Hz. `X_WL`: pose of the profile's frame in W.
/// Thread: any.
std::vector<pb::SyringeEvent> syringeEvents(std::span<const GestureSample> samples, double rate_hz,
                                            const pb::Profile& profile, const Pose& X_WL);
/// The same for a recording that is decoded block by block; check samples.fault() afterwards.
std::vector<pb::SyringeEvent> syringeEvents(const RecordedSamples& samples, double rate_hz,
                                            const pb::Profile& profile, const Pose& X_WL);

/// syringeEvents for samples that are passed one by one, sharing a pass with other consumers. Thread: one at
/// a time.
class SyringeEventsInSteps {
 public:
  SyringeEventsInSteps() = default;
  SyringeEventsInSteps(const SyringeEventsInSteps&) = delete;
  SyringeEventsInSteps& operator=(const SyringeEventsInSteps&) = delete;
  virtual ~SyringeEventsInSteps() = default;

  /// Takes sample `i`. Call it once for each sample, in order.
  virtual void add(std::size_t i) = 0;
  /// After the last sample: reads the strokes' samples again. Returns true when done.
  virtual bool finish(StepWork& work) = 0;
  /// Call when done.
  virtual std::vector<pb::SyringeEvent> take() = 0;
};
/// `rate_hz`: 50-40,000. `samples` must outlive it.
std::unique_ptr<SyringeEventsInSteps> syringeEventsInSteps(const RecordedSamples& samples, double rate_hz,
                                                           const pb::Profile& profile, const Pose& X_WL);

/// Sets the events' layer_name, which databases do not store. `profile`: the session's.
void nameLayers(const pb::Profile& profile, std::span<pb::SyringeEvent> events);

/// Describes an event for people, e.g. "aspiration of 10 % at 12.3 s, 21 mm deep in bursa, 0.4 mm inside
/// subacromial bursa".
std::string eventText(const pb::SyringeEvent& event);
/// A JSON list of objects with the message's fields: "event" (kind), "begin_s", … and "words" (eventText).
/// Missing layers, targets and hazards are null.
std::string eventsJson(std::span<const pb::SyringeEvent> events);

}  // namespace needlelab
