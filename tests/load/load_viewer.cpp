#include "tests/load/load_viewer.h"

#include <utility>

#include "common/base/clock.h"
#include "common/gesture/chunk.h"
#include "common/wire/protocol.h"

namespace needlelab::test {

LoadViewer::LoadViewer(LoadShared& shared, pb::Login login, std::size_t index, std::size_t of,
                       ViewerTotals& totals, asio::io_context& io)
    : shared_(shared),
      login_(std::move(login)),
      index_(index),
      of_(of),
      totals_(totals),
      backoff_(shared.seed * 7919 + index),
      timer_(io) {
  for (std::size_t i = index_; i < shared_.stations.size(); i += of_) {
    by_name_[shared_.stations[i].name] = {i, 0, false};
    ++watched_;
  }
  streams_.resize(shared_.stations.size());
}

Task<> LoadViewer::run(std::shared_ptr<LoadViewer> self) {
  LoadViewer& me = *self;
  while (!me.stopping_) {
    ClientConfig config = me.shared_.client;
    config.login = me.login_;
    auto connection = co_await connectClient(std::move(config));
    if (connection.ok()) {
      me.channel_ = connection->channel;
      me.backoff_.reset();
      ++me.totals_.connections;
      co_await me.serve();
      me.last_error_ = me.channel_->closeText();
      me.channel_.reset();
      me.subscribed_ = 0;
      me.told_ = 0;
    } else {
      me.last_error_ = connection.error().message;
    }
    if (me.stopping_) break;
    me.timer_.expires_after(me.backoff_.next());
    co_await me.timer_.async_wait(kUseTuple);
  }
}

Task<> LoadViewer::serve() {
  const std::shared_ptr<Channel> channel = channel_;
  std::uint32_t number = 0;
  for (std::size_t i = index_; i < shared_.stations.size(); i += of_) {
    pb::Envelope envelope;
    envelope.mutable_subscribe()->set_subscription(++number);
    envelope.mutable_subscribe()->set_station(shared_.stations[i].name);
    channel->send(envelope);
  }
  // what was missed between two connections is no drop
  for (auto& [name, watched] : by_name_) watched.seen = false;
  for (;;) {
    if (pause_.count() > 0) {
      timer_.expires_after(std::exchange(pause_, std::chrono::milliseconds(0)));
      co_await timer_.async_wait(kUseTuple);
    }
    auto envelope = co_await channel->receive();
    if (!envelope.ok()) {
      channel->finish(CloseReason::kProtocol, envelope.error().message);
      co_return;
    }
    switch (envelope->body_case()) {
      case pb::Envelope::kLiveFrame:
        onFrame(envelope->live_frame());
        break;
      case pb::Envelope::kSubscribed:
        ++subscribed_;
        break;
      case pb::Envelope::kPing:
        channel->send(pongTo(envelope->ping()));
        break;
      case pb::Envelope::kRefusal:
        last_error_ = envelope->refusal().text();
        break;
      default:
        break;
    }
  }
}

void LoadViewer::onFrame(const pb::LiveFrame& frame) {
  totals_.bytes += frame.data().size();
  if (frame.dropped_for_you() > told_)
    totals_.told += frame.dropped_for_you() - std::exchange(told_, frame.dropped_for_you());
  const auto samples = decodeChunk(viewOf(frame.data()));
  const auto found = by_name_.find(frame.station());
  if (!samples.ok() || found == by_name_.end()) {
    ++totals_.corrupt;
    return;
  }
  Watched& watched = found->second;
  auto& stream = streams_[watched.station];
  if (!stream) stream = std::make_unique<StationStream>(*shared_.pool, shared_.seed, watched.station);
  const GestureSample& oldest = samples->front();
  if (oldest.time_ns != stream->timeOf(oldest.tick)) {
    ++totals_.corrupt;
    return;
  }
  // the station numbers anew on each of its connections
  if (watched.seen && frame.frame_seq() > watched.next_frame)
    totals_.gaps += frame.frame_seq() - watched.next_frame;
  watched.seen = true;
  watched.next_frame = frame.frame_seq() + 1;
  ++totals_.frames;
  totals_.samples += samples->size();
  const std::int64_t due_ns = shared_.stations[watched.station].start_ns.load(std::memory_order_relaxed) +
                              static_cast<std::int64_t>(oldest.tick) * kTick_ns;
  totals_.live.add(steadyNowNs() - due_ns);
}

void LoadViewer::stop() {
  stopping_ = true;
  timer_.cancel();
  if (channel_) {
    pb::Envelope bye;
    bye.mutable_bye()->set_reason("the load ends");
    channel_->finish(CloseReason::kLocal, "the load ends", &bye);
  }
}

}  // namespace needlelab::test
