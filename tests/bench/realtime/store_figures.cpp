#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <span>
#include <thread>

#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"
#include "db/login/credentials.h"
#include "db/service/records/retention.h"
#include "db/sessions/session_store.h"
#include "db/store/schema.h"
#include "tests/bench/realtime/figures.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

constexpr std::uint64_t kChunks = 60;  ///< of a second
constexpr auto kBetweenChunks = 5ms;   ///< two hundred stations

pb::SessionDescription describe(const Uuid& id) {
  pb::SessionDescription d;
  d.set_session_id(std::string(id.begin(), id.end()));
  d.set_station("station-1");
  d.set_trainee("anna");
  d.set_exercise_id("knee-1");
  d.set_profile_id("knee-adult");
  d.set_profile_json("{}");
  d.set_engine_version("bench");
  d.set_rate_hz(1000);
  d.set_started_unix_ns(1'700'000'000'000'000'000);
  d.mutable_resolution()->set_length_m(Resolution::standard().length_m);
  return d;
}

std::vector<Bytes> minuteOfChunks() {
  // a slow stroke with tremor and noise, so that a chunk is as large as a recorded one
  std::mt19937_64 random(7);
  std::vector<GestureSample> samples(1000 * kChunks);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double t = 1e-3 * static_cast<double>(i);
    const auto noise = [&] { return 1e-6 * static_cast<double>(random() % 5); };
    GestureSample& s = samples[i];
    s.tick = i;
    s.time_ns = static_cast<std::int64_t>(i) * 1'000'000 + static_cast<std::int64_t>(random() % 20'000);
    s.p_WT_m[0] = 2e-4 * std::sin(50 * t) + noise();
    s.p_WT_m[1] = 0.02 * std::sin(0.7 * t) + noise();
    s.p_WT_m[2] = 0.03 * std::sin(2 * t) + noise();
    s.force_W_N[2] = std::max(0.0, 3 * std::sin(2 * t));
  }
  std::vector<Bytes> chunks;
  for (std::size_t at = 0; at < samples.size(); at += 1000)
    chunks.push_back(encodeChunk(Resolution::standard(), std::span(samples).subspan(at, 1000)));
  return chunks;
}

// with recordings of a minute that are due
Status fill(Connection& writer, const std::vector<Bytes>& chunks, std::size_t recordings) {
  RETURN_IF_ERROR(migrate(writer));
  RETURN_IF_ERROR(writer.script("BEGIN"));
  RETURN_IF_ERROR(StationStore(writer).add("station-1", StationKeyBytes{}, 1));
  SessionHash hash;
  for (const Bytes& chunk : chunks) hash.update(chunk);
  const Digest digest = hash.digest();
  SessionStore sessions(writer);
  for (std::size_t i = 0; i < recordings; ++i) {
    const Uuid id = makeUuidV7();
    RETURN_IF_ERROR(sessions.open(describe(id), 1));
    for (std::uint64_t seq = 0; seq < chunks.size(); ++seq)
      if (auto appended = sessions.append(id, seq, chunks[seq]); !appended.ok()) return appended.error();
    pb::CloseSession close;
    close.set_session_id(std::string(id.begin(), id.end()));
    close.set_chunks(chunks.size());
    close.set_samples(1000 * chunks.size());
    close.set_hash(digest.data(), digest.size());
    if (auto closed = sessions.close(close, 1); !closed.ok()) return closed.error();
    RETURN_IF_ERROR(sessions.markSafe(id, chunks.size()));
  }
  pb::RetentionPolicy policy;
  policy.set_thin_after_days(1);
  policy.set_thin_rate_hz(100);
  policy.set_by("bench");
  RETURN_IF_ERROR(RetentionStore(writer).setPolicy(policy));
  return writer.script("COMMIT");
}

/// A chunk each kBetweenChunks, until `over`. From posting to the commit.
class Stations {
 public:
  Stations(DbWriter& writer, const Uuid& session, const std::vector<Bytes>& chunks)
      : writer_(writer), session_(session), chunks_(chunks) {}
  Status stream(const std::function<bool()>& over, LatencyHistogram& commit) {
    auto due = std::chrono::steady_clock::now();
    while (!over()) {
      const Bytes& bytes = chunks_[next_ % chunks_.size()];
      const std::int64_t posted_ns = steadyNowNs();
      ++under_way_;
      RETURN_IF_ERROR(writer_.post(
          [this, &bytes, seq = next_++](Connection& connection) -> Status {
            auto appended = SessionStore(connection).append(session_, seq, bytes, "station-1");
            if (!appended.ok()) return appended.error();
            return {};
          },
          [this, &commit, posted_ns](const Status& status) {
            if (status.ok()) commit.add(steadyNowNs() - posted_ns);  // on the writer's thread only
            --under_way_;
          }));
      std::this_thread::sleep_until(due += kBetweenChunks);
    }
    while (under_way_ > 0) std::this_thread::sleep_for(1ms);
    return {};
  }

 private:
  DbWriter& writer_;
  const Uuid session_;
  const std::vector<Bytes>& chunks_;
  std::uint64_t next_ = 0;
  std::atomic<int> under_way_{0};
};

}  // namespace

Status addRetention(Figures& figures, double seconds) {
  const std::size_t recordings = seconds < 1 ? 2 : 20;
  const TempFolder folder;
  const auto path = folder.path() / "needlelab.db";
  const auto chunks = minuteOfChunks();
  const Uuid running = makeUuidV7();
  {
    auto made = Connection::open(path, {.mode = Connection::Mode::kWriter, .create = true});
    if (!made.ok()) return made.error();
    RETURN_IF_ERROR(fill(*made, chunks, recordings));
    RETURN_IF_ERROR(SessionStore(*made).open(describe(running), 1));
  }
  auto connection = Connection::open(path, {.mode = Connection::Mode::kWriter});
  if (!connection.ok()) return connection.error();
  DbWriter writer(std::move(*connection), {}, {});
  ReaderPool readers(path);
  Stations stations(writer, running, chunks);

  LatencyHistogram alone, beside;
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  RETURN_IF_ERROR(stations.stream([end] { return std::chrono::steady_clock::now() >= end; }, alone));

  std::atomic<bool> stop{false}, done{false};
  const RetentionTools tools{writer, readers, [](const Uuid&) { return Status{}; }, [] { return false; },
                             stop,   {}};
  std::optional<Result<pb::RetentionReport>> report;
  double took_s = 0;
  std::thread retention([&] {
    Stopwatch watch;
    report = runRetention(tools, {"bench"}, wallNowNs(), false);
    took_s = watch.lap();
    done = true;
  });
  const Status streamed = stations.stream([&] { return done.load(); }, beside);
  stop = true;
  retention.join();
  RETURN_IF_ERROR(streamed);
  if (!report->ok()) return report->error();
  if ((*report)->thinned() != recordings)
    return Error{ErrorCode::kFailed, "retention thinned " + std::to_string((*report)->thinned()) +
                                         " recordings of " + std::to_string(recordings)};
  addQuantiles(figures, "store: commit of a chunk", alone);
  addQuantiles(figures, "store: commit of a chunk beside retention", beside);
  figures.push_back(
      {"store: retention of a recorded minute", "ms", 1e3 * took_s / static_cast<double>(recordings)});
  return {};
}

}  // namespace needlelab::test
