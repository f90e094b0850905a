#include "tests/support/proxy/fault_connection.h"

#include <algorithm>
#include <utility>

#include "tests/support/proxy/fault_proxy.h"

namespace needlelab::test {
namespace {

constexpr std::size_t kMostQueued = 64u << 10;  // per direction; beyond it the sender is not read
constexpr std::size_t kFirstBytes = 4096;       // repeated by a duplicate
constexpr auto kStallLook = std::chrono::milliseconds(2);

void hardClose(Tcp::socket& socket) {
  boost::system::error_code ignored;
  socket.set_option(asio::socket_base::linger(true, 0), ignored);
  socket.close(ignored);
}

void softClose(Tcp::socket& socket) {
  boost::system::error_code ignored;
  socket.shutdown(Tcp::socket::shutdown_both, ignored);
  socket.close(ignored);
}

}  // namespace

FaultConnection::FaultConnection(FaultProxy& proxy, std::uint64_t id, Tcp::socket client,
                                 const ConnectionScript& script, std::uint64_t seed)
    : proxy_(proxy),
      id_(id),
      script_(script),
      random_(seed),
      client_(std::move(client)),
      server_(client_.get_executor()),
      up_(client_.get_executor()),
      down_(client_.get_executor()),
      late_(client_.get_executor()) {}

Task<> FaultConnection::run(std::shared_ptr<FaultConnection> self, std::uint16_t server_port) {
  FaultConnection& it = *self;
  if (it.script_.refuse || it.proxy_.refused_) {
    ++it.proxy_.counts_.refused;
    it.end(true);
    co_return;
  }
  auto [error] = co_await it.server_.async_connect(
      Tcp::endpoint(asio::ip::address_v4::loopback(), server_port), kUseTuple);
  if (error || it.ended_) {
    it.end(true);
    co_return;
  }
  boost::system::error_code ignored;
  it.client_.set_option(Tcp::no_delay(true), ignored);
  it.server_.set_option(Tcp::no_delay(true), ignored);
  const auto executor = it.client_.get_executor();
  for (const Way way : {Way::kUp, Way::kDown}) {
    asio::co_spawn(executor, readLane(self, way), rethrow);
    asio::co_spawn(executor, writeLane(self, way), rethrow);
  }
  for (unsigned i = 0; i < it.script_.duplicates; ++i)
    asio::co_spawn(executor, duplicate(self, server_port), rethrow);
}

Task<> FaultConnection::wait(Lane& lane, Clock::duration time) {
  if (time <= Clock::duration::zero()) co_return;
  lane.pause.expires_after(time);
  co_await lane.pause.async_wait(kUseTuple);
}

Task<> FaultConnection::change(Lane& lane) {
  co_await lane.wake.async_wait(kUseTuple);
}

Task<> FaultConnection::readLane(std::shared_ptr<FaultConnection> self, Way way) {
  FaultConnection& it = *self;
  Lane& lane = it.lane(way);
  const WayScript& script = it.script(way);
  std::array<char, 16384> buffer;
  while (!it.ended_) {
    // if the receiver stops reading, stop reading from the sender, too
    if (lane.queued >= kMostQueued && !it.silent_ && !lane.over) {
      co_await it.change(lane);
      continue;
    }
    auto [error, count] = co_await it.from(way).async_read_some(asio::buffer(buffer), kUseTuple);
    if (it.ended_) co_return;
    if (it.silent_) {
      // the other side does not learn of this end
      if (!error) continue;
      hardClose(it.from(way));
      if (!it.to(way).is_open()) it.end(true);
      co_return;
    }
    const auto now = Clock::now();
    const double u = it.random_.unit();
    const auto extra = std::chrono::duration_cast<Clock::duration>(script.jitter * u);
    lane.last_due = std::max(lane.last_due, now + script.delay + extra);
    if (error) {
      lane.queue.push_back({{}, lane.last_due, error != asio::error::eof});
      lane.wake.cancel();
      co_return;
    }
    if (way == Way::kUp && it.first_bytes_.size() < kFirstBytes) it.first_bytes_.append(buffer.data(), count);
    if (script.corrupt_at && *script.corrupt_at >= lane.in && *script.corrupt_at < lane.in + count) {
      buffer[*script.corrupt_at - lane.in] ^= 0x10;
      ++it.proxy_.counts_.corrupted;
    }
    lane.in += count;
    if (lane.over) continue;  // its receiver is already gone
    lane.queue.push_back({std::string(buffer.data(), count), lane.last_due});
    lane.queued += count;
    lane.wake.cancel();
  }
}

Task<> FaultConnection::writeLane(std::shared_ptr<FaultConnection> self, Way way) {
  FaultConnection& it = *self;
  Lane& lane = it.lane(way);
  const WayScript& script = it.script(way);
  while (!it.ended_ && !it.silent_ && !lane.over) {
    if (lane.queue.empty()) {
      co_await it.change(lane);
      continue;
    }
    const auto now = Clock::now();
    const auto due = std::max(lane.queue.front().due, lane.free_at);
    if (due > now) {
      co_await it.wait(lane, due - now);
      continue;
    }
    if (it.proxy_.stalled_) {
      co_await it.wait(lane, kStallLook);
      continue;
    }
    if (script.stall_at && lane.out >= *script.stall_at && !lane.stalled) {
      lane.stalled = true;
      ++it.proxy_.counts_.stalls;
      co_await it.wait(lane, script.stall);
      continue;
    }
    if (it.script_.hold_at && it.up_.out >= *it.script_.hold_at && !it.released_) {
      co_await it.change(lane);
      continue;
    }
    if (lane.queue.front().bytes.empty()) {
      it.laneOver(way, lane.queue.front().reset);
      co_return;
    }

    // one piece, at most up to the script's next event
    std::string& bytes = lane.queue.front().bytes;
    std::size_t count = bytes.size();
    const auto upTo = [&](const std::optional<std::uint64_t>& at) {
      if (at && *at > lane.out) count = std::min<std::size_t>(count, *at - lane.out);
    };
    const bool slow = lane.out >= script.slow_from;
    if (slow && script.piece_bytes > 0) count = std::min(count, script.piece_bytes);
    if (slow && script.bytes_per_s > 0) count = std::min<std::size_t>(count, script.bytes_per_s / 100 + 1);
    upTo(script.stall_at);
    if (way == Way::kUp) upTo(it.script_.hold_at);
    const bool cuts = it.script_.cut_at && it.script_.cut_way == way;
    if (cuts && lane.out >= *it.script_.cut_at) {
      it.cut(it.script_.cut);
      co_return;
    }
    if (cuts) upTo(it.script_.cut_at);
    auto [error, written] =
        co_await asio::async_write(it.to(way), asio::buffer(bytes.data(), count), kUseTuple);
    if (it.ended_ || it.silent_) co_return;
    if (error) {
      it.laneOver(way, true);
      co_return;
    }
    lane.out += count;
    lane.queued -= count;
    (way == Way::kUp ? it.proxy_.counts_.bytes_up : it.proxy_.counts_.bytes_down) += count;
    if (slow && script.bytes_per_s > 0)
      lane.free_at =
          std::max(lane.free_at, now) + std::chrono::nanoseconds(1'000'000'000 * count / script.bytes_per_s);
    if (count == bytes.size())
      lane.queue.pop_front();
    else
      bytes.erase(0, count);
    lane.wake.cancel();  // the reader may have room
    if (cuts && lane.out >= *it.script_.cut_at) it.cut(it.script_.cut);
  }
}

// the sender has ended and everything was passed on, or the receiver accepts no more
void FaultConnection::laneOver(Way way, bool reset) {
  Lane& mine = lane(way);
  mine.over = true;
  mine.queue.clear();
  mine.queued = 0;
  mine.wake.cancel();
  // the held bytes of the client, and its end, reach the server later
  const bool late = script_.hold_at.has_value() && !up_.over;
  if (late) return;
  if (!reset && !lane(way == Way::kUp ? Way::kDown : Way::kUp).over) {
    boost::system::error_code ignored;
    to(way).shutdown(Tcp::socket::shutdown_send, ignored);
    return;
  }
  end(reset);
}

void FaultConnection::overtaken() {
  if (!script_.hold_at || released_) return;
  asio::co_spawn(client_.get_executor(), release(shared_from_this()), rethrow);
}

Task<> FaultConnection::release(std::shared_ptr<FaultConnection> self) {
  self->late_.expires_after(self->script_.late_after);
  co_await self->late_.async_wait(kUseTuple);
  if (self->ended_) co_return;
  if (self->up_.queued > 0) ++self->proxy_.counts_.late;
  self->released_ = true;
  for (Lane* each : {&self->up_, &self->down_}) each->wake.cancel();
}

Task<> FaultConnection::duplicate(std::shared_ptr<FaultConnection> self, std::uint16_t server_port) {
  FaultConnection& it = *self;
  Tcp::socket socket(it.client_.get_executor());
  auto [error] =
      co_await socket.async_connect(Tcp::endpoint(asio::ip::address_v4::loopback(), server_port), kUseTuple);
  if (error) co_return;
  ++it.proxy_.counts_.duplicates;
  asio::steady_timer timer(it.client_.get_executor());
  // replays the client's bytes as they come; ends when the server ends it or the client is gone
  for (std::size_t sent = 0; !it.ended_ && sent < kFirstBytes;) {
    if (sent < it.first_bytes_.size()) {
      const std::string more = it.first_bytes_.substr(sent);
      auto [failed, count] = co_await asio::async_write(socket, asio::buffer(more), kUseTuple);
      if (failed) break;
      sent += count;
    }
    timer.expires_after(std::chrono::milliseconds(20));
    co_await timer.async_wait(kUseTuple);
  }
  softClose(socket);
}

void FaultConnection::cut(Cut how) {
  if (ended_ || silent_) return;
  ++proxy_.counts_.cuts;
  if (how == Cut::kSilent) {
    ++proxy_.counts_.silent;
    silent_ = true;
    for (Lane* each : {&up_, &down_}) {
      each->queue.clear();
      each->queued = 0;
      each->wake.cancel();
      each->pause.cancel();
    }
    return;
  }
  end(how == Cut::kReset);
}

void FaultConnection::end(bool reset) {
  if (std::exchange(ended_, true)) return;
  for (Tcp::socket* socket : {&client_, &server_}) reset ? hardClose(*socket) : softClose(*socket);
  for (Lane* each : {&up_, &down_}) {
    each->wake.cancel();
    each->pause.cancel();
  }
  late_.cancel();
  proxy_.forget(id_);
}

}  // namespace needlelab::test
