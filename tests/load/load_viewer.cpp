#include "tests/load/load_viewer.h"

#include <utility>

#include "common/base/time/clock.h"
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
      link_(io, {.lasting = std::chrono::milliseconds(0), .seed = shared.seed * 7919 + index}, handlers()) {
  for (std::size_t i = index_; i < shared_.stations.size(); i += of_) {
    by_name_[shared_.stations[i].name] = {i, 0, false};
    ++watched_;
  }
  streams_.resize(shared_.stations.size());
}

void LoadViewer::connect() {
  ClientConfig config = shared_.clientOf(index_);
  config.login = login_;
  link_.logIn(std::move(config));
}

LinkHandlers LoadViewer::handlers() {
  return {.accept = {},
          .connected = [this](const pb::Welcome&) { onConnected(); },
          .message = [this](pb::Envelope& envelope) { onMessage(envelope); },
          .judge = {},
          .away =
              [this](const LinkEnd& end) {
                last_error_ = end.was_connected ? end.channel_text : end.error.message;
                subscribed_ = 0;
                told_ = 0;
              }};
}

void LoadViewer::onConnected() {
  ++totals_.connections;
  server_ = shared_.numberOf(link_.server());
  std::uint32_t number = 0;
  for (std::size_t i = index_; i < shared_.stations.size(); i += of_) {
    pb::Envelope envelope;
    envelope.mutable_subscribe()->set_subscription(++number);
    envelope.mutable_subscribe()->set_station(shared_.stations[i].name);
    link_.send(envelope);
  }
  // frames missed between two connections do not count as drops
  for (auto& [name, watched] : by_name_) watched.seen = false;
}

void LoadViewer::onMessage(const pb::Envelope& envelope) {
  if (envelope.has_live_frame()) onFrame(envelope.live_frame());
  if (envelope.has_subscribed()) ++subscribed_;
  if (envelope.has_refusal()) last_error_ = envelope.refusal().text();
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
  // the station restarts with 0 on each connection
  if (watched.seen && frame.frame_seq() > watched.next_frame)
    totals_.gaps += frame.frame_seq() - watched.next_frame;
  watched.seen = true;
  watched.next_frame = frame.frame_seq() + 1;
  ++totals_.frames;
  totals_.samples += samples->size();
  const StationPlan& plan = shared_.stations[watched.station];
  const std::int64_t due_ns =
      plan.start_ns.load(std::memory_order_relaxed) + static_cast<std::int64_t>(oldest.tick) * kTick_ns;
  const std::int64_t late_ns = steadyNowNs() - due_ns;
  totals_.live.add(late_ns);
  if (plan.server.load(std::memory_order_relaxed) != server_) totals_.elsewhere.add(late_ns);
}

void LoadViewer::stop() {
  link_.stop("the load ends");
}

ViewerCrowd::ViewerCrowd(LoadShared& shared, const pb::Login& login, std::size_t viewers) {
  for (std::size_t i = 0; i < viewers; ++i)
    viewers_.push_back(std::make_unique<LoadViewer>(shared, login, i, viewers, totals_, net_.io()));
}

ViewerCrowd::~ViewerCrowd() {
  stop();
}

void ViewerCrowd::connect() {
  net_.call([this] {
    for (const auto& viewer : viewers_) viewer->connect();
  });
}

std::size_t ViewerCrowd::watching() {
  return net_.call([this] {
    std::size_t count = 0;
    for (const auto& viewer : viewers_) count += viewer->watching() ? 1 : 0;
    return count;
  });
}

std::string ViewerCrowd::lastError() {
  return net_.call([this] {
    std::string error;
    for (const auto& viewer : viewers_)
      if (!viewer->lastError().empty()) error = viewer->lastError();
    return error;
  });
}

void ViewerCrowd::pause(std::size_t viewer, std::chrono::milliseconds time) {
  net_.call([this, viewer, time] { viewers_[viewer]->pause(time); });
}

void ViewerCrowd::stop() {
  if (stopped_) return;
  stopped_ = true;
  net_.call([this] {
    for (const auto& viewer : viewers_) viewer->stop();
  });
  for (int i = 0; i < 3; ++i) net_.call([] {});
  net_.stop();
}

}  // namespace needlelab::test
