/// The live plane across the servers of one lab: which stations the others have, who watches whose frames,
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
#include <vector>

#include "common/base/result.h"
#include "common/base/time_source.h"
#include "needlelab/faculty.pb.h"
#include "server/base/log.h"
#include "server/live/hub.h"
#include "server/live/live_carrier.h"

namespace needlelab {

struct RemoteLiveSettings {
  std::string lab;                                ///< its id: messages of other labs are refused
  std::string server;                             ///< this server's name
  std::uint64_t instance = 0;                     ///< drawn at the start
  std::chrono::milliseconds presence_every{100};  ///< between two messages with what has changed
  std::chrono::milliseconds whole_every{1000};    ///< each station at least so often
  std::chrono::milliseconds alone_every{1000};    ///< while no other server is heard
  std::chrono::milliseconds presence_lasts{3000};
  /// For so long a claim that was overtaken does not count, though the newer one has ended: longer than a
  /// server that stood still goes on saying that it has the station.
  std::chrono::milliseconds overtaken_lasts{60'000};
  std::chrono::milliseconds watch_every{1000};
  std::chrono::milliseconds watch_lasts{3500};
  /// More than a server takes to hear from its station (ConnectionBounds::confirm_timeout).
  std::chrono::milliseconds ask_lasts{8000};
  std::chrono::milliseconds find_again{
      2000};                               ///< for news of who has a station that the server asked has not
  std::size_t presence_bytes = 60u << 10;  ///< of a message; more are several messages
  std::size_t most_status_bytes = 4u << 10;
  std::size_t most_ask_bytes = 16u << 10;
  std::size_t most_stations = 20'000;  ///< of all others together
  std::size_t most_servers = 256;
  std::size_t most_asked = 1'000;  ///< of this server and by it, unanswered
};

/// Each station elsewhere is a HubPeer of the hub, attached as a connection is; each station that another
/// server watches gets a viewer of the hub, whose frames are published. Of two servers that say that they
/// have a station, the one with the greater epoch has it; without epochs, the one that said so last. A
/// station that is connected here is here, unless another server has a greater epoch for it.
/// Call step() some twenty times a second. Hub and carrier outlive it. Thread: one.
class RemoteLive : public LiveCarrier::Listener {
 public:
  /// What became of a question.
  struct Asked {
    enum class Kind : std::uint8_t {
      kDelivered,
      kRefused,
      kHere,  ///< nobody was sent anything: the station is connected here by now
    };
    Kind kind = Kind::kDelivered;
    pb::Refusal refusal;
  };
  using AskedDone = std::function<void(Asked)>;
  /// Sends a person's message to a station of this server; then calls `done`, with what a refusal says.
  using DeliverDone = std::function<void(std::optional<pb::Refusal>)>;
  using Deliver =
      std::function<void(const std::string& station, const pb::Envelope& message, DeliverDone done)>;

  struct Counters {
    std::uint64_t malformed = 0;  ///< no message, of another lab, with values that are none, or too many
    std::uint64_t stale = 0;      ///< repeated, too late, or of a server that has not the station
    std::uint64_t asked = 0, answered = 0, not_here = 0, unanswered = 0;  ///< by this server
    std::uint64_t asked_here = 0;                                         ///< by others
    std::uint64_t frames_in = 0, frames_out = 0;
  };

  RemoteLive(Hub& hub, LiveCarrier& carrier, RemoteLiveSettings settings, TimeSource& time = machineTime());
  ~RemoteLive() override;
  RemoteLive(const RemoteLive&) = delete;
  RemoteLive& operator=(const RemoteLive&) = delete;

  void deliverBy(Deliver deliver) { deliver_ = std::move(deliver); }
  /// Says what is due, and forgets whom nobody heard of for too long.
  void step();
  /// Says that this server stops. It says and hears nothing more.
  void leave();

  /// Whether another server has the station, as far as is known.
  [[nodiscard]] bool isElsewhere(const std::string& station) const;
  /// Brings a message (TraineeMessage, NextExercise, SetAids, StopLesson) to a station elsewhere. A server
  /// that has it no more says so, and the one that has it is asked; whatever else happens, it is sent once at
  /// most. `done` is called once, perhaps at once.
  void ask(const std::string& station, const pb::Envelope& message, AskedDone done);

  void onMessage(LivePlane plane, const std::string& name, std::string_view message) override;
  void onLink(bool up, const std::string& why) override;

  [[nodiscard]] bool isUp() const { return up_; }
  /// For people; empty: the link is up.
  [[nodiscard]] std::string trouble() const;
  /// For people; empty: no other server has this one's name.
  [[nodiscard]] std::string nameTaken() const;
  /// The servers that are heard, by name.
  [[nodiscard]] std::vector<std::string> servers() const;
  [[nodiscard]] const Counters& counters() const { return counters_; }
  [[nodiscard]] LiveCarrier::Counters carried() const { return carrier_.counters(); }
  /// Stations of this server that others watch.
  [[nodiscard]] std::size_t watchedElsewhere() const { return outlets_.size(); }

 private:
  class Remote;
  class Outlet;
  struct Server {
    std::uint64_t instance = 0;
    std::deque<std::uint64_t> ended;  // its former instances, of which something may still come
    std::uint64_t last[kLivePlanes] = {};
    std::int64_t heard_ns = 0;
  };
  /// A station as a server says that it has it.
  struct Claim {
    std::uint64_t epoch = 0;
    std::int64_t first_ns = 0, last_ns = 0;
    pb::StationStatus status;
  };
  /// What was said last of a station of this server.
  struct Said {
    std::string entry;
    std::uint64_t epoch = 0;
    std::int64_t said_ns = 0;
    std::uint64_t round = 0;
  };
  struct Question {
    std::string station, server;  // server: the one that was asked last
    std::uint64_t epoch = 0;
    bool is_asked = false;  // false: it has not got the station
    unsigned asked = 0;
    pb::StationAsk message;
    AskedDone done;
    std::int64_t ends_ns = 0;
    std::int64_t find_until_ns = 0;  // unless is_asked
  };

  // --- remote_live.cpp
  void note(LogLevel level, std::string_view event, const std::string& server);
  [[nodiscard]] pb::Origin origin(LivePlane plane);
  [[nodiscard]] bool isFresh(const pb::Origin& origin, LivePlane plane);
  [[nodiscard]] bool isNewer(std::uint64_t epoch, std::uint64_t than) const;
  template <typename Message>
  void publish(LivePlane plane, const std::string& name, const Message& message);
  bool malformed();
  bool stale();
  void endInstance(const std::string& name, Server& server);
  void settle(Remote& remote);
  bool endWatch(Remote& remote);
  [[nodiscard]] const std::string* holderOf(const Remote& remote) const;
  void expire(std::int64_t now_ns);
  void countFrom(std::int64_t now_ns);
  void forgetClaims(const std::string& server);
  // --- remote_presence.cpp
  void sayPresence(std::int64_t now_ns);
  bool onPresence(const std::string& name, std::string_view message);
  void onPresent(const std::string& server, const pb::PresentStation& entry);
  // --- remote_frames.cpp
  void sayWatch(Remote& remote);
  bool onWatch(const std::string& name, std::string_view message);
  void watchedBy(const std::string& server, const pb::RemoteWatch& watch);
  void refresh(Outlet& outlet);
  void publishFrame(Outlet& outlet, const std::string& frame);
  bool onFrame(const std::string& name, std::string_view message);
  // --- remote_asks.cpp
  bool onAsk(const std::string& name, std::string_view message);
  bool onAnswer(std::string_view message);
  void askAgain(std::uint64_t number, const std::string& server, std::uint64_t epoch);
  void findAgain(std::int64_t now_ns);
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
  std::int64_t name_taken_ns_ = 0;  // 0: never
  std::map<std::string, Server> servers_;
  std::map<std::string, std::unique_ptr<Remote>> remotes_;
  std::map<std::string, std::unique_ptr<Outlet>> outlets_;
  std::map<std::string, Said> said_;
  std::map<std::uint64_t, Question> questions_;  // by the number of the message that asks
  std::size_t asked_here_ = 0;                   // of others, unanswered
  std::int64_t next_presence_ns_ = 0, next_expiry_ns_ = 0, last_step_ns_ = 0;
  std::uint64_t round_ = 0;
  LogBound lines_{60};
  Counters counters_;
  std::shared_ptr<int> here_ = std::make_shared<int>(0);  // for what ends later
};

}  // namespace needlelab
