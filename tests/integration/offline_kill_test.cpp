// The station dies at any moment: only the last moment is missing, nothing before it, and the server gets the
// rest.
//
// The witness is the clock: a sample carries the time at which its tick was due, on the machine's monotonic
// clock, which this program also reads immediately before it kills the station. Samples due before that
// moment but not recovered are the loss, which this test reports: how long a machine keeps loop and writer
// from running is beyond their control. spool_writer_test asserts on a fake clock that a sample waits at most
// 14 ms for the tail.
#include <gmock/gmock.h>
#include <random>

#include "common/base/program.h"
#include "common/base/time/clock.h"
#include "tests/integration/lab.h"
#include "tests/support/run_form.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

struct Kill {
  std::string session_id;
  std::int64_t killed_ns = 0;
  std::vector<GestureSample> recovered;
  std::vector<std::string> chunks;
};

class OfflineKillTest : public testing::Test {
 protected:
  // the state that the next start would find, from a copy of the spool after the kill
  void recover(Kill& kill, int round) const {
    const auto copy = lab_.path("copy" + std::to_string(round));
    std::filesystem::create_directory(copy);
    std::filesystem::copy(lab_.path("spool") / kill.session_id, copy / kill.session_id,
                          std::filesystem::copy_options::recursive);
    auto spool = Spool::open(copy);
    ASSERT_TRUE(spool.ok()) << spool.error().message;
    const auto sessions = (*spool)->unfinished();
    ASSERT_EQ(sessions.size(), 1u);
    const SpoolContents contents = sessions[0]->contents();
    EXPECT_TRUE(contents.interrupted);
    EXPECT_EQ(contents.loss.samples, 0u);
    for (std::uint64_t seq = 0; seq < contents.chunks; ++seq) {
      const Bytes chunk = *sessions[0]->readChunk(seq);
      const auto samples = decodeChunk(chunk);
      ASSERT_TRUE(samples.ok());
      kill.recovered.insert(kill.recovered.end(), samples->begin(), samples->end());
      kill.chunks.emplace_back(textOf(chunk));
    }
    std::filesystem::remove_all(copy);
  }
  // the new session's folder
  std::string newSession(const std::vector<std::string>& before) const {
    std::error_code error;
    for (auto at = std::filesystem::directory_iterator(lab_.path("spool"), error);
         !error && at != std::filesystem::end(at); at.increment(error)) {
      const std::string name = at->path().filename().string();
      if (parseUuid(name).ok() && std::find(before.begin(), before.end(), name) == before.end()) return name;
    }
    return {};
  }
  Lab lab_;
};

TEST_F(OfflineKillTest, atAnyInstantOnlyTheLastMomentIsMissing) {
  const bool is_long = longForm();
  const int rounds = is_long ? 200 : 8;
  const auto first_seed = static_cast<std::uint32_t>(seedOr(20'261'120));
  lab_.startServer();
  std::vector<Kill> kills;
  std::vector<std::string> known;
  std::vector<std::int64_t> missing_ns;
  std::uint64_t missed = 0;
  for (int round = 0; round < rounds; ++round) {
    const auto seed = first_seed + static_cast<std::uint32_t>(round);
    SCOPED_TRACE("replay with NEEDLELAB_SEED=" + std::to_string(seed));
    std::mt19937 random(seed);
    auto station = lab_.startStation("station", {"--exercise", "ball-free-practice", "--hand-repeat", "0"});
    Kill kill;
    ASSERT_TRUE(eventually([&] {
      kill.session_id = newSession(known);
      // until the loop runs: the first samples are in the tail
      std::error_code error;
      return !kill.session_id.empty() &&
             std::filesystem::file_size(lab_.path("spool") / kill.session_id / "tail", error) > 0 && !error;
    })) << station->said();
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 2'300'000));
    kill.killed_ns = steadyNowNs();
    station->signal(SIGKILL);
    ASSERT_EQ(station->wait(), -SIGKILL);
    known.push_back(kill.session_id);
    ASSERT_NO_FATAL_FAILURE(recover(kill, round));

    ASSERT_FALSE(kill.recovered.empty());
    std::uint64_t gaps = kill.recovered.front().tick;
    for (std::size_t i = 1; i < kill.recovered.size(); ++i) {
      ASSERT_GT(kill.recovered[i].tick, kill.recovered[i - 1].tick);
      gaps += kill.recovered[i].tick - kill.recovered[i - 1].tick - 1;
    }
    // A gap, also before the first sample, is a tick that the loop missed on a busy machine, not a loss in
    // the spool: every chunk except the last has its 1000 samples, the tail's pieces are numbered, and `loss`
    // (above) has the samples that the writer itself gave up.
    missed += gaps;
    for (std::size_t seq = 0; seq + 1 < kill.chunks.size(); ++seq)
      ASSERT_EQ(inspectChunk(viewOf(kill.chunks[seq]))->count, 1000u);
    missing_ns.push_back(kill.killed_ns - kill.recovered.back().time_ns);
    EXPECT_GE(missing_ns.back(), 0) << "a sample from after the kill, round " << round;
    kills.push_back(std::move(kill));
  }

  // and the server gets exactly the recovered samples
  auto last =
      lab_.startStation("last", {"--exercise", "ball-free-practice", "--seconds", "0.3", "--drain", "60"});
  ASSERT_EQ(last->wait(), kExitDone) << last->said();
  EXPECT_EQ(lab_.summary("last")["spool_left"], 0);
  EXPECT_EQ(lab_.sessions().size(), kills.size() + 1) << "nothing doubled";
  for (const Kill& kill : kills) {
    const StoredSession stored = lab_.stored(kill.session_id);
    EXPECT_EQ(stored.info.state(), pb::SESSION_INTERRUPTED);
    EXPECT_EQ(stored.chunks, kill.chunks) << kill.session_id;
    EXPECT_TRUE(lab_.verifies(kill.session_id));
  }

  std::sort(missing_ns.begin(), missing_ns.end());
  const auto ms = [](std::int64_t ns) { return 1e-6 * static_cast<double>(ns); };
  std::printf(
      "%d kills, seeds %u ... %u: missing before the kill: median %.1f ms, most %.1f ms; the loop missed "
      "%llu ticks in all\n",
      rounds, first_seed, first_seed + static_cast<std::uint32_t>(rounds) - 1,
      ms(missing_ns[missing_ns.size() / 2]), ms(missing_ns.back()), static_cast<unsigned long long>(missed));
  RecordProperty("most_missing_ms", std::to_string(ms(missing_ns.back())));
}

}  // namespace
}  // namespace needlelab::test
