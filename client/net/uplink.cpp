#include "net/uplink.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/clock.h"
#include "net/backoff.h"
#include "wire/refusal.h"

namespace needlelab {
namespace {

constexpr std::size_t kMostLive = 8;                // pieces of 20 ms that wait for the network thread
constexpr std::size_t kMostQueuedBytes = 1u << 20;  // chunks wait in the spool, not in the channel's queue
constexpr auto kStatusEvery = std::chrono::milliseconds(100);
constexpr std::uint64_t kFirstProbes = 8;   // one with each status line, then
constexpr std::uint64_t kProbeEvery = 100;  // … one in 100 status lines
constexpr auto kStopGrace = std::chrono::milliseconds(2000);

std::uint64_t seedNow() {
  return static_cast<std::uint64_t>(wallNowNs()) ^ static_cast<std::uint64_t>(steadyNowNs()) << 20;
}

}  // namespace

/// A lesson that somebody waits for. Guarded by the uplink's mutex.
struct Uplink::LessonCall {
  pb::GetLesson call;
  std::uint64_t sent_as = 0;  // the request's id on this connection; 0 = not sent
  std::optional<Result<pb::Lesson>> result;
};

Uplink::Uplink(UplinkConfig config, UplinkEvents events)
    : config_(std::move(config)), events_(std::move(events)) {
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
    // an attempt to connect may still be waiting for an answer
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

Result<pb::Lesson> Uplink::getLesson(const std::string& exercise_id, const std::string& trainee,
                                     std::chrono::milliseconds patience, bool once) {
  auto call = std::make_shared<LessonCall>();
  call->call.set_exercise_id(exercise_id);
  call->call.set_trainee(trainee);
  std::unique_lock lock(mutex_);
  lesson_ = call;
  lock.unlock();
  wake();
  lock.lock();
  changed_.wait_for(lock, patience, [&] {
    return call->result.has_value() || state_.denied || (once && !state_.connected && !state_.error.empty());
  });
  lesson_.reset();
  if (call->result) return *call->result;
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

// ---- the uplink's own thread ----

Task<> Uplink::run() {
  Backoff backoff(seedNow(), {config_.first_retry, config_.most_retry, 2.0});
  const std::string server = endpointText(config_.client.server);
  while (!stopping_) {
    auto connection = co_await connectClient(config_.client);
    std::string why;
    bool denied = false;
    if (connection.ok()) {
      const std::int64_t connected_ns = steadyNowNs();
      said_.clear();
      {
        const std::scoped_lock lock(mutex_);
        state_.connected = true;
        state_.denied = false;
        ++state_.connections;
      }
      say("connected to " + server + " as " + connection->welcome.name());
      co_await serve(std::move(*connection));
      why = channel_->closeText();
      // only a connection that lasted is a success: two stations with one key would else throw each other out
      // for ever, five times a second
      if (steadyNowNs() - connected_ns > std::chrono::nanoseconds(config_.most_retry).count())
        backoff.reset();
      // what is queued (our goodbye) still has to go; the channel bounds the time
      for (asio::steady_timer timer(io_); !channel_->closed();) {
        timer.expires_after(std::chrono::milliseconds(10));
        co_await timer.async_wait(kUseTuple);
      }
      channel_.reset();
      watched_.store(false, std::memory_order_relaxed);
      for (const auto& session : sessions_) session->onConnectionLost();
      if (!stopping_)
        say("the connection to " + server + " is lost (" + why +
            "); the spool keeps everything, trying again");
    } else {
      why = connection.error().message;
      denied = connection.error().code == ErrorCode::kDenied ||
               connection.error().code == ErrorCode::kVersion ||
               connection.error().code == ErrorCode::kInvalidInput;
      // said once, not at every try
      if (!stopping_ && why != said_) say(why + (denied ? "" : "; the spool keeps everything, trying again"));
      said_ = why;
    }
    {
      const std::scoped_lock lock(mutex_);
      state_.connected = false;
      state_.denied = denied;
      state_.error = why;
      live_.clear();
      if (lesson_) lesson_->sent_as = 0;
    }
    changed_.notify_all();
    if (stopping_) break;
    // a server that says no is not asked every second
    retry_timer_.expires_after(denied ? config_.most_retry : backoff.next());
    co_await retry_timer_.async_wait(kUseTuple);
  }
  io_.stop();
}

Task<> Uplink::serve(ClientConnection connection) {
  channel_ = connection.channel;
  clock_ = ClockProbe{};
  clock_sent_ns_ = 0;
  probes_ = frame_seq_ = 0;
  asio::co_spawn(io_, keepTime(), rethrow);
  pump();
  for (;;) {
    auto envelope = co_await channel_->receive();
    if (!envelope.ok()) {
      channel_->finish(CloseReason::kProtocol, envelope.error().message);
      co_return;
    }
    handle(*envelope);
    pump();
  }
}

// status lines, probes and receipts, as long as this connection lasts
Task<> Uplink::keepTime() {
  const std::shared_ptr<Channel> channel = channel_;
  asio::steady_timer timer(io_);
  for (std::uint64_t round = 0; !channel->closing() && channel_ == channel; ++round) {
    if (round < kFirstProbes || round % kProbeEvery == 0) sendProbe();
    sendStatus();
    pump();
    for (const auto& session : sessions_) session->saveReceipt(steadyNowNs(), false);
    timer.expires_after(kStatusEvery);
    co_await timer.async_wait(kUseTuple);
  }
}

UplinkSession* Uplink::find(const std::string& session_id) {
  for (const auto& session : sessions_)
    if (session->spool()->description().session_id() == session_id) return session.get();
  return nullptr;
}

void Uplink::handle(const pb::Envelope& envelope) {
  switch (envelope.body_case()) {
    case pb::Envelope::kAck:
      if (auto* session = find(envelope.ack().session_id())) session->onAck(envelope.ack());
      break;
    case pb::Envelope::kSessionOpened:
      if (auto* session = find(envelope.session_opened().session_id())) {
        session->onOpened(envelope.session_opened().next_seq());
        if (session->refused()) say("session " + session->spool()->idText() + ": " + session->trouble());
        if (session == current_) clock_sent_ns_ = 0;
        sendClockOffset();
      }
      break;
    case pb::Envelope::kSessionClosed:
      if (auto* session = find(envelope.session_closed().session_id())) {
        session->onClosed(envelope.session_closed());
        if (session != current_)
          say("session " + session->spool()->idText() + " of an earlier run is now in the server's database");
      }
      break;
    case pb::Envelope::kRefusal:
      handleRefusal(envelope);
      break;
    case pb::Envelope::kReply: {
      const std::scoped_lock lock(mutex_);
      if (lesson_ && lesson_->sent_as == envelope.reply().id() && envelope.reply().has_lesson()) {
        lesson_->result = envelope.reply().lesson();
        changed_.notify_all();
      }
      break;
    }
    case pb::Envelope::kPing:
      channel_->send(pongTo(envelope.ping()));
      break;
    case pb::Envelope::kPong:
      if (clock_.add(envelope.pong().sender_steady_ns(), envelope.pong().receiver_steady_ns(), steadyNowNs()))
        sendClockOffset();
      break;
    case pb::Envelope::kWatchState:
      watched_.store(envelope.watch_state().watched(), std::memory_order_relaxed);
      break;
    case pb::Envelope::kTraineeMessage:
      if (events_.trainee_message) events_.trainee_message(envelope.trainee_message());
      break;
    case pb::Envelope::kNextExercise:
      if (events_.next_exercise) events_.next_exercise(envelope.next_exercise());
      break;
    case pb::Envelope::kBye:
      channel_->finish(CloseReason::kPeerClosed, "the server says goodbye: " + envelope.bye().reason());
      break;
    default:
      break;  // a newer server's message that we do not know
  }
}

void Uplink::handleRefusal(const pb::Envelope& envelope) {
  const pb::Refusal& refusal = envelope.refusal();
  if (envelope.refused_request() != 0) {
    const std::scoped_lock lock(mutex_);
    if (lesson_ && lesson_->sent_as == envelope.refused_request()) {
      lesson_->result = errorOf(refusal);
      changed_.notify_all();
    }
    return;
  }
  if (auto* session = refusal.session_id().empty() ? nullptr : find(refusal.session_id())) {
    session->onRefusal(refusal);
    if (session->refused()) say("session " + session->spool()->idText() + ": " + session->trouble());
    return;
  }
  say("the server refuses (" + reasonName(refusal.reason()) + "): " + refusal.text());
}

void Uplink::takeAdded() {
  std::vector<std::pair<std::shared_ptr<SpoolSession>, bool>> added;
  {
    const std::scoped_lock lock(mutex_);
    added.swap(added_);
  }
  for (auto& [spool, current] : added) {
    auto session =
        std::make_unique<UplinkSession>(std::move(spool), config_.client.login.station().station());
    if (current) {
      current_ = session.get();
      sessions_.insert(sessions_.begin(), std::move(session));
    } else {
      sessions_.push_back(std::move(session));
    }
  }
}

// sends whatever may be sent now: the current session first, of the others one at a time
void Uplink::pump() {
  takeAdded();
  if (channel_ && !channel_->closing()) {
    {
      const std::scoped_lock lock(mutex_);
      if (lesson_ && lesson_->sent_as == 0 && !lesson_->result) {
        pb::Envelope envelope;
        lesson_->sent_as = ++request_;
        envelope.mutable_request()->set_id(request_);
        *envelope.mutable_request()->mutable_get_lesson() = lesson_->call;
        channel_->send(envelope);
      }
    }
    std::uint64_t in_flight = 0;
    for (const auto& session : sessions_)
      if (!session->finished()) in_flight += session->inFlight();
    for (const auto& session : sessions_) {
      if (session->finished()) continue;
      for (;;) {
        const bool room =
            in_flight < config_.window_chunks && channel_->controlQueueBytes() < kMostQueuedBytes;
        auto message = session->next(room);
        if (!message) break;
        if (message->has_chunk()) ++in_flight;
        if (!channel_->send(*message)) break;
      }
      if (session->refused()) say("session " + session->spool()->idText() + ": " + session->trouble());
      // the next old session begins when this one is through
      if (session.get() != current_ && !session->finished()) break;
    }
  }
  publish();
}

void Uplink::publish() {
  std::uint64_t left = 0, open = 0;
  for (const auto& session : sessions_) {
    if (session->closed()) continue;
    const std::uint64_t chunks = session->spool()->contents().chunks;
    left += chunks - std::min(chunks, session->committed());
    if (!session->finished()) ++open;
  }
  {
    const std::scoped_lock lock(mutex_);
    state_.chunks_left = left;
    state_.sessions_open = open + added_.size();
    state_.clock = clock_.best();
    if (current_ != nullptr) {
      state_.current_committed = current_->committed();
      if (current_->closed()) state_.current_verdict = current_->verdict();
      state_.current_trouble = current_->trouble();
    }
  }
  changed_.notify_all();
}

void Uplink::pumpLive() {
  if (!channel_ || channel_->closing() || current_ == nullptr) return;
  std::deque<Live> live;
  {
    const std::scoped_lock lock(mutex_);
    live.swap(live_);
    frame_seq_ += live_skipped_;  // the gap shows
    live_skipped_ = 0;
    state_.live_frames += live.size();
  }
  for (const Live& item : live) {
    pb::Envelope envelope;
    pb::LiveFrame& frame = *envelope.mutable_live_frame();
    frame.set_session_id(current_->spool()->description().session_id());
    frame.set_frame_seq(frame_seq_++);
    frame.set_data(item.piece.chunk->data(), item.piece.chunk->size());
    frame.set_due_steady_ns(item.piece.last.time_ns);
    frame.set_capture_unix_ns(item.capture_unix_ns);
    if (auto encoded = encodeFrame(envelope); encoded.ok()) channel_->sendLive(*encoded, true);
  }
}

void Uplink::sendStatus() {
  pb::Envelope envelope;
  pb::StationStatus& status = *envelope.mutable_station_status();
  {
    const std::scoped_lock lock(mutex_);
    status.set_spool_left(state_.chunks_left);
    if (current_ != nullptr && newest_) {
      const GestureSample& last = newest_->last;
      status.set_phase(last.phase);
      status.set_layer(last.layer);
      status.set_insertion_m(last.insertion_m);
      status.set_force_n(std::hypot(last.force_W_N[0], last.force_W_N[1], last.force_W_N[2]));
      status.set_samples(newest_->samples_so_far);
      status.set_fault(last.fault);
      status.set_warnings(std::exchange(flags_since_status_, 0));
    }
  }
  if (current_ != nullptr && !current_->spool()->contents().ended) {
    const pb::SessionDescription& description = current_->spool()->description();
    status.set_session_id(description.session_id());
    status.set_trainee(description.trainee());
    status.set_exercise_id(description.exercise_id());
  }
  status.set_missed_ticks(missed_ticks_.load(std::memory_order_relaxed));
  if (auto encoded = encodeFrame(envelope); encoded.ok()) channel_->sendLive(*encoded, false);
}

void Uplink::sendProbe() {
  pb::Envelope envelope;
  envelope.mutable_ping()->set_id(++probes_);
  envelope.mutable_ping()->set_sender_steady_ns(steadyNowNs());
  channel_->send(envelope);
}

void Uplink::sendClockOffset() {
  const auto& best = clock_.best();
  if (!best || current_ == nullptr || !current_->opened() || clock_sent_ns_ == best->round_trip_ns) return;
  pb::Envelope envelope;
  pb::ClockOffset& offset = *envelope.mutable_clock_offset();
  offset.set_session_id(current_->spool()->description().session_id());
  offset.set_offset_ns(best->offset_ns);
  offset.set_round_trip_ns(best->round_trip_ns);
  channel_->send(envelope);
  clock_sent_ns_ = best->round_trip_ns;
}

}  // namespace needlelab
