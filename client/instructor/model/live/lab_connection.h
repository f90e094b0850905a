/// The instructor's connection to the lab: a ServerLink on its own thread. Renews subscriptions after each
/// loss of the connection. The view polls and never blocks.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/net/link/server_link.h"
#include "common/base/result.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// Explains to an instructor why there is no connection, and gives advice.
struct LinkTrouble {
  std::string what;  ///< the cause in one sentence: "No needlelab-server answers at lab.example:7750."
  std::string todo;  ///< the advice in one or two sentences; never empty if `what` is set
  /// Retrying does not help: a different password, file or program is needed.
  bool needs_person = false;
  std::string detail;  ///< the error itself, for the lab's administrator
};

/// `server`: LinkEnd::server. `error`: from connectClient.
LinkTrouble troubleOf(const Error& error, const std::string& server);

enum class LinkPhase : std::uint8_t {
  kLoggedOut,   ///< not logged in yet, or logged out
  kConnecting,  ///< first attempt after a log-in
  kOnline,
  kAway,     ///< lost, or never reached; retries automatically
  kRefused,  ///< a person must act (LinkTrouble)
};

struct LabLogin {
  Endpoints servers;  ///< at least one; all are equivalent
  std::filesystem::path ca_file;
  std::string user, password;
};

/// A copy of the connection's state.
struct LinkState {
  LinkPhase phase = LinkPhase::kLoggedOut;
  std::string server;          ///< HOST:PORT of the last connection; before the first, the log-in's servers
  std::string user;            ///< from the log-in
  std::string server_version;  ///< from the last connection
  pb::Role role = pb::ROLE_UNSPECIFIED;
  LinkTrouble trouble;               ///< for kAway and kRefused
  std::int64_t away_since_ns = 0;    ///< steady clock; 0: not away
  std::int64_t next_try_ns = 0;      ///< steady clock, for kAway
  std::uint64_t connections = 0;     ///< number of connections so far
  std::uint64_t frames = 0;          ///< received live frames
  std::uint64_t frames_dropped = 0;  ///< frames dropped here for lack of polling
  std::uint64_t waiting = 0;         ///< unanswered requests
};

/// A received live frame.
struct LiveArrival {
  pb::LiveFrame frame;
  std::int64_t received_unix_ns = 0;  ///< this machine's wall clock
};

/// News since the last poll.
struct LabNews {
  std::vector<pb::StationStatus> statuses;  ///< the newest status of each station, oldest first
  std::vector<LiveArrival> frames;          ///< in order of arrival
};

struct LabConnectionSettings {
  std::chrono::milliseconds first_retry{200}, max_retry{5000};
  std::chrono::milliseconds answer_time{60'000};  ///< timeout of a request
  std::size_t max_frames = 4096;       ///< limit of frames waiting for a poll; beyond it drops the oldest
  std::size_t max_waiting = 256;       ///< limit of pending requests
  std::string program = "instructor";  ///< its name in messages to the server
  std::shared_ptr<LinkClock> clock = std::make_shared<LinkClock>();
};

/// Thread: `call` from any thread except the polling one, everything else from the view's thread. The
/// destructor says goodbye to the server, takes at most a second, and requires that no `call` is running.
class LabConnection {
 public:
  using Answer = std::function<void(Result<pb::Reply>)>;

  explicit LabConnection(LabConnectionSettings settings = {});
  ~LabConnection();
  LabConnection(const LabConnection&) = delete;
  LabConnection& operator=(const LabConnection&) = delete;

  /// Replaces any earlier log-in.
  void logIn(LabLogin login);
  void logOut();
  /// Retries at once instead of at the next scheduled time.
  void retryNow();

  /// Subscribes to the status lines of all stations, at most `rate_hz` per station. Survives losses of the
  /// connection.
  void watchAll(double rate_hz);
  /// Subscribes to the station's samples at full rate, until `unwatch`.
  void watch(const std::string& station);
  void unwatch(const std::string& station);

  /// `answer` runs within a later `poll`.
  void ask(pb::Request request, Answer answer, OnLoss on_loss = OnLoss::kResend);
  /// Blocks until the answer arrives; survives losses of the connection like kResend. Errors: as for `ask`;
  /// kFailed if `stopped` returns true (checked 20 times a second).
  Result<pb::Reply> call(pb::Request request, const std::function<bool()>& stopped = {});

  /// Runs the answers' callbacks and returns the other news.
  LabNews poll();
  [[nodiscard]] LinkState state() const;

 private:
  struct Net;
  std::unique_ptr<Net> net_;
};

}  // namespace needlelab
