// What the program calls, on any thread.
#include "client/net/uplink.h"

#include <algorithm>
#include <utility>

#include "client/net/uplink_call.h"
#include "common/base/clock.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr std::size_t kMostLive = 8;  // pieces of 20 ms that wait for the network thread
constexpr auto kStopGrace = std::chrono::milliseconds(2000);
constexpr auto kStopLook = std::chrono::milliseconds(50);

}  // namespace

Uplink::Uplink(UplinkConfig config, UplinkEvents events)
    : config_(std::move(config)), events_(std::move(events)) {
  state_.away_since_ns = steadyNowNs();
  asio::co_spawn(io_, run(), rethrow);
  thread_ = std::thread([this] { io_.run(); });
}

Uplink::~Uplink() {
  stop();
}

void Uplink::stop() {
  if (!thread_.joinable()) return;
  asio::post(io_, [this] {
    stopping_ = true;
    retry_timer_.cancel();
    if (channel_) {
      pb::Envelope bye;
      bye.mutable_bye()->set_reason("the station ends");
      channel_->finish(CloseReason::kLocal, "the station ends", &bye);
    }
    // an attempt to connect that waits for an answer has nothing to say goodbye to
    if (!channel_) return io_.stop();
    auto timer = std::make_shared<asio::steady_timer>(io_, kStopGrace);
    timer->async_wait([this, timer](const boost::system::error_code&) { io_.stop(); });
  });
  thread_.join();
  takeAdded();
  for (const auto& session : sessions_) session->saveReceipt(steadyNowNs(), true);
}

void Uplink::add(std::shared_ptr<SpoolSession> session, bool current) {
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
  {
    const std::scoped_lock lock(mutex_);
    newest_ = piece;
    flags_since_status_ |= piece.flags;
    if (!watched_.load(std::memory_order_relaxed)) return;
    if (live_.size() >= kMostLive) {
      live_.pop_front();
      ++live_skipped_;
      ++state_.live_dropped;
    }
    live_.push_back({piece, wallNowNs() - (steadyNowNs() - piece.last.time_ns)});
  }
  asio::post(io_, [this] { pumpLive(); });
}

void Uplink::noteLesson(LessonFacts facts) {
  const std::scoped_lock lock(mutex_);
  facts_ = std::move(facts);
}

void Uplink::noteTrouble(const std::string& source, const std::string& words) {
  const std::scoped_lock lock(mutex_);
  if (words.empty())
    troubles_.erase(source);
  else
    troubles_[source] = printable(words);
}

Result<pb::Lesson> Uplink::getLesson(const std::string& exercise_id, const std::string& trainee,
                                     std::chrono::milliseconds patience, bool once,
                                     const std::function<bool()>& stopped) {
  pb::Request request;
  request.mutable_get_lesson()->set_exercise_id(exercise_id);
  request.mutable_get_lesson()->set_trainee(trainee);
  auto reply = ask(std::move(request), patience, once, stopped);
  if (!reply.ok()) return reply.error();
  if (!reply->has_lesson()) return Error{ErrorCode::kFailed, "the server answered, but with no lesson"};
  return std::move(*reply->mutable_lesson());
}

Result<pb::Reply> Uplink::ask(pb::Request request, std::chrono::milliseconds patience, bool once,
                              const std::function<bool()>& stopped) {
  auto call = std::make_shared<Call>();
  call->request = std::move(request);
  std::unique_lock lock(mutex_);
  call_ = call;
  lock.unlock();
  wake();
  lock.lock();
  const auto answered = [&] {
    return call->result.has_value() || state_.denied || (once && !state_.connected && !state_.error.empty());
  };
  // in short waits: a person who presses Ctrl-C while a mute server is waited for wants to be heard
  const auto end = std::chrono::steady_clock::now() + patience;
  bool stop = false;
  while (!answered() && !stop && std::chrono::steady_clock::now() < end) {
    changed_.wait_until(lock, std::min(end, std::chrono::steady_clock::now() + kStopLook), answered);
    lock.unlock();
    stop = stopped && stopped();
    lock.lock();
  }
  call_.reset();
  if (call->result) return *call->result;
  if (stop) return Error{ErrorCode::kFailed, "stopped while waiting for the server"};
  if (state_.denied) return Error{ErrorCode::kDenied, state_.error};
  return Error{ErrorCode::kUnavailable,
               state_.error.empty() ? "the server did not answer in time" : state_.error};
}

bool Uplink::waitUntilDone(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, patience, [&] { return state_.sessions_open == 0 || state_.denied; }) &&
         state_.sessions_open == 0;
}

UplinkState Uplink::state() const {
  const std::scoped_lock lock(mutex_);
  return state_;
}

void Uplink::say(const std::string& text) const {
  if (events_.say) events_.say(text);
}

}  // namespace needlelab
