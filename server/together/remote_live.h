/// The live plane across the servers of one lab: which stations the others have, who watches which frames,
/// messages to stations at another server. Nothing here is stored, and no lesson waits for it.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "needlelab/faculty.pb.h"
#include "server/base/log.h"
#include "server/live/hub/hub.h"
#include "server/together/live_carrier.h"

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
  [[nodiscard]] bool isRemote() const override { return true; }
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
  std::int64_t watch_published_ns = 0;
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

struct RemoteLiveSettings {
  std::string lab;                                      ///< its id; messages of other labs are refused
  std::string server;                                   ///< this server's name
  std::uint64_t instance = 0;                           ///< random, chosen at the start
  std::chrono::milliseconds presence_every{100};        ///< between two messages with changes
  std::chrono::milliseconds whole_every{1000};          ///< each station is repeated this often
  std::chrono::milliseconds solo_presence_every{1000};  ///< while no other server is heard
  std::chrono::milliseconds presence_lasts{3000};
  /// For this long an overtaken claim does not count, even if the newer one has ended: longer than a server
  /// that was paused keeps reporting that it has the station.
  std::chrono::milliseconds overtaken_lasts{60'000};
  std::chrono::milliseconds watch_every{1000};
  std::chrono::milliseconds watch_lasts{3500};
  /// More than a server needs to get its station's confirmation (ConnectionBounds::confirm_timeout).
  std::chrono::milliseconds ask_lasts{8000};
  std::chrono::milliseconds find_again{
      2000};  ///< time to learn which server has the station if the one asked does not
  std::size_t presence_bytes = 60u << 10;  ///< per message; more are split into several messages
  std::size_t max_status_bytes = 4u << 10;
  std::size_t max_ask_bytes = 16u << 10;
  std::size_t max_stations = 20'000;  ///< of all other servers together
  std::size_t max_servers = 256;
  std::size_t max_asked = 1'000;  ///< unanswered, from this server and to it
};

/// Each station at another server is represented by a HubPeer, attached like a connection; each station
/// watched by another server gets a viewer in the hub, whose frames are published. If two servers claim a
/// station, the one with the greater epoch has it; without epochs, the one that claimed it last. A station
/// connected here is here unless another server has a greater epoch for it. Call step() some twenty times a
/// second. Hub and carrier must outlive it. Thread: one.
class RemoteLive : public LiveCarrier::Listener {
 public:
  /// The outcome of a question.
  struct Asked {
    enum class Kind : std::uint8_t {
      kDelivered,
      kRefused,
      kLocal,  ///< nothing was sent: the station is connected here now
    };
    Kind kind = Kind::kDelivered;
    pb::Refusal refusal;
  };
  using AskDone = std::function<void(Asked)>;
  /// Sends a person's message to a station of this server; then calls `done` with the refusal, if any.
  using DeliverDone = std::function<void(std::optional<pb::Refusal>)>;
  using Deliver =
      std::function<void(const std::string& station, const pb::Envelope& message, DeliverDone done)>;

  struct Counters {
    std::uint64_t malformed = 0;  ///< unparsable, from another lab, with invalid values, or too many
    std::uint64_t stale = 0;      ///< repeated, too late, or from a server that does not have the station
    std::uint64_t asked = 0, answered = 0, not_here = 0, unanswered = 0;  ///< by this server
    std::uint64_t asked_here = 0;                                         ///< by others
    std::uint64_t frames_in = 0, frames_out = 0;
  };

  RemoteLive(Hub& hub, LiveCarrier& carrier, RemoteLiveSettings settings, TimeSource& time = machineTime());
  ~RemoteLive() override;
  RemoteLive(const RemoteLive&) = delete;
  RemoteLive& operator=(const RemoteLive&) = delete;

  void deliverBy(Deliver deliver) { deliver_ = std::move(deliver); }
  /// Sends what is due, and forgets servers and stations that were silent for too long.
  void step();
  /// Announces that this server stops. Afterwards nothing is sent or received.
  void leave();

  /// Whether another server has the station, as far as known.
  [[nodiscard]] bool isRemote(const std::string& station) const;
  /// Delivers a message (TraineeMessage, NextExercise, SetAids, StopLesson) to a station at another server.
  /// If that server no longer has the station, the one that has it is asked. In any case the message is sent
  /// at most once. `done` is called exactly once, possibly before ask() returns.
  void ask(const std::string& station, const pb::Envelope& message, AskDone done);

  void onMessage(LivePlane plane, const std::string& name, std::string_view message) override;
  void onLink(bool up, const std::string& why) override;

  [[nodiscard]] bool isUp() const { return up_; }
  /// For people; empty if the link is up.
  [[nodiscard]] std::string trouble() const;
  /// For people; empty if no other server uses this one's name.
  [[nodiscard]] std::string duplicateName() const;
  /// The names of the servers that are heard.
  [[nodiscard]] std::vector<std::string> servers() const;
  [[nodiscard]] const Counters& counters() const { return counters_; }
  [[nodiscard]] LiveCarrier::Counters carried() const { return carrier_.counters(); }
  /// Stations of this server that others watch.
  [[nodiscard]] std::size_t remotelyWatched() const { return outlets_.size(); }

 private:
  struct Server {
    std::uint64_t instance = 0;
    std::deque<std::uint64_t> ended;  // its former instances, whose messages may still arrive
    std::uint64_t last[kLivePlanes] = {};
    std::int64_t last_message_ns = 0;
  };
  /// The last report about a station of this server.
  struct Said {
    std::string entry;
    std::uint64_t epoch = 0;
    std::int64_t said_ns = 0;
    std::uint64_t round = 0;
  };
  struct Question {
    std::string station, server;  // server: the last one asked
    std::uint64_t epoch = 0;
    bool is_asked = false;  // false: it did not have the station
    unsigned asked = 0;
    pb::StationAsk message;
    AskDone done;
    std::int64_t ends_ns = 0;
    std::int64_t find_until_ns = 0;  // unless is_asked
  };

  // --- remote_live.cpp
  void note(LogLevel level, std::string_view event, const std::string& server);
  [[nodiscard]] pb::Origin origin(LivePlane plane);
  [[nodiscard]] bool isFresh(const pb::Origin& origin, LivePlane plane);
  [[nodiscard]] bool isNewer(std::uint64_t epoch, std::uint64_t than) const;
  template <typename Message>
  void publish(LivePlane plane, const std::string& name, const Message& message) {
    carrier_.publish(plane, name, message.SerializeAsString());
  }
  bool malformed();
  bool stale();
  void endInstance(const std::string& name, Server& server);
  void settle(RemoteStation& remote);
  bool endWatch(RemoteStation& remote);
  [[nodiscard]] const std::string* holderOf(const RemoteStation& remote) const;
  void expire(std::int64_t now_ns);
  void countFrom(std::int64_t now_ns);
  void forgetClaims(const std::string& server);
  // --- remote_presence.cpp
  void publishPresence(std::int64_t now_ns);
  bool onPresence(const std::string& name, std::string_view message);
  void onPresent(const std::string& server, const pb::PresentStation& entry);
  // --- remote_frames.cpp
  void onWatched(RemoteStation& remote);
  void publishWatch(RemoteStation& remote);
  bool onWatch(const std::string& name, std::string_view message);
  void watchedBy(const std::string& server, const pb::RemoteWatch& watch);
  void refresh(RemoteOutlet& outlet);
  void publishFrame(RemoteOutlet& outlet, const std::string& frame);
  bool onFrame(const std::string& name, std::string_view message);
  // --- remote_asks.cpp
  bool onAsk(const std::string& name, std::string_view message);
  bool onAnswer(std::string_view message);
  void askAgain(std::uint64_t number, const std::string& server, std::uint64_t epoch);
  void redirectQuestions(std::int64_t now_ns);
  void end(std::uint64_t number, Asked asked);
  void endQuestions(pb::Refusal::Reason reason, const std::string& why);
  void answer(const pb::StationAsk& ask, pb::StationAnswer answer);

  Hub& hub_;
  LiveCarrier& carrier_;
  const RemoteLiveSettings settings_;
  TimeSource& time_;
  Deliver deliver_;
  bool up_ = false, has_left_ = false;
  std::string why_down_;
  std::uint64_t numbers_[kLivePlanes] = {};
  std::int64_t duplicate_name_ns_ = 0;  // 0: never
  std::map<std::string, Server> servers_;
  std::map<std::string, std::unique_ptr<RemoteStation>> remotes_;
  std::map<std::string, std::unique_ptr<RemoteOutlet>> outlets_;
  std::map<std::string, Said> said_;
  std::map<std::uint64_t, Question> questions_;  // by the number of the message that asks
  std::size_t asked_here_ = 0;                   // from other servers, unanswered
  std::int64_t next_presence_ns_ = 0, next_expiry_ns_ = 0, last_step_ns_ = 0;
  std::uint64_t round_ = 0;
  LogBound lines_{60};
  Counters counters_;
  std::shared_ptr<int> alive_ = std::make_shared<int>(0);  // for callbacks that may outlive this
};

}  // namespace needlelab
