// The uplink's own thread: sends messages, handles the server's messages, and runs the live plane.
#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "client/net/uplink/uplink.h"
#include "common/base/text/text.h"
#include "common/gesture/chunk.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxQueuedBytes = 1u << 20;  // chunks wait in the spool, not in the channel's queue
constexpr auto kStatusEvery = std::chrono::milliseconds(100);
constexpr std::uint64_t kFirstProbes = 8;   // one per status line, then
constexpr std::uint64_t kProbeEvery = 100;  // … one in 100 status lines

bool isRefused(const Error& error) {
  return error.code == ErrorCode::kDenied || error.code == ErrorCode::kVersion ||
         error.code == ErrorCode::kInvalidInput;
}

/// Drops a newer server's aids that we cannot show.
pb::SetAids withKnownAids(const pb::SetAids& set) {
  pb::SetAids known = set;
  known.clear_aids();
  for (const int aid : set.aids()) {
    if (aid != pb::Exercise::AID_UNSPECIFIED && pb::Exercise::Aid_IsValid(aid))
      known.add_aids(static_cast<pb::Exercise::Aid>(aid));
  }
  return known;
}

constexpr std::size_t kMaxHazardBytes = 400;  // of all names together, in addition to 1 KiB of trouble

/// Cuts the text at a character boundary: servers refuse long status lines (server/live/hub/hub.h).
void cutText(std::string& text, std::size_t bytes) {
  if (text.size() <= bytes) return;
  while (bytes > 0 && (static_cast<unsigned char>(text[bytes]) & 0xc0) == 0x80) --bytes;
  text.resize(bytes);
}

}  // namespace

Retry retryOfStation(const LinkEnd& end, bool lesson_runs) {
  if (end.was_connected) return Retry::kBackOff;
  if (isRefused(end.error)) return Retry::kSlowly;
  return lesson_runs && !end.reached ? Retry::kProbe : Retry::kBackOff;
}

bool Uplink::lessonRuns() const {
  return current_ != nullptr && !current_->spool()->contents().ended;
}

LinkHandlers Uplink::handlers() {
  return {.accept = {},
          .connected = [this](const pb::Welcome& welcome) { onConnected(welcome); },
          .message =
              [this](pb::Envelope& envelope) {
                handle(envelope);
                pump();
              },
          .judge = [this](const LinkEnd& end) { return retryOfStation(end, lessonRuns()); },
          .away = [this](const LinkEnd& end) { onAway(end); }};
}

void Uplink::onConnected(const pb::Welcome& welcome) {
  reported_.clear();
  welcomed_ns_ = time().nowNs();
  const std::string server = endpointText(link_.server());
  std::vector<const UplinkSession*> again;
  for (const auto& session : sessions_) {
    const bool was_closed = session->closed();
    session->spool()->clock().note(welcome.server_unix_ns(), welcomed_ns_);
    session->onConnected(atServer(*session));
    if (was_closed && !session->closed()) again.push_back(session.get());
  }
  publish();  // first, so that a caller that sees the connection also sees what must be sent again
  {
    const std::scoped_lock lock(mutex_);
    state_.connected = true;
    state_.away_since_ns = 0;
    state_.denied = all_away_ = false;
    state_.server = server;
    ++state_.connections;
    if (welcome.server_unix_ns() > 0) {
      state_.server_minus_steady_ns = welcome.server_unix_ns() - welcomed_ns_;
      state_.wall_ahead_ns = config_.clock->unixNs() - welcome.server_unix_ns();
    }
  }
  const std::string& passed_over = link_.passedOver();
  report("connected to " + server + " as " + welcome.name() +
         (passed_over.empty() ? "" : "; another server did not take us: " + passed_over));
  if (const std::string off = clockOffText(state().wall_ahead_ns); !off.empty())
    report(off + ": set it (timedatectl); sessions are dated by the server's while it is there");
  for (const UplinkSession* session : again) reportSentAgain(*session);
  clock_ = ClockProbe{};
  clock_sent_ns_ = 0;
  probes_ = frame_seq_ = 0;
  asio::co_spawn(io_, keepTime(), rethrow);
  pump();
}

void Uplink::onAway(const LinkEnd& end) {
  const std::string why = end.was_connected ? end.channel_text : end.error.message;
  const bool denied = !end.was_connected && isRefused(end.error);
  if (end.was_connected) {
    watched_.store(false, std::memory_order_relaxed);
    for (const auto& session : sessions_) session->onConnectionLost();
    if (!end.stopping)
      report("the connection to " + end.server + " is lost (" + why +
             "); the spool keeps everything, trying " + (end.others ? "another server" : "again"));
  } else {
    // report it once, not at every attempt
    if (why != reported_) report(why + (denied ? "" : "; the spool keeps everything, trying again"));
    reported_ = why;
  }
  {
    const std::scoped_lock lock(mutex_);
    if (state_.connected) state_.away_since_ns = time().nowNs();
    state_.connected = false;
    state_.denied = denied;
    state_.error = why;
    // the loss of one connection says nothing about the other servers
    all_away_ = !end.others;
    live_.clear();
  }
  changed_.notify_all();
}

UplinkSession::AtServer Uplink::atServer(const UplinkSession& session) const {
  const auto& open = link_.welcome().open_sessions();
  if (std::any_of(open.begin(), open.end(), [&](const auto& each) {
        return each.session_id() == session.spool()->description().session_id();
      }))
    return UplinkSession::AtServer::kOpen;
  return open.size() < UplinkSession::kFullWelcome ? UplinkSession::AtServer::kNotOpen
                                                   : UplinkSession::AtServer::kUnknown;
}

void Uplink::reportSentAgain(const UplinkSession& session) const {
  report("session " + session.spool()->idText() +
         ": the server no longer has all of it (an older backup was restored there, or a lagging standby "
         "was promoted); it is sent again");
}

// sends status lines and probes, and saves receipts, for the life of this connection
Task<> Uplink::keepTime() {
  const std::uint64_t connection = link_.connections();
  asio::steady_timer timer(io_);
  for (std::uint64_t round = 0; link_.online() && link_.connections() == connection; ++round) {
    if (round < kFirstProbes || round % kProbeEvery == 0) sendProbe();
    sendStatus();
    pump();
    for (const auto& session : sessions_) session->saveReceipt(false);
    co_await config_.clock->wait(timer, kStatusEvery, LinkWait::kStatus);
  }
}

void Uplink::takeAdded() {
  std::vector<std::pair<std::shared_ptr<SpoolSession>, bool>> added;
  {
    const std::scoped_lock lock(mutex_);
    added.swap(added_);
    current_added_ = false;
  }
  for (auto& [spool, current] : added) {
    auto session =
        std::make_unique<UplinkSession>(std::move(spool), config_.client.login.station().station(), time());
    if (link_.online()) {
      session->spool()->clock().note(link_.welcome().server_unix_ns(), welcomed_ns_);
      session->onConnected(atServer(*session));
    }
    if (current) {
      current_ = session.get();
      sessions_.insert(sessions_.begin(), std::move(session));
    } else {
      sessions_.push_back(std::move(session));
    }
  }
}

// sends everything allowed now: the current session first, then the others one at a time
void Uplink::pump() {
  assert(io_.get_executor().running_in_this_thread());
  takeAdded();
  if (link_.online()) {
    std::uint64_t in_flight = 0;
    for (const auto& session : sessions_)
      if (!session->finished()) in_flight += session->inFlight();
    for (const auto& session : sessions_) {
      if (session->refused()) continue;
      for (;;) {
        const bool room = in_flight < config_.window_chunks && link_.queuedBytes() < kMaxQueuedBytes;
        auto message = session->next(room);
        if (!message) break;
        if (message->has_chunk()) ++in_flight;
        if (!link_.send(*message)) break;
      }
      if (session->refused()) report("session " + session->spool()->idText() + ": " + session->trouble());
      // start the next old session when this one is finished
      if (session.get() != current_ && (!session->finished() || session->asking())) break;
    }
  }
  publish();
}

void Uplink::publish() {
  std::uint64_t left = 0, open = 0;
  std::string full;
  for (const auto& session : sessions_) {
    if (session->closed()) continue;
    if (full.empty()) full = session->waitsFor();
    const std::uint64_t chunks = session->spool()->contents().chunks;
    left += chunks - std::min(chunks, session->committed());
    if (!session->finished()) ++open;
  }
  {
    const std::scoped_lock lock(mutex_);
    state_.server_full = printable(full);
    // instructors see it together with the station's own problems
    if (full.empty())
      troubles_.erase("server");
    else
      troubles_["server"] = state_.server_full;
    state_.chunks_left = left;
    state_.sessions_open = open + added_.size();
    state_.clock = clock_.best();
    if (current_ != nullptr && !current_added_) {
      state_.current_committed = current_->committed();
      if (current_->closed()) state_.current_verdict = current_->verdict();
      state_.current_trouble = current_->trouble();
    }
  }
  changed_.notify_all();
}

bool Uplink::isForCurrentSession(const std::string& session_id) const {
  if (session_id.empty() ||
      (current_ != nullptr && current_->spool()->description().session_id() == session_id))
    return true;
  report("an instructor's message was for another lesson and is ignored");
  return false;
}

UplinkSession* Uplink::find(const std::string& session_id) {
  for (const auto& session : sessions_)
    if (session->spool()->description().session_id() == session_id) return session.get();
  return nullptr;
}

void Uplink::handle(const pb::Envelope& envelope) {
  assert(io_.get_executor().running_in_this_thread());
  switch (envelope.body_case()) {
    case pb::Envelope::kAck:
      if (events_.acknowledged) events_.acknowledged(envelope.ack());
      if (auto* session = find(envelope.ack().session_id())) session->onAck(envelope.ack());
      break;
    case pb::Envelope::kSessionOpened:
      if (auto* session = find(envelope.session_opened().session_id())) {
        const bool was_closed = session->closed();
        session->onOpened(envelope.session_opened().next_seq());
        if (was_closed && !session->closed()) reportSentAgain(*session);
        if (const std::uint64_t lacking = session->takeMissingCount(); lacking > 0)
          report(
              fmt::format("session {}: the server lacks what it had acknowledged ({} of its chunks); the "
                          "spool has them, and they are sent again",
                          session->spool()->idText(), lacking));
        if (session->refused()) report("session " + session->spool()->idText() + ": " + session->trouble());
        if (session == current_) clock_sent_ns_ = 0;
        sendClockOffset();
      }
      break;
    case pb::Envelope::kSessionClosed:
      if (events_.closed) events_.closed(envelope.session_closed());
      if (auto* session = find(envelope.session_closed().session_id())) {
        const bool was_closed = session->closed();
        session->onClosed(envelope.session_closed());
        if (session != current_ && !was_closed)
          report("session " + session->spool()->idText() +
                 " of an earlier run is now in the server's database");
      }
      break;
    case pb::Envelope::kRefusal:
      handleRefusal(envelope);
      break;
    case pb::Envelope::kPong:
      if (clock_.add(envelope.pong().sender_steady_ns(), envelope.pong().receiver_steady_ns(),
                     time().nowNs()))
        sendClockOffset();
      break;
    case pb::Envelope::kWatchState:
      setWatched(envelope.watch_state().watched());
      break;
    case pb::Envelope::kTraineeMessage:
      if (events_.trainee_message) events_.trainee_message(envelope.trainee_message());
      break;
    case pb::Envelope::kNextExercise:
      if (events_.next_exercise) events_.next_exercise(envelope.next_exercise());
      break;
    case pb::Envelope::kSetAids:
      if (isForCurrentSession(envelope.set_aids().session_id()) && events_.set_aids)
        events_.set_aids(withKnownAids(envelope.set_aids()));
      break;
    case pb::Envelope::kStopLesson:
      if (isForCurrentSession(envelope.stop_lesson().session_id()) && events_.stop_lesson)
        events_.stop_lesson(envelope.stop_lesson());
      break;
    default:
      break;  // handled by the link, or from a newer server
  }
}

void Uplink::handleRefusal(const pb::Envelope& envelope) {
  const pb::Refusal& refusal = envelope.refusal();
  if (envelope.refused_request() != 0) return;  // its request was dropped
  if (auto* session = refusal.session_id().empty() ? nullptr : find(refusal.session_id())) {
    const bool waited = !session->waitsFor().empty();
    session->onRefusal(refusal);
    if (!waited && !session->waitsFor().empty())
      report("session " + session->spool()->idText() + " waits in the spool: " + session->waitsFor());
    if (session->refused()) report("session " + session->spool()->idText() + ": " + session->trouble());
    // the session moves to another server unless that one is known to have no room
    if (refusal.reason() == pb::Refusal::NO_ROOM) link_.moveOn("this server has no room: trying another");
    return;
  }
  report("the server refuses: " + refusal.text());
}

// --- the live plane: frames for viewers, status lines, clock probes

void Uplink::setWatched(bool watched) {
  const bool was_watched = watched_.exchange(watched, std::memory_order_relaxed);
  if (!watched || was_watched || !lessonRuns()) return;
  {
    // send the newest piece at once: a viewer need not wait for the next one
    const std::scoped_lock lock(mutex_);
    if (newest_ && !std::exchange(newest_sent_, true)) live_.push_back(*newest_);
  }
  pumpLive();
}

void Uplink::pumpLive() {
  assert(io_.get_executor().running_in_this_thread());
  if (!link_.online() || current_ == nullptr) return;
  std::deque<Live> live;
  {
    const std::scoped_lock lock(mutex_);
    live.swap(live_);
    frame_seq_ += live_skipped_;  // viewers see the gap
    live_skipped_ = 0;
    state_.live_frames += live.size();
    state_.live_encoded += live.size();
  }
  const pb::SessionDescription& description = current_->spool()->description();
  for (const Live& item : live) {
    const Bytes data = encodeChunk(resolutionOf(description), *item.piece.samples);
    pb::Envelope envelope;
    pb::LiveFrame& frame = *envelope.mutable_live_frame();
    frame.set_session_id(description.session_id());
    frame.set_frame_seq(frame_seq_++);
    frame.set_data(data.data(), data.size());
    frame.set_due_steady_ns(item.piece.last.time_ns);
    frame.set_capture_unix_ns(item.capture_unix_ns);
    const Bytes& cuts = item.piece.cut_memory;
    if (!cuts.empty()) frame.set_cut_memory(cuts.data(), cuts.size());
    const Bytes& paths = item.piece.paths;
    if (!paths.empty()) frame.set_paths(paths.data(), paths.size());
    if (auto encoded = encodeFrame(envelope); encoded.ok()) link_.sendLive(*encoded, true);
  }
}

void Uplink::sendStatus() {
  pb::Envelope envelope;
  pb::StationStatus& status = *envelope.mutable_station_status();
  {
    const std::scoped_lock lock(mutex_);
    status.set_layer(-1);  // before the first sample
    status.set_spool_left(state_.chunks_left);
    for (const auto& [source, text] : troubles_)
      status.set_trouble(status.trouble() + (status.trouble().empty() ? "" : "; ") + text);
    cutText(*status.mutable_trouble(), 1024);
    if (current_ != nullptr && newest_) {
      const GestureSample& last = newest_->piece.last;
      status.set_phase(last.phase);
      status.set_layer(last.layer);
      status.set_insertion_m(last.insertion_m);
      status.set_force_n(std::hypot(last.force_W_N[0], last.force_W_N[1], last.force_W_N[2]));
      status.set_samples(newest_->piece.samples_so_far);
      status.set_fault(last.fault);
      status.set_warnings(std::exchange(flags_since_status_, 0));
    }
    status.set_peak_force_n(facts_.peak_force_N);
    status.set_force_limit_n(facts_.force_limit_N);
    status.set_tissue(facts_.layer_name);
    cutText(*status.mutable_tissue(), 64);
    std::size_t room = kMaxHazardBytes;
    for (const std::string& name : facts_.hazards_touched) {
      if (name.size() + 3 > room) break;
      room -= name.size() + 3;  // including its tag and length
      status.add_hazards_touched(name);
    }
    for (const pb::AlarmCount& count : facts_.alarms) {
      *status.add_alarms() = count;
      cutText(*status.mutable_alarms()->rbegin()->mutable_detail(), 40);
    }
    status.set_live_dropped(state_.live_dropped - dropped_before_);
  }
  if (lessonRuns()) {
    const pb::SessionDescription& description = current_->spool()->description();
    status.set_session_id(description.session_id());
    status.set_exercise_id(description.exercise_id());
    status.set_started_unix_ns(description.started_unix_ns());
  }
  status.set_missed_ticks(missed_ticks_.load(std::memory_order_relaxed));
  status.set_hand_raised(hand_raised_.load(std::memory_order_relaxed));
  status.set_wakeup_p99_us(wakeup_p99_us_.load(std::memory_order_relaxed));
  if (auto encoded = encodeFrame(envelope); encoded.ok()) link_.sendLive(*encoded, false);
}

void Uplink::sendProbe() {
  pb::Envelope envelope;
  envelope.mutable_ping()->set_id(++probes_);
  envelope.mutable_ping()->set_sender_steady_ns(time().nowNs());
  link_.send(envelope);
}

void Uplink::sendClockOffset() {
  const auto& best = clock_.best();
  if (!best || current_ == nullptr || !current_->opened() || clock_sent_ns_ == best->round_trip_ns) return;
  pb::Envelope envelope;
  pb::ClockOffset& offset = *envelope.mutable_clock_offset();
  offset.set_session_id(current_->spool()->description().session_id());
  offset.set_offset_ns(best->offset_ns);
  offset.set_round_trip_ns(best->round_trip_ns);
  link_.send(envelope);
  clock_sent_ns_ = best->round_trip_ns;
}

}  // namespace needlelab
