/// Servers of one lab in one program: their hubs, connected by a carrier that the test steps. Things happen
/// only in run() and in the test's calls.
#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/together/remote_live.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/server/live/milliseconds.h"

namespace needlelab::test {

/// Stores everything it receives.
struct RecordingPeer : HubPeer {
  std::vector<pb::Envelope> control, live;
  int displaced = 0;
  void onDisplaced() override { ++displaced; }
  void sendControl(const pb::Envelope& envelope) override { control.push_back(envelope); }
  void sendLive(Frame frame, bool) override { live.push_back(*decodeFrame(viewOf(*frame))); }
  [[nodiscard]] std::vector<pb::LiveFrame> frames() const {
    std::vector<pb::LiveFrame> all;
    for (const auto& each : live)
      if (each.has_live_frame()) all.push_back(each.live_frame());
    return all;
  }
  /// A station's newest status, however it arrived.
  [[nodiscard]] pb::StationStatus status(const std::string& station) const {
    for (const auto* const way : {&live, &control})
      for (auto it = way->rbegin(); it != way->rend(); ++it)
        if (it->has_station_status() && it->station_status().station() == station && way == &live)
          return it->station_status();
    return lastTold(station);
  }
  /// The newest status that no queue could have dropped.
  [[nodiscard]] pb::StationStatus lastTold(const std::string& station) const {
    for (auto it = control.rbegin(); it != control.rend(); ++it)
      if (it->has_station_status() && it->station_status().station() == station) return it->station_status();
    return {};
  }
  [[nodiscard]] bool isWatched() const {
    for (auto it = control.rbegin(); it != control.rend(); ++it)
      if (it->has_watch_state()) return it->watch_state().watched();
    return false;
  }
};

struct LiveMessage {
  std::string from;  // a server's name
  LivePlane plane = LivePlane::kLive;
  std::string name, bytes;
};

class LiveBus {
 public:
  class Port : public LiveCarrier {
   public:
    Port(LiveBus& bus, std::string name) : bus_(bus), name_(std::move(name)) {}
    void publish(LivePlane plane, const std::string& name, std::string message) override {
      if (!up) {
        ++counted.dropped_out;
        return;
      }
      ++counted.messages_out;
      counted.bytes_out += message.size();
      bus_.sent.push_back({name_, plane, name, std::move(message)});
    }
    void listenTo(const std::string& station, bool wanted) override {
      if (wanted)
        stations.insert(station);
      else
        stations.erase(station);
    }
    [[nodiscard]] Counters counters() const override { return counted; }
    [[nodiscard]] bool hears(const LiveMessage& message) const {
      if (!up || listener == nullptr || message.from == name_) return false;
      if (message.plane == LivePlane::kLive) return stations.contains(message.name);
      return message.plane != LivePlane::kAnswer || message.name == name_;
    }
    [[nodiscard]] const std::string& name() const { return name_; }

    bool up = false;
    Listener* listener = nullptr;
    std::set<std::string> stations;
    Counters counted;

   private:
    LiveBus& bus_;
    const std::string name_;
  };

  Port& join(const std::string& name) { return ports.emplace_back(*this, name); }
  /// Delivers what was published, and everything that results.
  void deliver() {
    while (!sent.empty()) {
      const LiveMessage message = std::move(sent.front());
      sent.pop_front();
      passed.push_back(message);
      for (Port& port : ports) {
        if (!port.hears(message) || (loses && loses(message, port.name()))) continue;
        for (int copies = 0; copies < (twice ? 2 : 1); ++copies)
          port.listener->onMessage(message.plane, message.name, message.bytes);
      }
    }
  }
  [[nodiscard]] std::size_t count(LivePlane plane, const std::string& from) const {
    return static_cast<std::size_t>(std::count_if(passed.begin(), passed.end(), [&](const LiveMessage& each) {
      return each.plane == plane && each.from == from;
    }));
  }

  std::deque<Port> ports;
  std::deque<LiveMessage> sent;
  std::vector<LiveMessage> passed;  // everything published
  std::function<bool(const LiveMessage&, const std::string& to)> loses;
  bool twice = false;
};

/// A server's live plane.
struct LiveServer {
  LiveServer(LiveBus& bus, FakeTime& time, const std::string& name, RemoteLiveSettings settings = {})
      : hub(HubSettings{.server_name = name}), port(bus.join(name)) {
    settings.server = name;
    if (settings.lab.empty()) settings.lab = "lab";
    if (settings.instance == 0) settings.instance = std::hash<std::string>()(name) | 1;
    remote = std::make_unique<RemoteLive>(hub, port, settings, time);
    port.listener = remote.get();
    connect();
  }
  ~LiveServer() { port.listener = nullptr; }
  LiveServer(const LiveServer&) = delete;
  LiveServer& operator=(const LiveServer&) = delete;
  void connect() {
    port.up = true;
    remote->onLink(true, "");
  }
  void disconnect() {
    port.up = false;
    remote->onLink(false, "a test");
  }
  [[nodiscard]] pb::StationInfo listed(const std::string& station) const {
    pb::Stations stations;
    stations.add_stations()->set_name(station);
    hub.fillStations(stations);
    return stations.stations(0);
  }

  Hub hub;
  LiveBus::Port& port;
  std::unique_ptr<RemoteLive> remote;
};

/// Servers with one bus and one clock.
struct LiveLab {
  LiveServer& add(const std::string& name, RemoteLiveSettings settings = {}) {
    return *servers.emplace_back(std::make_unique<LiveServer>(bus, time, name, std::move(settings)));
  }
  /// Lets time pass, in a server's steps.
  void run(std::int64_t ms) {
    constexpr std::int64_t kStep_ms = 50;
    for (std::int64_t passed = 0; passed < ms; passed += kStep_ms) {
      time.advance(kStep_ms * kMs);
      for (const auto& server : servers) server->remote->step();
      bus.deliver();
    }
  }
  /// Its process ends without a last message.
  void kill(const LiveServer& server) {
    std::erase_if(servers, [&](const auto& each) { return each.get() == &server; });
  }

  FakeTime time;
  LiveBus bus;
  std::vector<std::unique_ptr<LiveServer>> servers;
};

}  // namespace needlelab::test
