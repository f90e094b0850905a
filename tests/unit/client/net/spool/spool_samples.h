/// Samples for the tests of spool and uplink, and a session to put them in.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "client/net/spool/spool.h"
#include "common/base/text/uuid.h"
#include "common/gesture/sample.h"

namespace needlelab::test {

/// Returns the sample of tick k. Every value lies on the grid of the standard resolution, so storing does not
/// change it.
inline GestureSample sampleAt(std::uint64_t tick) {
  GestureSample sample;
  sample.tick = tick;
  sample.time_ns = 5'000'000'000 + static_cast<std::int64_t>(tick) * 1'000'000;
  const auto steps = static_cast<double>((tick * 7919) % 100'000);
  sample.p_WT_m[0] = steps * 1e-6;
  sample.p_WT_m[2] = -static_cast<double>(tick % 50) * 1e-6;
  sample.force_W_N[2] = static_cast<double>(tick % 3000) * 1e-3;
  sample.insertion_m = static_cast<double>(tick % 30) * 1e-6;
  sample.flags = static_cast<std::uint32_t>(tick % 4);
  sample.phase = static_cast<std::uint8_t>(tick % 3);
  sample.layer = static_cast<std::int8_t>(tick % 5 - 1);
  return sample;
}

inline std::vector<GestureSample> samplesFrom(std::uint64_t first, std::size_t count) {
  std::vector<GestureSample> samples;
  for (std::size_t i = 0; i < count; ++i) samples.push_back(sampleAt(first + i));
  return samples;
}

/// Returns true if a stored sample equals the sample of its tick to a thousandth of a step.
inline bool isSampleOfItsTick(const GestureSample& stored) {
  const GestureSample made = sampleAt(stored.tick);
  const auto near = [](double a, double b) { return std::abs(a - b) < 1e-9; };
  return stored.time_ns == made.time_ns && near(stored.p_WT_m[0], made.p_WT_m[0]) &&
         near(stored.p_WT_m[2], made.p_WT_m[2]) && near(stored.force_W_N[2], made.force_W_N[2]) &&
         near(stored.insertion_m, made.insertion_m) && stored.flags == made.flags &&
         stored.phase == made.phase && stored.layer == made.layer;
}

inline pb::SessionDescription describeSession(const Uuid& id) {
  pb::SessionDescription description;
  description.set_session_id(id.data(), id.size());
  description.set_station("station-1");
  description.set_trainee("tom");
  description.set_exercise_id("shoulder-first-injection");
  description.set_profile_id("shoulder");
  description.set_profile_json("{\"id\": \"shoulder\"}");
  description.set_engine_version("0.1.0");
  description.set_started_unix_ns(1'700'000'000'000'000'000);
  description.set_rate_hz(1000);
  setResolution(description, Resolution::standard());
  return description;
}

}  // namespace needlelab::test
