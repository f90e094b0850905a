#include "client/net/uplink/uplink_session.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <utility>

#include "common/base/planted_bug.h"
#include "common/gesture/chunk.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

constexpr std::int64_t kReceiptEvery_ns = 2'000'000'000;
constexpr std::int64_t kAskAgain_ns = 2'000'000'000;
// a full disk lasts a while; after room was made, deliveries resume within this time
constexpr std::int64_t kRoomRetry_ns = 15'000'000'000;
// limit for demands to go back without an ack in between; beyond it, sending again does not help
constexpr std::uint32_t kMaxReopened = 20;

// the chunk as changed by PlantedBug::kSampleLostAtReconnection
Bytes withoutLastSample(const pb::SessionDescription& description, const Bytes& chunk) {
  auto samples = decodeChunk(chunk);
  if (!samples.ok() || samples->size() < 2) return chunk;
  samples->pop_back();
  return encodeChunk(resolutionOf(description), *samples);
}

}  // namespace

UplinkSession::UplinkSession(std::shared_ptr<SpoolSession> spool, std::string station, TimeSource& time)
    : spool_(std::move(spool)), station_(std::move(station)), time_(time) {
  assert(spool_ != nullptr);
  const SpoolReceipt receipt = spool_->receipt();
  committed_ = sent_ = receipt.committed;
  safe_ = receipt.safe;
  if (receipt.closed) state_ = State::kClosed;
}

std::optional<pb::Envelope> UplinkSession::next(bool may_send_chunk) {
  if (state_ == State::kNew) {
    if (time_.nowNs() < not_before_ns_) return std::nullopt;
    state_ = State::kOpening;
    return openMessage();
  }
  if (state_ == State::kClosed && std::exchange(end_due_, false)) return closeMessage(spool_->contents());
  if (state_ == State::kClosed && !asked_ && (end_unknown_ || spool_->contents().chunks > 0)) {
    if (time_.nowNs() < not_before_ns_) return std::nullopt;
    asked_ = asking_ = true;
    return openMessage();
  }
  if (state_ != State::kOpen) return std::nullopt;
  assert(sent_ >= committed_);
  const SpoolContents contents = spool_->contents();
  if (sent_ < contents.chunks) return may_send_chunk ? nextChunk() : std::nullopt;
  if (!contents.ended || committed_ < contents.chunks) return std::nullopt;
  state_ = State::kClosing;
  return closeMessage(contents);
}

pb::Envelope UplinkSession::openMessage() const {
  pb::Envelope envelope;
  pb::SessionDescription& description = *envelope.mutable_open_session()->mutable_description();
  description = spool_->description();
  // recorded before this station had a key; it is ours, because it is in our spool
  if (description.station().empty()) description.set_station(station_);
  return envelope;
}

std::optional<pb::Envelope> UplinkSession::nextChunk() {
  assert(state_ == State::kOpen && sent_ < spool_->contents().chunks);
  auto data = spool_->readChunk(sent_);
  if (!data.ok()) {
    refuse(fmt::format("chunk {} cannot be read from the spool: {}", sent_, data.error().message));
    return std::nullopt;
  }
  if (reconnected_ && planted(PlantedBug::kSampleLostAtReconnection))
    *data = withoutLastSample(spool_->description(), *data);
  pb::Envelope envelope;
  pb::Chunk& chunk = *envelope.mutable_chunk();
  chunk.set_session_id(spool_->description().session_id());
  chunk.set_seq(sent_++);
  chunk.set_data(data->data(), data->size());
  return envelope;
}

pb::Envelope UplinkSession::closeMessage(const SpoolContents& contents) const {
  pb::Envelope envelope;
  pb::CloseSession& close = *envelope.mutable_close_session();
  close.set_session_id(spool_->description().session_id());
  close.set_chunks(contents.chunks);
  close.set_samples(contents.samples);
  if (contents.hash) close.set_hash(contents.hash->data(), contents.hash->size());
  const SpoolLoss& loss = contents.loss;
  const SpoolDamage& damage = contents.damage;
  // a session with lost samples is never complete
  close.set_interrupted(contents.interrupted || loss.samples > 0 || damage.samples > 0);
  close.set_samples_lost(loss.samples + damage.samples);
  close.set_lost_from_tick(damage.samples == 0 ? loss.from_tick
                           : loss.samples == 0 ? damage.from_tick
                                               : std::min(loss.from_tick, damage.from_tick));
  close.set_samples_damaged(damage.samples);
  close.set_chunks_damaged(damage.chunks);
  return envelope;
}

void UplinkSession::onConnected(AtServer at_server) {
  asked_ = asking_ = end_due_ = false;
  end_unknown_ = at_server == AtServer::kUnknown;
  // the restored backup has all its chunks but not its end
  if (closed() && at_server == AtServer::kOpen) sendAgain(committed_);
}

void UplinkSession::onOpened(std::uint64_t next_seq) {
  if (closed() && asking_) {
    if (next_seq < spool_->contents().chunks)
      sendAgain(next_seq);
    else if (end_unknown_)
      endAgain();
    asking_ = end_due_;
  }
  if (state_ != State::kOpening) return;
  if (const Status settled = spool_->settle(next_seq); !settled.ok())
    return refuse("its damage cannot be noted in the spool: " + settled.error().message);
  const SpoolContents contents = spool_->contents();
  if (next_seq > contents.chunks) {
    refuse(fmt::format("the server has {} chunks of it, the spool only {}; the folder {} stays as it is",
                       next_seq, contents.chunks, spool_->folder().string()));
    return;
  }
  assert(state_ == State::kOpening && next_seq <= contents.chunks);
  // the database decides: after a restore it may have fewer chunks than it once acknowledged
  if (next_seq < committed_) lacking_ = committed_ - next_seq;
  committed_ = sent_ = next_seq;
  waits_for_.clear();
  state_ = State::kOpen;
}

// the server was restored from an older backup and has lost the closed session
void UplinkSession::sendAgain(std::uint64_t next_seq) {
  assert(closed());
  committed_ = sent_ = next_seq;
  // the last chunk is safe only together with the session's end, which no verified backup has
  const std::uint64_t chunks = spool_->contents().chunks;
  safe_ = std::min({safe_, next_seq, chunks - std::min<std::uint64_t>(chunks, 1)});
  verdict_.Clear();
  state_ = State::kNew;
  // save the receipt first: from now on the spool must keep the session
  saveReceipt(true);
  if (auto loaded = spool_->reload(); !loaded.ok()) {
    refuse("the server has lost it, and it cannot be read from the spool: " + loaded.error().message);
  }
}

// no message can ask whether the server has the end, so it is sent again
void UplinkSession::endAgain() {
  assert(closed() && asking_);
  end_due_ = true;
  // until the server reports in the ack after its answer that a backup has the end, too
  const std::uint64_t chunks = spool_->contents().chunks;
  if (chunks == 0 || safe_ < chunks) return;
  safe_ = chunks - 1;
  saveReceipt(true);
}

void UplinkSession::onAck(const pb::Ack& ack) {
  if (closed() && ack.safe_seqs() > safe_) {
    // a backup covers it: the spool may remove the session now
    safe_ = std::min(ack.safe_seqs(), committed_);
    saveReceipt(true);
  }
  if (finished()) return;
  const std::uint64_t committed = std::min(ack.committed_seqs(), spool_->contents().chunks);
  if (committed > committed_) reopened_ = 0;
  committed_ = std::max(committed_, committed);
  safe_ = std::max(safe_, std::min(ack.safe_seqs(), committed_));
  sent_ = std::max(sent_, committed_);
  assert(inFlight() == sent_ - committed_);
}

void UplinkSession::onClosed(const pb::SessionClosed& closed) {
  verdict_ = closed;
  waits_for_.clear();
  state_ = State::kClosed;
  asked_ = true;  // this connection has just answered
  asking_ = end_due_ = false;
  committed_ = sent_ = spool_->contents().chunks;
  saveReceipt(true);
}

void UplinkSession::onRefusal(const pb::Refusal& refusal) {
  if (finished()) {
    // too many questions: ask again a little later, and send nothing else before. Otherwise ask on the next
    // connection
    if (asking_ && refusal.reason() == pb::Refusal::RATE_LIMITED) {
      asked_ = end_due_ = false;
      not_before_ns_ = time_.nowNs() + kAskAgain_ns;
    } else {
      asking_ = false;
    }
    return;
  }
  switch (refusal.reason()) {
    case pb::Refusal::GAP:
    case pb::Refusal::UNKNOWN_SESSION:
      // Ask for the server's position and continue from there. The server also refuses every chunk still in
      // flight; those answers arrive before the answer to our question, and are ignored.
      if (state_ == State::kNew || state_ == State::kOpening) return;
      if (++reopened_ > kMaxReopened)
        return refuse(
            fmt::format("the server asked {} times to go back and acknowledged nothing in between: {}",
                        kMaxReopened, refusal.text()));
      state_ = State::kNew;
      sent_ = committed_;
      return;
    case pb::Refusal::CONTRADICTION:
    case pb::Refusal::INVALID:
    case pb::Refusal::ROLE:
    case pb::Refusal::TOO_LARGE:
    case pb::Refusal::CONFLICT:
    case pb::Refusal::NOT_FOUND:
      return refuse("the server refuses it: " + refusal.text());
    case pb::Refusal::NO_ROOM:
      // the spool keeps everything; chunks in flight are not stored
      state_ = State::kNew;
      sent_ = committed_;
      waits_for_ = refusal.text();
      not_before_ns_ = time_.nowNs() + kRoomRetry_ns;
      return;
    default:
      // a temporary refusal: ask again a little later, unless it ends the connection
      if (state_ == State::kNew || state_ == State::kOpen) return;
      state_ = State::kNew;
      not_before_ns_ = time_.nowNs() + kAskAgain_ns;
      return;
  }
}

void UplinkSession::refuse(std::string why) {
  assert(!finished() && !why.empty());
  state_ = State::kRefused;
  trouble_ = std::move(why);
}

void UplinkSession::onConnectionLost() {
  reconnected_ = true;
  if (finished()) return;
  state_ = State::kNew;
  sent_ = committed_;
}

void UplinkSession::saveReceipt(bool now) {
  const std::int64_t now_ns = time_.nowNs();
  if (!now && now_ns - saved_ns_ < kReceiptEvery_ns) return;
  saved_ns_ = now_ns;
  SpoolReceipt receipt = spool_->receipt();
  receipt.committed = committed_;
  receipt.safe = safe_;
  if (closed() && !receipt.closed) receipt.closed_at_ns = spool_->clock().nowNs();
  receipt.closed = closed();
  // if the receipt cannot be written, the next start only has to ask the server
  static_cast<void>(spool_->setReceipt(receipt));
}

}  // namespace needlelab
