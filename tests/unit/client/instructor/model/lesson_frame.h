/// What an instructor's program receives from a running lesson.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "client/instructor/model/live/live_station.h"
#include "common/gesture/chunk.h"

namespace needlelab::test {

/// Returns a live frame of bench-1 with at most 20 samples from `first` on; it does not say when it was made.
inline LiveArrival lessonFrame(const pb::SessionInfo& info, const std::vector<GestureSample>& samples,
                               std::size_t first) {
  const auto rest = std::span(samples).subspan(first);
  const Bytes data = encodeChunk(Resolution::lossless(), rest.first(std::min<std::size_t>(20, rest.size())));
  LiveArrival arrival;
  arrival.frame.set_station("bench-1");
  arrival.frame.set_session_id(info.description().session_id());
  arrival.frame.set_frame_seq(first / 20);
  arrival.frame.set_data(data.data(), data.size());
  return arrival;
}

}  // namespace needlelab::test
