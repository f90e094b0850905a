/// What stands in the hub for stations of other servers, and for other servers that watch. Private to
/// remote_*.cpp.
#pragma once

#include <map>
#include <string>
#include <utility>

#include "server/live/remote_live.h"

namespace needlelab {

/// A station that another server has, or several say so. In the hub while `attached`.
class RemoteLive::Remote : public HubPeer {
 public:
  Remote(RemoteLive& live, std::string name) : station(std::move(name)), live_(live) {}
  [[nodiscard]] bool isElsewhere() const override { return true; }
  void sendControl(const pb::Envelope& /*a station hears only what is asked of its server*/) override {}
  void sendLive(Frame /*frame*/, bool /*counted*/) override {}
  void onWatched(bool is_watched, double at_rate_hz) override {
    watched = is_watched;
    rate_hz = at_rate_hz;
    live_.carrier_.listenTo(station, watched);
    live_.sayWatch(*this);
  }

  const std::string station;
  std::map<std::string, Claim> claims;  // by server
  std::uint64_t newest_epoch = 0;       // of all claims within Settings::overtaken_lasts
  std::int64_t newest_ns = 0;           // when it was last said
  std::string holder;                   // the server that has it; empty: it is not attached
  std::uint64_t epoch = 0;              // of the holder's claim
  bool watched = false;
  double rate_hz = 0;
  std::int64_t watch_said_ns = 0;
  std::uint64_t last_frame = 0;  // number of the holder's last one

 private:
  RemoteLive& live_;
};

/// Publishes the frames of a station of this server.
class RemoteLive::Outlet : public HubPeer {
 public:
  struct Watcher {
    double rate_hz = 0;
    std::int64_t until_ns = 0;
  };
  Outlet(RemoteLive& live, std::string name) : station(std::move(name)), live_(live) {}
  Outlet(const Outlet&) = delete;
  Outlet& operator=(const Outlet&) = delete;
  ~Outlet() override { live_.hub_.detachViewer(*this); }
  void sendControl(const pb::Envelope& /*presence has the statuses*/) override {}
  void sendLive(Frame frame, bool counted) override {
    if (counted) live_.publishFrame(*this, *frame);
  }

  const std::string station;
  std::map<std::string, Watcher> watchers;  // by server
  double rate_hz = -1;                      // of its subscription; below 0: none

 private:
  RemoteLive& live_;
};

template <typename Message>
void RemoteLive::publish(LivePlane plane, const std::string& name, const Message& message) {
  carrier_.publish(plane, name, message.SerializeAsString());
}

}  // namespace needlelab
