#include "tests/load/server/database_check.h"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <thread>
#include <utility>

#include "common/gesture/chunk.h"

namespace needlelab::test {
namespace {

// half a step, plus the rounding of a double in a value of up to a metre
bool near(double made, double stored, double step) {
  if (std::isnan(made) || std::isnan(stored)) return std::isnan(made) && std::isnan(stored);
  return std::abs(made - stored) <= 0.5 * step + 1e-12;
}

template <std::size_t N>
bool near(const double (&made)[N], const double (&stored)[N], double step) {
  for (std::size_t i = 0; i < N; ++i)
    if (!near(made[i], stored[i], step)) return false;
  return true;
}

constexpr std::size_t kMostFaults = 20;

void addFault(DatabaseCheck& check, const std::string& what) {
  if (check.faults.size() < kMostFaults) check.faults.push_back(what);
}

void addTo(DatabaseCheck& all, const DatabaseCheck& one) {
  all.samples.add(one.samples);
  all.sessions += one.sessions;
  all.not_complete += one.not_complete;
  all.stray += one.stray;
  all.chunk_bytes += one.chunk_bytes;
  for (const std::string& fault : one.faults) addFault(all, fault);
}

// the chunks of one session, in stored order
class SessionReading {
 public:
  SessionReading(const LoadShared& shared, std::size_t station, std::uint64_t ticks)
      : name_(shared.stations[station].name),
        comparison_(StationStream(*shared.pool, shared.seed, station), ticks, name_) {}

  void take(std::uint64_t seq, ByteView bytes) {
    check_.chunk_bytes += bytes.size();
    if (seq != next_seq_)
      addFault(check_, fmt::format("{}: chunk {} stands where {} should", name_, seq, next_seq_));
    next_seq_ = seq + 1;
    const auto samples = decodeChunk(bytes);
    if (!samples.ok()) {
      addFault(check_, fmt::format("{}: chunk {}: {}", name_, seq, samples.error().message));
      return;
    }
    comparison_.take(*samples);
  }
  DatabaseCheck finish(bool found, int state) {
    check_.sessions += found ? 1 : 0;
    if (found && state != pb::SESSION_COMPLETE) {
      ++check_.not_complete;
      addFault(check_, name_ + ": the session is " + pb::SessionState_Name(state));
    }
    check_.samples = comparison_.finish();
    if (!check_.samples.first.empty()) addFault(check_, check_.samples.first);
    return std::move(check_);
  }

 private:
  std::string name_;
  SessionComparison comparison_;
  DatabaseCheck check_;
  std::uint64_t next_seq_ = 0;
};

Result<DatabaseCheck> readSession(Connection& connection, const LoadShared& shared, std::size_t station,
                                  std::uint64_t ticks) {
  SessionReading reading(shared, station, ticks);
  auto session = connection.query("SELECT number, state FROM sessions WHERE id = ?",
                                  ByteView(shared.stations[station].session));
  ASSIGN_OR_RETURN(const auto found, session.step());
  if (!found) return reading.finish(false, 0);
  const std::int64_t number = session.integer(0);
  const auto state = static_cast<int>(session.integer(1));
  auto chunk = connection.query("SELECT seq, bytes FROM chunks WHERE session = ? ORDER BY seq", number);
  for (;;) {
    ASSIGN_OR_RETURN(const auto row, chunk.step());
    if (!row) break;
    reading.take(static_cast<std::uint64_t>(chunk.integer(0)), chunk.bytes(1));
  }
  return reading.finish(true, state);
}

Result<std::uint64_t> countOf(Connection& connection, const char* sql) {
  auto query = connection.query(sql);
  RETURN_IF_ERROR(query.step());
  return static_cast<std::uint64_t>(query.integer(0));
}

}  // namespace

void Difference::add(const Difference& other) {
  stored += other.stored;
  lost += other.lost;
  duplicated += other.duplicated;
  different += other.different;
  foreign += other.foreign;
  if (first.empty()) first = other.first;
}

const char* differingField(const GestureSample& made, const GestureSample& stored,
                           const Resolution& resolution) {
  const double step_ns = resolution.time_s * 1e9;
  if (made.tick != stored.tick) return "tick";
  if (made.time_ns != stored.time_ns) return "time_ns";
  if (!near(made.p_WT_m, stored.p_WT_m, resolution.length_m)) return "p_WT_m";
  if (!near(made.q_WT, stored.q_WT, resolution.quaternion)) return "q_WT";
  if (!near(made.speed_mps, stored.speed_mps, resolution.speed_mps)) return "speed_mps";
  if (!near(made.force_W_N, stored.force_W_N, resolution.force_N)) return "force_W_N";
  if (!near(made.torque_W_Nm, stored.torque_W_Nm, resolution.torque_Nm)) return "torque_W_Nm";
  if (!near(made.wall_W_m, stored.wall_W_m, resolution.length_m)) return "wall_W_m";
  if (!near(made.insertion_m, stored.insertion_m, resolution.length_m)) return "insertion_m";
  if (!near(made.lateral_error_m, stored.lateral_error_m, resolution.length_m)) return "lateral_error_m";
  if (!near(made.plunger, stored.plunger, resolution.quaternion)) return "plunger";
  if (!near(made.device_ns, stored.device_ns, step_ns)) return "device_ns";
  if (!near(made.engine_ns, stored.engine_ns, step_ns)) return "engine_ns";
  if (made.flags != stored.flags) return "flags";
  if (made.buttons != stored.buttons) return "buttons";
  if (made.layer != stored.layer) return "layer";
  if (made.phase != stored.phase) return "phase";
  if (made.fault != stored.fault) return "fault";
  return nullptr;
}

SessionComparison::SessionComparison(StationStream stream, std::uint64_t ticks, std::string name)
    : stream_(std::move(stream)), name_(std::move(name)), seen_(ticks) {}

void SessionComparison::fault(const std::string& what) {
  if (difference_.first.empty()) difference_.first = name_ + ": " + what;
}

void SessionComparison::take(std::span<const GestureSample> stored) {
  for (std::size_t i = 0; i < stored.size();) {
    ++difference_.stored;
    if (stored[i].tick >= seen_.size()) {
      ++difference_.foreign;
      fault(fmt::format("tick {} is stored and was never generated", stored[i].tick));
      ++i;
      continue;
    }
    // a run of consecutive ticks is generated at once
    std::size_t end = i + 1;
    while (end < stored.size() && stored[end].tick == stored[end - 1].tick + 1 &&
           stored[end].tick < seen_.size())
      ++end;
    made_.resize(end - i);
    stream_.fill(stored[i].tick, made_);
    difference_.stored += end - i - 1;
    for (std::size_t k = i; k < end; ++k) takeOne(made_[k - i], stored[k]);
    i = end;
  }
}

void SessionComparison::takeOne(const GestureSample& made, const GestureSample& stored) {
  const auto tick = [&] { return fmt::format("tick {}", stored.tick); };
  if (stored.time_ns != made.time_ns) {
    ++difference_.foreign;
    fault(fmt::format("{} is stored with the time of another station or session: {}, not {}", tick(),
                      stored.time_ns, made.time_ns));
    return;
  }
  if (seen_[stored.tick]) {
    ++difference_.duplicated;
    fault(tick() + " is stored twice");
    return;
  }
  seen_[stored.tick] = true;
  if (const char* field = differingField(made, stored, Resolution::standard()); field != nullptr) {
    ++difference_.different;
    fault(tick() + " is stored with another " + field);
  }
}

Difference SessionComparison::finish() {
  for (std::size_t tick = 0; tick < seen_.size(); ++tick) {
    if (seen_[tick]) continue;
    ++difference_.lost;
    fault(fmt::format("tick {} is not stored", tick));
  }
  return difference_;
}

Result<DatabaseCheck> checkDatabase(const StoreAddress& database, const LoadShared& shared,
                                    const MadeTicks& ticks, const CheckProgress& progress) {
  DatabaseCheck all;
  std::mutex mutex;
  std::optional<Error> error;
  std::atomic<std::size_t> next{0};
  std::size_t done = 0;
  const auto work = [&] {
    auto connection = openAt(database, Connection::Mode::kReader);
    for (std::size_t i = next++; i < shared.stations.size(); i = next++) {
      auto one = connection.ok() ? readSession(*connection, shared, i, ticks[i])
                                 : Result<DatabaseCheck>(connection.error());
      const std::scoped_lock lock(mutex);
      if (!one.ok()) {
        error = one.error();
        return;
      }
      addTo(all, *one);
      if (progress) progress(++done);
    }
  };
  std::thread other(work);
  work();
  other.join();
  if (error) return *error;

  // rows of stations outside this run: the database was new
  auto connection = openAt(database, Connection::Mode::kReader);
  if (!connection.ok()) return connection.error();
  ASSIGN_OR_RETURN(auto sessions, countOf(*connection, "SELECT count(*) FROM sessions"));
  auto orphans =
      countOf(*connection, "SELECT count(*) FROM chunks WHERE session NOT IN (SELECT number FROM sessions)");
  if (!orphans.ok()) return orphans.error();
  all.stray = sessions - all.sessions + *orphans;
  if (all.stray > 0)
    addFault(all, fmt::format("{} sessions or chunks are stored that no station made", all.stray));
  return all;
}

Result<DatabaseCheck> checkThroughServer(BlockingClient& client, const LoadShared& shared,
                                         const MadeTicks& ticks, const CheckProgress& progress) {
  DatabaseCheck all;
  for (std::size_t i = 0; i < shared.stations.size(); ++i) {
    SessionReading reading(shared, i, ticks[i]);
    const Uuid& id = shared.stations[i].session;
    pb::Request request;
    request.mutable_list_sessions()->set_station(shared.stations[i].name);
    ASSIGN_OR_RETURN(auto listed, client.call(request));
    bool found = false;
    int state = 0;
    for (const pb::SessionInfo& info : listed.sessions().sessions()) {
      if (info.description().session_id() == std::string(id.begin(), id.end())) {
        found = true;
        state = info.state();
      } else {
        ++all.stray;
        addFault(all, shared.stations[i].name + " has a session that it did not make");
      }
    }
    for (std::uint64_t seq = 0; found;) {
      pb::ReadChunks& read = *request.mutable_read_chunks();
      read.set_session_id(id.data(), id.size());
      read.set_from_seq(seq);
      read.set_max_chunks(1000);
      ASSIGN_OR_RETURN(auto reply, client.call(request));
      for (const pb::Chunk& chunk : reply.chunks().chunks()) {
        reading.take(chunk.seq(), viewOf(chunk.data()));
        seq = chunk.seq() + 1;
      }
      if (reply.chunks().end() || reply.chunks().chunks().empty()) break;
    }
    addTo(all, reading.finish(found, state));
    if (progress) progress(i + 1);
  }
  return all;
}

}  // namespace needlelab::test
