/// Aspirations and injections, from a recording alone: pure functions, no files, no clock.
///
/// A stroke is a movement of the plunger in one direction by at least `kLeastStroke`. Drawn back: ASPIRATION;
/// pressed: INJECTION.
/// - The plunger is averaged over 10 ms, and a movement shows when it leaves a band of `kBand` about its
/// rest: trembling on the plunger makes no stroke. A movement that goes back by less than `kTurnBack` goes
/// on.
/// - A rest of less than `kPause_s` does not end a stroke; movements slower than about `kBand` in that time
/// (2.5 min for the whole stroke) are not told from rest.
/// - Times are those at which the plunger left the one end of the stroke and came to the other, to within the
/// 10 ms and the time it needs for half a band.
/// - Ticks that are missing: what the plunger did meanwhile counts as a movement between the samples beside
/// them.
///
/// The place is that of the needle's opening: `openingBehindTip_m` (haptics/needle_spec.h) behind the tip
/// along the axis. It is in tissue where the engine took the needle for inserted and the opening itself is
/// under the surface; its layer is the one at its depth.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

inline constexpr double kLeastStroke = 0.02;  ///< of the whole way of the plunger
inline constexpr double kBand = 0.002;        ///< what is taken for rest
inline constexpr double kTurnBack = 0.01;     ///< what ends a stroke by turning it back
inline constexpr double kPause_s = 0.3;

/// Aspirations and injections in order of time. Samples that `scoreGesture` would pass over are passed over
/// here; outside 50-40,000 Hz there are none. `X_WL`: where the profile's frame stood in W. Thread: any.
std::vector<pb::SyringeEvent> syringeEvents(std::span<const GestureSample> samples, double rate_hz,
                                            const pb::Profile& profile, const Pose& X_WL);

/// For a person, e.g. "aspiration of 10 % at 12.3 s, 21 mm deep in BURSA, 0.4 mm inside subacromial bursa".
std::string eventText(const pb::SyringeEvent& event);
/// A JSON list of objects with the message's fields: "event" (kind), "begin_s", … and "words" (eventText).
/// Layers, targets and hazards that are not there are null.
std::string eventsJson(std::span<const pb::SyringeEvent> events);

}  // namespace needlelab
