/// The instructor's connection to the lab: a ServerLink on a thread of its own, with the subscriptions that
/// are made again after each loss. The view polls and never waits.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/net/server_link.h"
#include "common/base/result.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// Explains to an instructor why there is no connection, and what to do about it.
struct LinkTrouble {
  std::string what;  ///< one sentence: "No needlelab-server answers at lab.example:7750."
  std::string todo;  ///< one or two: what a person can do; never empty when `what` is not
  /// Trying again by itself makes no sense: another password, file or program is needed.
  bool needs_person = false;
  std::string detail;  ///< the error itself, for the lab's administrator
};

/// `server`: HOST:PORT as typed. Errors as connectClient gives them.
LinkTrouble troubleOf(const Error& error, const std::string& server);

enum class LinkPhase : std::uint8_t {
  kLoggedOut,   ///< nobody has logged in
  kConnecting,  ///< the first try of a log-in is under way
  kOnline,
  kAway,     ///< lost, or never reached: it is tried again by itself
  kRefused,  ///< a person must do something (LinkTrouble)
};

struct LabLogin {
  Endpoint server;
  std::filesystem::path ca_file;
  std::string user, password;
};

/// How it stands; a copy.
struct LinkState {
  LinkPhase phase = LinkPhase::kLoggedOut;
  std::string server, user;    ///< of the log-in
  std::string server_version;  ///< of the last connection
  pb::Role role = pb::ROLE_UNSPECIFIED;
  LinkTrouble trouble;               ///< of kAway and kRefused
  std::int64_t away_since_ns = 0;    ///< steady clock; 0: not away
  std::int64_t next_try_ns = 0;      ///< steady clock, of kAway
  std::uint64_t connections = 0;     ///< made so far
  std::uint64_t frames = 0;          ///< live frames that came
  std::uint64_t frames_dropped = 0;  ///< of them dropped here, because nobody polled
  std::uint64_t waiting = 0;         ///< requests without an answer
};

/// A live frame as it came in.
struct LiveArrival {
  pb::LiveFrame frame;
  std::int64_t received_unix_ns = 0;  ///< this machine's wall clock
};

/// What came since the last poll.
struct LabNews {
  std::vector<pb::StationStatus> statuses;  ///< the newest of each station, oldest news first
  std::vector<LiveArrival> frames;          ///< in order
};

struct LabConnectionSettings {
  std::chrono::milliseconds first_retry{200}, most_retry{5000};
  std::chrono::milliseconds answer_time{60'000};  ///< after which a request is given up
  std::size_t most_frames = 4096;                 ///< that wait for a poll; then the oldest are dropped
  std::size_t most_waiting = 256;                 ///< requests
  std::string program = "instructor";             ///< as it names itself to the server
};

/// Thread: `call` from any thread but the one that polls, the rest from one thread, the view's. The
/// destructor says goodbye and takes a second at most; no `call` may be under way then.
class LabConnection {
 public:
  using Answer = std::function<void(Result<pb::Reply>)>;

  explicit LabConnection(LabConnectionSettings settings = {});
  ~LabConnection();
  LabConnection(const LabConnection&) = delete;
  LabConnection& operator=(const LabConnection&) = delete;

  /// In place of any log-in before.
  void logIn(LabLogin login);
  void logOut();
  /// Does not wait for the next try.
  void retryNow();

  /// Status lines of all stations, at most so many a second of each; kept through losses.
  void watchAll(double rate_hz);
  /// The station's samples at full rate, until `unwatch`.
  void watch(const std::string& station);
  void unwatch(const std::string& station);

  /// `answer` runs within a later `poll`.
  void ask(pb::Request request, Answer answer, OnLoss on_loss = OnLoss::kAskAgain);
  /// Waits for the answer, through losses of the connection as kAskAgain. Errors: as `ask`; kFailed when
  /// `stopped` says so (asked 20 times a second).
  Result<pb::Reply> call(pb::Request request, const std::function<bool()>& stopped = {});

  /// Runs answers, and gives what else came.
  LabNews poll();
  [[nodiscard]] LinkState state() const;

 private:
  struct Net;
  std::unique_ptr<Net> net_;
};

}  // namespace needlelab
