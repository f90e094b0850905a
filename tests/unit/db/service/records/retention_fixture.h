/// Shared by the retention tests: closed sessions with a known gesture, runs and policies by request, and the
/// expected contents of a thinned recording.
#pragma once

#include <vector>

#include "common/gesture/thinning.h"
#include "db/service/records/retention.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab::test {

inline constexpr std::uint64_t kClosedChunks = 60;
inline constexpr std::size_t kSamplesEach = 50;

/// Computes the expected thinned recording of the chunks of chunkOf() from the stored samples.
inline std::vector<GestureSample> expectedThinned(std::uint64_t chunks, double target_hz) {
  Thinner thinner(1000, target_hz);
  std::vector<GestureSample> out;
  for (std::uint64_t seq = 0; seq < chunks; ++seq) {
    const auto samples = decodeChunk(chunkOf(seq, kSamplesEach));
    for (const GestureSample& sample : *samples) thinner.add(sample, out);
  }
  thinner.finish(out);
  return out;
}

inline std::vector<GestureSample> samplesIn(Connection& connection, const Uuid& id) {
  std::vector<GestureSample> all;
  const auto chunks = SessionStore(connection).readChunks(id, 0, UINT32_MAX, SIZE_MAX);
  EXPECT_OK(chunks);
  if (!chunks) return all;
  for (const StoredChunk& chunk : *chunks) {
    const auto samples = decodeChunk(chunk.bytes);
    all.insert(all.end(), samples->begin(), samples->end());
  }
  return all;
}

/// Compares with the prediction: values within half a step, ticks and times exactly.
inline void expectSame(const std::vector<GestureSample>& found, const std::vector<GestureSample>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    ASSERT_EQ(found[i].tick, expected[i].tick);
    ASSERT_EQ(found[i].time_ns, expected[i].time_ns);
    ASSERT_NEAR(found[i].p_WT_m[0], expected[i].p_WT_m[0], 0.51e-6);
    ASSERT_NEAR(found[i].force_W_N[2], expected[i].force_W_N[2], 0.51e-3);
  }
}

class RetentionTest : public ServiceTest {
 protected:
  void SetUp() override {
    addStation();
    store->service().setRetentionPace({.rows = 16, .bytes = 8 << 10, .pause = std::chrono::milliseconds(0)});
  }
  Uuid addClosed(std::uint64_t chunks = kClosedChunks, bool safe = true, const std::string& profile = "") {
    const Uuid id = addSession("anna", chunks, kSamplesEach, profile);
    EXPECT_OK(store->service().scoring().closeSession(closeOf(id, chunks, kSamplesEach), "station-1"));
    if (safe) EXPECT_OK(change([&](Connection& c) { return SessionStore(c).markSafe(id, chunks); }));
    return id;
  }
  pb::Request policy(int thin_days, double hz, int delete_days, const std::string& exercise = "") {
    pb::Request request;
    auto* p = request.mutable_set_retention()->mutable_policy();
    p->set_exercise_id(exercise);
    if (thin_days >= 0) {
      p->set_thin_after_days(static_cast<std::uint32_t>(thin_days));
      p->set_thin_rate_hz(hz);
    }
    if (delete_days >= 0) p->set_delete_after_days(static_cast<std::uint32_t>(delete_days));
    return request;
  }
  pb::RetentionReport runNow(bool dry = false) {
    pb::Request request;
    request.mutable_run_retention()->set_dry_run(dry);
    return get(manager, request).retention_report();
  }
  pb::SessionInfo info(const Uuid& id) {
    pb::Request request;
    request.mutable_get_session()->set_session_id(bytesOfId(id));
    return get(instructor, request).session();
  }
  bool sound() {
    pb::Request request;
    request.mutable_check();
    const auto report = get(admin, request).check_report();
    for (const auto& fault : report.faults()) ADD_FAILURE() << fault;
    return report.ok();
  }
};

}  // namespace needlelab::test
