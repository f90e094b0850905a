#include "tests/netfaults/fault_station.h"
#include "tests/support/patience.h"

#include <algorithm>
#include <utility>

#include "tests/unit/client/net/spool/spool_samples.h"

namespace needlelab::test {

using namespace std::chrono_literals;

ChannelLimits shortLimits() {
  ChannelLimits limits;
  limits.handshake_timeout = kPatience;  // includes a password check, on a possibly busy machine
  limits.idle_timeout = 1000ms;
  limits.write_timeout = 600ms;
  limits.keepalive = 300ms;
  limits.close_grace = 100ms;
  return limits;
}

void withShortLimits(ServerOptions& options) {
  options.limits = shortLimits();
}

FaultStation::FaultStation(RunningServer& server, const std::string& name, std::uint16_t port,
                           const StationSettings& settings)
    : name_(name) {
  spool_ = std::move(*Spool::open(folder_.path()));
  pb::SessionDescription description = describeSession(makeUuidV7());
  description.set_station(name);
  session_ = *spool_->create(description);

  UplinkConfig config;
  config.client = server.config(stationLogin(name, server.addStation(name)));
  config.client.server.port = port;
  for (const std::uint16_t other : settings.other_ports)
    config.client.others.push_back({config.client.server.host, other});
  config.client.limits = settings.limits;
  config.client.connect_timeout = settings.connect_timeout;
  config.first_retry = 20ms;
  config.max_retry = 300ms;
  const auto keep = [this](std::vector<std::string>& where, const std::string& text) {
    const std::scoped_lock lock(mutex_);
    where.push_back(text);
  };
  UplinkEvents events;
  events.report = [this, keep](const std::string& text) { keep(said_, text); };
  events.trainee_message = [this, keep](const pb::TraineeMessage& m) { keep(heard_, m.text()); };
  events.next_exercise = [this, keep](const pb::NextExercise& n) { keep(heard_, n.exercise_id()); };
  uplink_ = std::make_unique<Uplink>(config, events);
  uplink_->add(session_, true);
  recorder_ = std::thread([this, settings] { record(settings); });
  watcher_ = std::thread([this] { watchAcks(); });
}

FaultStation::~FaultStation() {
  stop_ = true;
  recorder_.join();
  watcher_.join();
  uplink_->stop();
}

void FaultStation::record(const StationSettings& settings) {
  auto due = std::chrono::steady_clock::now();
  for (std::uint64_t seq = 0; seq < settings.chunks && !stop_; ++seq) {
    const auto samples = samplesFrom(seq * settings.samples, settings.samples);
    const Bytes chunk = encodeChunk(Resolution::standard(), samples);
    EXPECT_TRUE(session_->appendChunk(chunk, samples.size()).ok());
    if (settings.period > 0ms) {
      EXPECT_TRUE(session_->sync().ok());
      uplink_->wake();
      due += settings.period;
      std::this_thread::sleep_until(due);
    }
  }
  EXPECT_TRUE(session_->sync().ok());
  EXPECT_TRUE(session_->end(false).ok());
  uplink_->wake();
}

void FaultStation::watchAcks() {
  std::uint64_t highest = 0;
  while (!stop_) {
    const std::uint64_t committed = uplink_->state().current_committed;
    if (committed < highest) ++went_back_;
    highest = std::max(highest, committed);
    std::this_thread::sleep_for(2ms);
  }
}

bool FaultStation::waitUntilDone(std::chrono::milliseconds patience) {
  const auto end = std::chrono::steady_clock::now() + patience;
  // waitUntilDone gives up on a refused log-in; a bad network can briefly look like one
  while (std::chrono::steady_clock::now() < end) {
    if (uplink_->waitUntilDone(50ms) && session_->contents().ended)
      return state().current_verdict.has_value();
    std::this_thread::sleep_for(2ms);
  }
  return false;
}

void FaultStation::expectWhole(RunningServer& server) const {
  SCOPED_TRACE(name_);
  const SpoolContents contents = session_->contents();
  const std::string id = session_->description().session_id();
  const UplinkState state = uplink_->state();
  ASSERT_TRUE(state.current_verdict.has_value()) << state.current_trouble << state.error;
  EXPECT_EQ(state.current_verdict->state(), pb::SESSION_COMPLETE);
  EXPECT_EQ(state.chunks_left, 0u);
  EXPECT_EQ(went_back_.load(), 0u) << "an acknowledgement went back";

  // exactly once: this number of chunks, with the spool's bytes, in the spool's order
  std::vector<std::string> stored;
  for (;;) {
    pb::Request request;
    request.mutable_read_chunks()->set_session_id(id);
    request.mutable_read_chunks()->set_from_seq(stored.size());
    request.mutable_read_chunks()->set_max_chunks(200);
    const pb::Reply reply = server.asAdmin(request);
    for (const pb::Chunk& chunk : reply.chunks().chunks()) {
      EXPECT_EQ(chunk.seq(), stored.size());
      stored.push_back(chunk.data());
    }
    if (reply.chunks().end() || reply.chunks().chunks().empty()) break;
  }
  ASSERT_EQ(stored.size(), contents.chunks);
  SessionHash hash;
  std::uint64_t tick = 0;
  for (std::uint64_t seq = 0; seq < stored.size(); ++seq) {
    ASSERT_EQ(stored[seq], std::string(textOf(*session_->readChunk(seq)))) << "chunk " << seq;
    hash.update(viewOf(stored[seq]));
    const auto samples = decodeChunk(viewOf(stored[seq]));
    ASSERT_TRUE(samples.ok());
    for (const GestureSample& sample : *samples) {
      ASSERT_EQ(sample.tick, tick++);
      ASSERT_TRUE(isSampleOfItsTick(sample)) << "tick " << sample.tick;
    }
  }
  EXPECT_EQ(tick, contents.samples);
  EXPECT_EQ(hash.digest(), contents.hash);

  // and the server's own record of it
  pb::Request ask;
  ask.mutable_get_session()->set_session_id(id);
  const pb::SessionInfo info = server.asAdmin(ask).session();
  EXPECT_EQ(info.state(), pb::SESSION_COMPLETE);
  ask.mutable_verify_session()->set_session_id(id);
  EXPECT_TRUE(server.asAdmin(ask).verified().ok());
}

std::vector<std::string> FaultStation::said() const {
  const std::scoped_lock lock(mutex_);
  return said_;
}
std::vector<std::string> FaultStation::heard() const {
  const std::scoped_lock lock(mutex_);
  return heard_;
}

}  // namespace needlelab::test
