#include "client/net/uplink/uplink.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <utility>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxLive = 8;  // queue of 20 ms pieces for the network thread
constexpr auto kStopGrace = std::chrono::milliseconds(2000);
constexpr std::int64_t kStopPollPeriod_ns = 50'000'000;

}  // namespace

Uplink::Uplink(UplinkConfig config, UplinkEvents events)
    : config_(std::move(config)),
      events_(std::move(events)),
      link_(io_, {.retry = config_.retry(), .lasting = config_.max_retry, .clock = config_.clock},
            handlers()) {
  state_.away_since_ns = time().nowNs();
  link_.logIn(config_.client);
  thread_ = std::thread([this] { io_.run(); });
}

Uplink::~Uplink() {
  stop();
}

void Uplink::stop() {
  if (!thread_.joinable()) return;
  asio::post(io_, [this] {
    link_.stop("the station ends", [this] { io_.stop(); });
    const auto stopLate = [](Uplink& self) -> Task<> {
      asio::steady_timer timer(self.io_);
      co_await self.config_.clock->wait(timer, kStopGrace, LinkWait::kEnd);
      self.io_.stop();
    };
    asio::co_spawn(io_, stopLate(*this), rethrow);
  });
  thread_.join();
  takeAdded();
  for (const auto& session : sessions_) session->saveReceipt(true);
}

void Uplink::add(std::shared_ptr<SpoolSession> session, bool current) {
  assert(session != nullptr);
  {
    const std::scoped_lock lock(mutex_);
    added_.emplace_back(std::move(session), current);
    if (current) {
      current_added_ = true;
      state_.current_committed = 0;
      state_.current_verdict.reset();
      state_.current_trouble.clear();
      newest_.reset();
      live_.clear();
      facts_ = {};
      dropped_before_ = state_.live_dropped;
    }
    ++state_.sessions_open;
  }
  wake();
}

void Uplink::wake() {
  asio::post(io_, [this] { pump(); });
}

void Uplink::offer(const SamplePiece& piece) {
  assert(piece.samples != nullptr && !piece.samples->empty());
  {
    const std::scoped_lock lock(mutex_);
    newest_ = Live{piece, config_.clock->unixNs() - (time().nowNs() - piece.last.time_ns)};
    flags_since_status_ |= piece.flags;
    newest_sent_ = watched_.load(std::memory_order_relaxed);
    if (!newest_sent_) return;
    if (live_.size() >= kMaxLive) {
      live_.pop_front();
      ++live_skipped_;
      ++state_.live_dropped;
    }
    live_.push_back(*newest_);
  }
  asio::post(io_, [this] { pumpLive(); });
}

void Uplink::noteLesson(LessonFacts facts) {
  const std::scoped_lock lock(mutex_);
  facts_ = std::move(facts);
}

void Uplink::noteTrouble(const std::string& source, const std::string& text) {
  const std::scoped_lock lock(mutex_);
  if (text.empty())
    troubles_.erase(source);
  else
    troubles_[source] = printable(text);
}

Result<pb::Lesson> Uplink::getLesson(const std::string& exercise_id, const std::string& trainee,
                                     std::chrono::milliseconds patience, bool once,
                                     const std::function<bool()>& stopped, const std::string& code) {
  pb::Request request;
  request.mutable_get_lesson()->set_exercise_id(exercise_id);
  request.mutable_get_lesson()->set_trainee(trainee);
  request.mutable_get_lesson()->set_code(code);
  ASSIGN_OR_RETURN(auto reply, ask(std::move(request), patience, once, stopped));
  if (!reply.has_lesson()) return Error{ErrorCode::kFailed, "the server answered, but with no lesson"};
  return std::move(*reply.mutable_lesson());
}

Result<pb::Reply> Uplink::ask(pb::Request request, std::chrono::milliseconds patience, bool once,
                              const std::function<bool()>& stopped) {
  // guarded by the mutex; only the network thread uses the id
  struct Call {
    std::optional<Result<pb::Reply>> result;
    std::uint64_t id = 0;
  };
  const auto call = std::make_shared<Call>();
  asio::post(io_, [this, call, request = std::move(request)]() mutable {
    const auto answer = [this, call](Result<pb::Reply> reply) {
      const std::scoped_lock lock(mutex_);
      call->result.emplace(std::move(reply));
      changed_.notify_all();
    };
    // a wrong code repeated after a lost link counts twice; rare, and costs only one attempt
    call->id = link_.ask(std::move(request), answer, OnLoss::kResend, ServerLink::kForever);
  });
  std::unique_lock lock(mutex_);
  const auto answered = [&] { return call->result.has_value() || state_.denied || (once && all_away_); };
  // in short waits, so that Ctrl-C works while the server is silent
  const std::int64_t end_ns = time().nowNs() + std::chrono::nanoseconds(patience).count();
  bool stop = false;
  while (!answered() && !stop && time().nowNs() < end_ns) {
    time().waitUntilNs(changed_, lock, std::min(end_ns, time().nowNs() + kStopPollPeriod_ns), answered);
    lock.unlock();
    stop = stopped && stopped();
    lock.lock();
  }
  if (call->result) return *call->result;
  asio::post(io_, [this, call] { link_.forget(call->id); });
  if (stop) return Error{ErrorCode::kFailed, "stopped while waiting for the server"};
  if (state_.denied) return Error{ErrorCode::kDenied, state_.error};
  return Error{ErrorCode::kUnavailable,
               state_.error.empty() ? "the server did not answer in time" : state_.error};
}

bool Uplink::waitUntilDone(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  const std::int64_t end_ns = time().nowNs() + std::chrono::nanoseconds(patience).count();
  time().waitUntilNs(changed_, lock, end_ns, [&] { return state_.sessions_open == 0 || state_.denied; });
  return state_.sessions_open == 0;
}

UplinkState Uplink::state() const {
  const std::scoped_lock lock(mutex_);
  return state_;
}

void Uplink::report(const std::string& text) const {
  if (events_.report) events_.report(text);
}

std::optional<DrainEnd> drainEnd(const UplinkState& state, const DrainPatience& patience,
                                 std::int64_t began_ns, std::int64_t now_ns) {
  const auto since = [now_ns](std::int64_t then_ns) {
    return std::chrono::duration<double>(1e-9 * static_cast<double>(now_ns - then_ns));
  };
  if (state.denied) return DrainEnd::kDenied;
  if (since(began_ns) >= patience.whole) return DrainEnd::kTimeOver;
  if (state.connected) return std::nullopt;
  // an attempt has already failed: do not expect a first connection soon
  const auto away = since(state.away_since_ns);
  const bool never = state.connections == 0 && !state.error.empty() && away >= patience.never_connected;
  const bool long_ago = state.connections > 0 && away >= patience.long_away;
  // wait a moment longer: the server may have just returned
  const bool waited = since(began_ns) >= std::min(patience.whole, patience.never_connected / 2);
  if ((never || long_ago) && waited) return DrainEnd::kAway;
  return std::nullopt;
}

DrainEnd drain(Uplink& uplink, const DrainPatience& patience, const std::function<bool()>& stopped) {
  uplink.wake();
  const std::int64_t began_ns = uplink.time().nowNs();
  while (!uplink.waitUntilDone(std::chrono::milliseconds(20))) {
    const auto end = drainEnd(uplink.state(), patience, began_ns, uplink.time().nowNs());
    if (end == DrainEnd::kDenied) return *end;
    if (stopped()) return DrainEnd::kStopped;
    if (end) return *end;
  }
  return DrainEnd::kDone;
}

std::string drainText(DrainEnd end, const UplinkState& state) {
  switch (end) {
    case DrainEnd::kDone:
    case DrainEnd::kDenied:  // already reported
      return {};
    case DrainEnd::kAway:
      return "not connected (" + state.error +
             "); the spool keeps everything, the next start with --server sends it";
    case DrainEnd::kTimeOver:
      return fmt::format(
          "{} chunks could not be sent within --drain; the spool keeps them, the next start with --server "
          "sends them",
          state.chunks_left);
    case DrainEnd::kStopped:
      return "not waiting for the server any longer; the spool keeps everything";
  }
  return {};
}

}  // namespace needlelab
