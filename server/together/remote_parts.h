/// Represents in the hub the stations of other servers, and other servers that watch.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>

#include "server/live/hub/hub.h"

namespace needlelab {

/// Another server's claim to have a station.
struct RemoteClaim {
  std::uint64_t epoch = 0;
  std::int64_t first_ns = 0, last_ns = 0;
  pb::StationStatus status;
};

/// A station claimed by one or more other servers. In the hub while attached (`holder` is set).
class RemoteStation : public HubPeer {
 public:
  /// `on_watched`: called when its viewers here or their rate have changed.
  RemoteStation(std::string name, std::function<void(RemoteStation&)> on_watched)
      : station(std::move(name)), on_watched_(std::move(on_watched)) {}
  [[nodiscard]] bool isElsewhere() const override { return true; }
  void sendControl(const pb::Envelope& /*a station hears only what is asked of its server*/) override {}
  void sendLive(Frame /*frame*/, bool /*counted*/) override {}
  void onWatched(bool is_watched, double at_rate_hz) override {
    watched = is_watched;
    rate_hz = at_rate_hz;
    on_watched_(*this);
  }

  const std::string station;
  std::map<std::string, RemoteClaim> claims;  // by server
  std::uint64_t newest_epoch = 0;             // of all claims within RemoteLiveSettings::overtaken_lasts
  std::int64_t newest_ns = 0;                 // when it was last reported
  std::string holder;                         // the server that has it; empty: not attached
  std::uint64_t epoch = 0;                    // of the holder's claim
  bool watched = false;
  double rate_hz = 0;
  std::int64_t watch_said_ns = 0;
  std::uint64_t last_frame = 0;  // number of the holder's last frame

 private:
  const std::function<void(RemoteStation&)> on_watched_;
};

/// Publishes the frames of a station of this server.
class RemoteOutlet : public HubPeer {
 public:
  struct Watcher {
    double rate_hz = 0;
    std::int64_t until_ns = 0;
  };
  using Publish = std::function<void(RemoteOutlet&, const std::string& frame)>;
  RemoteOutlet(Hub& hub, std::string name, Publish publish)
      : station(std::move(name)), hub_(hub), publish_(std::move(publish)) {}
  RemoteOutlet(const RemoteOutlet&) = delete;
  RemoteOutlet& operator=(const RemoteOutlet&) = delete;
  ~RemoteOutlet() override { hub_.detachViewer(*this); }
  void sendControl(const pb::Envelope& /*presence has the statuses*/) override {}
  void sendLive(Frame frame, bool counted) override {
    if (counted) publish_(*this, *frame);
  }

  const std::string station;
  std::map<std::string, Watcher> watchers;  // by server
  double rate_hz = -1;                      // of its subscription; below 0: not subscribed

 private:
  Hub& hub_;
  const Publish publish_;
};

}  // namespace needlelab
