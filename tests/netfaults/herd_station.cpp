#include "tests/netfaults/herd_station.h"

#include <algorithm>
#include <utility>

#include "common/base/uuid.h"
#include "common/gesture/chunk.h"
#include "common/wire/protocol.h"
#include "tests/support/random.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

constexpr std::uint64_t kWindow = 64;

/// The same words for the same kind of failure.
std::string kindOf(const Error& error) {
  for (const char* kind : {"refused", "reset", "no answer within", "no log-in within", "RATE_LIMITED",
                           "CONFLICT", "closed the connection", "bye"})
    if (error.message.find(kind) != std::string::npos) return kind;
  return error.message.substr(0, 120);
}

}  // namespace

HerdChunks::HerdChunks(std::size_t most) {
  Random random(1);
  double x_m = 0, v_m_s = 0;
  for (std::size_t seq = 0; seq < most; ++seq) {
    std::vector<GestureSample> samples(kSamples);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      v_m_s += random.in(-1e-4, 1e-4) - 1e-3 * v_m_s;
      x_m += 1e-3 * v_m_s;
      samples[i].tick = seq * kSamples + i;
      samples[i].time_ns = static_cast<std::int64_t>(samples[i].tick) * 1'000'000;
      samples[i].p_WT_m[2] = x_m;
      samples[i].force_W_N[2] = 300 * x_m;
    }
    const Bytes bytes = encodeChunk(Resolution::standard(), samples);
    chunks_.emplace_back(bytes.begin(), bytes.end());
  }
}

HerdStation::HerdStation(asio::io_context& io, ClientConfig config, std::uint64_t seed,
                         const HerdChunks& chunks, HerdTally& tally)
    : io_(io),
      config_(std::move(config)),
      backoff_(seed),
      chunks_(chunks),
      tally_(tally),
      began_(HerdClock::now()) {
  const Uuid id = makeUuidV7();
  id_.assign(id.begin(), id.end());
}

std::uint64_t HerdStation::made() const {
  if (ending_) return end_at_;
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(HerdClock::now() - began_).count();
  return std::min<std::uint64_t>(static_cast<std::uint64_t>(seconds) + 1, chunks_.most());
}

Task<> HerdStation::run(HerdStation& self) {
  while (!self.complete_ && self.trouble_.empty()) {
    const auto began = HerdClock::now();
    auto connection = co_await connectClient(self.config_);
    if (connection.ok()) {
      self.tally_.connected.push_back(HerdClock::now());
      co_await self.serve(connection->channel);
      self.open_ = self.closing_ = false;
      if (self.complete_) co_return;
      ++self.tally_.lost;
      // as the uplink: only what lasted is a success
      if (HerdClock::now() - began > 10s) self.backoff_.reset();
    } else {
      ++self.tally_.failed[kindOf(connection.error())];
    }
    asio::steady_timer timer(self.io_, self.backoff_.next());
    co_await timer.async_wait(kUseTuple);
  }
}

Task<> HerdStation::serve(std::shared_ptr<Channel> channel) {
  sent_ = committed_;
  backlog_ = made();
  channel->send(openMessage());
  asio::co_spawn(io_, feed(*this, channel), rethrow);
  for (;;) {
    auto got = co_await channel->receive();
    if (!got.ok()) break;
    handle(*channel, *got);
    if (complete_) {
      channel->finish(CloseReason::kLocal, "done");
      break;
    }
  }
  channel->finish(CloseReason::kLocal, "over");
}

// a chunk each second, and Pings would be the channel's own
Task<> HerdStation::feed(HerdStation& self, std::shared_ptr<Channel> channel) {
  asio::steady_timer timer(self.io_);
  while (!channel->closing()) {
    self.pump(*channel);
    timer.expires_after(250ms);
    co_await timer.async_wait(kUseTuple);
  }
}

void HerdStation::pump(Channel& channel) {
  if (!open_ || channel.closing()) return;
  if (ending_ && end_at_ == 0) {
    ending_ = false;
    const std::uint64_t all = made();
    ending_ = true;
    end_at_ = std::max(all, sent_);
  }
  while (sent_ < made() && sent_ < committed_ + kWindow) {
    pb::Envelope envelope;
    envelope.mutable_chunk()->set_session_id(id_);
    envelope.mutable_chunk()->set_seq(sent_);
    envelope.mutable_chunk()->set_data(chunks_.data(sent_));
    if (!channel.send(envelope)) return;
    ++sent_;
  }
  if (ending_ && committed_ == end_at_ && !std::exchange(closing_, true)) channel.send(closeMessage());
}

void HerdStation::handle(Channel& channel, const pb::Envelope& envelope) {
  if (envelope.has_session_opened() && !open_) {
    const std::uint64_t next = envelope.session_opened().next_seq();
    if (next < committed_) ++tally_.went_back;
    committed_ = sent_ = next;
    open_ = true;
  } else if (envelope.has_ack()) {
    committed_ = std::max(committed_, envelope.ack().committed_seqs());
  } else if (envelope.has_ping()) {
    channel.send(pongTo(envelope.ping()));
  } else if (envelope.has_session_closed()) {
    complete_ = envelope.session_closed().state() == pb::SESSION_COMPLETE;
    if (!complete_) trouble_ = "not complete";
  } else if (envelope.has_refusal() && !envelope.refusal().fatal()) {
    trouble_ = reasonName(envelope.refusal().reason()) + ": " + envelope.refusal().text();
  }
  if (whole() && !whole_at_) whole_at_ = HerdClock::now();
  pump(channel);
}

pb::Envelope HerdStation::openMessage() const {
  pb::Envelope envelope;
  pb::SessionDescription& d = *envelope.mutable_open_session()->mutable_description();
  d.set_session_id(id_);
  d.set_station(config_.login.station().station());
  d.set_trainee("tina");
  d.set_exercise_id("practice");
  d.set_profile_id("practice");
  d.set_profile_json("{}");
  d.set_engine_version("test");
  d.set_rate_hz(1000);
  d.set_started_unix_ns(1'000'000'000);
  setResolution(d, Resolution::standard());
  return envelope;
}

pb::Envelope HerdStation::closeMessage() const {
  SessionHash hash;
  for (std::uint64_t seq = 0; seq < end_at_; ++seq) hash.update(viewOf(chunks_.data(seq)));
  const Digest digest = hash.digest();
  pb::Envelope envelope;
  pb::CloseSession& close = *envelope.mutable_close_session();
  close.set_session_id(id_);
  close.set_chunks(end_at_);
  close.set_samples(end_at_ * HerdChunks::kSamples);
  close.set_hash(digest.data(), digest.size());
  return envelope;
}

}  // namespace needlelab::test
