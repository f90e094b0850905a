// Measures the cost of a retention run for the stations: the time from passing a chunk to the writer until
// its commit, with and without a concurrent run, in turns. Short form: two turns of half a second each way;
// NEEDLELAB_LONG=1: six of two.
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <mutex>
#include <random>
#include <thread>

#include "db/service/retention.h"
#include "tests/support/sanitized.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// About a second of a lively hand: some 10 kB.
Bytes livelyChunk(std::uint64_t first_tick, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  auto samples = test::someSamples(first_tick, 1000);
  for (GestureSample& sample : samples) {
    for (double& value : sample.p_WT_m) value += 1e-6 * static_cast<double>(random() % 256);
    for (double& value : sample.force_W_N) value += 1e-3 * static_cast<double>(random() % 64);
  }
  return encodeChunk(Resolution{}, samples);
}

class RetentionLoad : public test::ServiceTest {
 protected:
  static constexpr int kStations = 100;
  struct Times {
    std::mutex mutex;
    std::vector<double> ms;
    void add(const Times& other) { ms.insert(ms.end(), other.ms.begin(), other.ms.end()); }
    double at(double share) {
      std::sort(ms.begin(), ms.end());
      return ms.empty() ? 0
                        : ms[std::min(ms.size() - 1,
                                      static_cast<std::size_t>(share * static_cast<double>(ms.size())))];
    }
  };
  /// Sends chunks of all stations at 500 per second in an open loop: each time counts from the chunk's due
  /// time.
  void load(std::chrono::milliseconds time, Times& times) {
    const auto begin = Clock::now();
    std::atomic<int> left = 0;
    for (int i = 0; Clock::now() - begin < time; ++i) {
      const auto due = begin + i * 2ms;
      std::this_thread::sleep_until(due);
      const std::size_t s = static_cast<std::size_t>(i % kStations);
      const std::uint64_t seq = next_[s]++;
      ++left;
      const Status posted = store->writer().post(
          [&, s, seq](Connection& c) {
            const auto appended = SessionStore(c).append(open_[s], seq, chunk_);
            return appended ? Status() : Status(appended.error());
          },
          [&, due](const Status& status) {
            EXPECT_OK(status);
            {
              const std::lock_guard lock(times.mutex);
              times.ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - due).count());
            }
            // last: then all of this may be gone
            --left;
          });
      ASSERT_OK(posted);
    }
    while (left > 0) std::this_thread::sleep_for(1ms);
  }
  const Bytes chunk_ = livelyChunk(0, 1);
  std::vector<Uuid> open_;
  std::vector<std::uint64_t> next_ = std::vector<std::uint64_t>(kStations, 0);
};

TEST_F(RetentionLoad, stationsHardlyNotice) {
  const bool lengthy = std::getenv("NEEDLELAB_LONG") != nullptr;
  const int turns = lengthy ? 25 : 9;
  const auto each = lengthy ? 500ms : 120ms;
  addStation();
  for (int i = 0; i < kStations; ++i) open_.push_back(addSession("anna", 0));
  // old sessions, as many as no turn can finish
  constexpr std::uint64_t kOldChunks = 100;
  std::vector<Bytes> old;
  SessionHash hash;
  for (std::uint64_t seq = 0; seq < kOldChunks; ++seq) {
    old.push_back(livelyChunk(1000 * seq, seq));
    hash.update(old.back());
  }
  const Digest digest = hash.digest();
  for (int i = 0; i < (lengthy ? 60 : 12); ++i) {
    const Uuid id = addSession("anna", 0);
    ASSERT_OK(change([&](Connection& c) -> Status {
      SessionStore sessions(c);
      for (std::uint64_t seq = 0; seq < kOldChunks; ++seq) {
        if (auto appended = sessions.append(id, seq, old[seq]); !appended) return appended.error();
      }
      pb::CloseSession close;
      close.set_session_id(test::bytesOfId(id));
      close.set_chunks(kOldChunks);
      close.set_samples(1000 * kOldChunks);
      close.set_hash(digest.data(), digest.size());
      if (auto closed = sessions.close(close, 1, {}, HashedChunks{kOldChunks, 1000 * kOldChunks, digest});
          !closed)
        return closed.error();
      return sessions.markSafe(id, kOldChunks);
    }));
  }
  ASSERT_OK(change([](Connection& c) {
    pb::RetentionPolicy policy;
    policy.set_thin_after_days(1);
    policy.set_thin_rate_hz(100);
    policy.set_by("mia");
    return RetentionStore(c).setPolicy(policy);
  }));

  // per turn: a disk stall of one second affects one turn, but not the median
  Times alone, beside, slowest_alone, slowest_beside;
  std::uint64_t thinned = 0;
  bool due_left = true;
  for (int turn = 0; turn < turns; ++turn) {
    Times without, with;
    load(each, without);
    std::atomic<bool> stop = false;
    const RetentionTools tools{
        store->writer(), store->readers(), [](const Uuid&) { return Status(); }, [] { return false; }, stop,
        RetentionPace{}};
    std::thread run([&] {
      // as the server does
      EXPECT_EQ(::setpriority(PRIO_PROCESS, static_cast<id_t>(::syscall(SYS_gettid)), 10), 0);
      const auto report = runRetention(tools, "retention", 100LL * 86'400 * 1'000'000'000, false);
      EXPECT_OK(report);
      if (report) thinned += report->thinned();
      due_left = report.ok() && report->stopped();
    });
    load(each, with);
    stop = true;
    run.join();
    alone.add(without);
    beside.add(with);
    slowest_alone.ms.push_back(without.at(0.99));
    slowest_beside.ms.push_back(with.at(0.99));
  }
  EXPECT_TRUE(due_left) << "the run ended before the load: it was not beside it all the time";
  std::cout << "commit of a chunk, ms: alone p50 " << alone.at(0.5) << " p99 " << alone.at(0.99) << " max "
            << alone.at(1) << "; beside retention p50 " << beside.at(0.5) << " p99 " << beside.at(0.99)
            << " max " << beside.at(1) << "; " << thinned << " sessions of " << kOldChunks
            << " chunks thinned meanwhile\n";
  std::cout << "p99 of a turn, median of " << turns << ": alone " << slowest_alone.at(0.5) << ", beside "
            << slowest_beside.at(0.5) << " ms\n";
  // The ratios come from one run on a machine with other work: the goal is 2, the bound allows for a stall.
  if (!test::kSanitized) {
    EXPECT_LT(slowest_beside.at(0.5), (lengthy ? 2 : 3) * slowest_alone.at(0.5) + 50);
  }
}

}  // namespace
}  // namespace needlelab
