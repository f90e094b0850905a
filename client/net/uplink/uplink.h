/// The station's link to the server: uploads the spool, sends live frames, and never blocks its callers.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "client/net/link/server_link.h"
#include "client/net/spool/spool.h"
#include "client/net/spool/spool_writer.h"
#include "client/net/uplink/uplink_session.h"
#include "common/base/bytes.h"
#include "common/base/result.h"

namespace needlelab {

struct UplinkConfig {
  ClientConfig client;
  std::size_t window_chunks = 64;  ///< in flight, over all sessions
  std::chrono::milliseconds first_retry{200}, max_retry{10'000};
  [[nodiscard]] Backoff::Settings retry() const { return {.first = first_retry, .most = max_retry}; }
  std::shared_ptr<LinkClock> clock = std::make_shared<LinkClock>();
};

/// Events for the station's program. All run on the uplink's thread and must not block.
struct UplinkEvents {
  std::function<void(const std::string&)> report;  ///< for a person: connected, lost, refused, …
  std::function<void(const pb::TraineeMessage&)> trainee_message;  ///< from an instructor
  std::function<void(const pb::NextExercise&)> next_exercise;      ///< chosen by an instructor
  /// An instructor changes the displayed aids. All numbers are valid aids; the message is for the current
  /// session or for any.
  std::function<void(const pb::SetAids&)> set_aids;
  /// An instructor ends the lesson of the current session, or of any.
  std::function<void(const pb::StopLesson&)> stop_lesson;
  std::function<void(const pb::Ack&)> acknowledged;      ///< unchanged; for tests that keep a record
  std::function<void(const pb::SessionClosed&)> closed;  ///< unchanged
};

/// Facts of a lesson for the status lines, from the station's LessonWatch.
struct LessonFacts {
  double peak_force_N = 0;                   ///< since the session began
  std::vector<std::string> hazards_touched;  ///< LessonWatch::warnings()
  double force_limit_N = 0;                  ///< the exercise's limit of the peak force; 0: no limit
  std::string layer_name;                    ///< the displayed name of the tip's layer; empty outside
  std::vector<pb::AlarmCount> alarms = {};   ///< GestureAlarms::counts()
};

/// State of the link and of the uploads.
struct UplinkState {
  bool connected = false;
  std::int64_t away_since_ns = 0;       ///< steady clock; time of the loss or of our start; 0: connected
  bool denied = false;                  ///< the server refused the log-in, its certificate or our version
  std::string error;                    ///< the last connection's end or failure, as text
  std::string server;                   ///< HOST:PORT of the last connection; empty: never connected
  std::uint64_t connections = 0;        ///< made so far
  std::uint64_t chunks_left = 0;        ///< in the spool and not acknowledged, over all sessions
  std::uint64_t sessions_open = 0;      ///< sessions that the server has neither closed nor refused
  std::uint64_t current_committed = 0;  ///< chunks of the current session that the server has
  std::optional<pb::SessionClosed> current_verdict;
  std::string current_trouble;  ///< why the server refuses the current session
  std::string server_full;      ///< the server's message while it has no room for a session; otherwise empty
  std::uint64_t live_frames = 0;   ///< sent
  std::uint64_t live_encoded = 0;  ///< pieces encoded for viewers; 0 without viewers
  std::uint64_t live_dropped = 0;  ///< dropped here, because the network was slow
  std::optional<ClockProbe::Estimate> clock;
  std::optional<std::int64_t>
      server_minus_steady_ns;      ///< the server's time less ours since the start; by the last Welcome
  std::int64_t wall_ahead_ns = 0;  ///< this computer's clock minus the server's, at the last Welcome

  /// The server's time at `steady_ns`, the steady clock, while this computer's clock shows `wall_ns`. Nothing
  /// if no server was reached, or if the computer slept since: the steady clock stood still then, so that the
  /// other one went on by more, 1 min or longer.
  [[nodiscard]] std::optional<std::int64_t> serverUnixNs(std::int64_t steady_ns, std::int64_t wall_ns) const {
    constexpr std::int64_t kSlept_ns = 60'000'000'000;
    if (!server_minus_steady_ns) return std::nullopt;
    const std::int64_t server_ns = steady_ns + *server_minus_steady_ns;
    if (wall_ns - wall_ahead_ns - server_ns >= kSlept_ns) return std::nullopt;
    return server_ns;
  }
};

/// How a station retries. During a lesson it probes an address that accepts no connections: a refused TCP
/// connection costs a starting server nothing, and viewers miss the lesson until the station is back. A
/// server that accepts connections but does not log the station in is busy, so the station backs off. It
/// rarely retries where it is refused. Pure.
Retry retryOfStation(const LinkEnd& end, bool lesson_runs);

/// Thread: any but its own, for all public functions; they wait for the network only where documented.
class Uplink {
 public:
  /// Starts the thread, which connects at once and reconnects after each loss (jittered back-off).
  Uplink(UplinkConfig config, UplinkEvents events);
  ~Uplink();
  Uplink(const Uplink&) = delete;
  Uplink& operator=(const Uplink&) = delete;

  /// Adds a session of the spool for upload. The `current` one goes first, and its samples are the live ones.
  void add(std::shared_ptr<SpoolSession> session, bool current);
  /// Wakes the thread: the spool has more chunks of a session, or a session has ended.
  void wake();
  /// Takes the newest samples of the current session, for the status line, and for a live frame if there are
  /// viewers.
  void offer(const SamplePiece& piece);
  void noteMissedTicks(std::uint64_t missed) { missed_ticks_.store(missed, std::memory_order_relaxed); }
  /// For StationStatus.hand_raised.
  void noteHand(bool raised) { hand_raised_.store(raised, std::memory_order_relaxed); }
  void noteWakeup(std::uint32_t p99_us) { wakeup_p99_us_.store(p99_us, std::memory_order_relaxed); }
  /// Sets the facts of the current session; adding another session clears them. Thread: any.
  void noteLesson(LessonFacts facts);
  /// Sets a problem for StationStatus.trouble, shown to people at the server; an empty text clears it. Each
  /// `source` (disk, device, …) has its own text; the status line shows all of them.
  void noteTrouble(const std::string& source, const std::string& text);

  /// Requests a lesson from the server. Waits up to `patience`; with `once`, only until the first attempt to
  /// connect fails (at all of several servers). Polls `stopped` about 20 times a second. `code`: the
  /// trainee's, if the server requested it. Errors: kUnavailable (no server in time), kFailed (stopped), and
  /// from the server kDenied, kVersion, kNotFound, kInvalidInput, kCode.
  Result<pb::Lesson> getLesson(const std::string& exercise_id, const std::string& trainee,
                               std::chrono::milliseconds patience, bool once,
                               const std::function<bool()>& stopped = {}, const std::string& code = {});
  /// Likewise for any request. Errors: as getLesson, and any other Refusal (errorOf).
  Result<pb::Reply> ask(pb::Request request, std::chrono::milliseconds patience, bool once,
                        const std::function<bool()>& stopped = {});
  /// Waits until the server has closed or refused every session, or refuses us. Returns false after
  /// `patience`.
  bool waitUntilDone(std::chrono::milliseconds patience);
  /// Sends a Bye, saves the receipts and joins the thread. May be called twice.
  void stop();

  [[nodiscard]] UplinkState state() const;
  [[nodiscard]] TimeSource& time() const { return config_.clock->time(); }

 private:
  LinkHandlers handlers();
  /// Whether the current session has not ended.
  [[nodiscard]] bool lessonRuns() const;
  void onConnected(const pb::Welcome& welcome);
  void onAway(const LinkEnd& end);
  Task<> keepTime();
  void handle(const pb::Envelope& envelope);
  void handleRefusal(const pb::Envelope& envelope);
  /// Returns whether an instructor's message is for the current session or for any; reports it otherwise.
  [[nodiscard]] bool isForCurrentSession(const std::string& session_id) const;
  void pump();
  void setWatched(bool watched);
  void pumpLive();
  void sendStatus();
  void sendProbe();
  void sendClockOffset();
  void takeAdded();
  void publish();
  /// The state of this session by the last Welcome.
  [[nodiscard]] UplinkSession::AtServer atServer(const UplinkSession& session) const;
  void reportSentAgain(const UplinkSession& session) const;
  UplinkSession* find(const std::string& session_id);
  void report(const std::string& text) const;

  // the uplink's own thread
  UplinkConfig config_;
  UplinkEvents events_;
  asio::io_context io_{1};
  ServerLink link_;
  std::vector<std::unique_ptr<UplinkSession>> sessions_;  // in the order in which they are served
  UplinkSession* current_ = nullptr;
  ClockProbe clock_;
  std::int64_t clock_sent_ns_ = 0;  // round trip of the estimate last sent to the server
  std::uint64_t probes_ = 0, frame_seq_ = 0;
  std::string reported_;  // why the last attempt to connect failed
  std::int64_t welcomed_ns_ = 0;

  mutable std::mutex mutex_;  // guards all that follows
  std::condition_variable changed_;
  UplinkState state_;
  std::vector<std::pair<std::shared_ptr<SpoolSession>, bool>> added_;
  struct Live {
    SamplePiece piece;
    std::int64_t capture_unix_ns = 0;
  };
  std::deque<Live> live_;
  std::uint64_t live_skipped_ = 0;  // dropped since the last frame taken
  std::optional<Live> newest_;      // for the status line and for new viewers
  bool newest_sent_ = false;        // newest_ was sent or waits in live_
  std::uint32_t flags_since_status_ = 0;
  bool all_away_ = false;       // no server is reachable, so calls with `once` need not wait
  bool current_added_ = false;  // added to added_ but not taken: state_ still describes the previous session
  LessonFacts facts_;           // of the current session
  std::uint64_t dropped_before_ = 0;             // live frames, when the current session was added
  std::map<std::string, std::string> troubles_;  // by source

  std::atomic<bool> watched_{false};
  std::atomic<std::uint64_t> missed_ticks_{0};
  std::atomic<std::uint32_t> wakeup_p99_us_{0};
  std::atomic<bool> hand_raised_{false};
  std::thread thread_;
};

// --- waiting at the end until the server has everything, within limits

struct DrainPatience {
  std::chrono::duration<double> whole{10};           ///< total (--drain)
  std::chrono::duration<double> never_connected{2};  ///< when this run never reached a server
  std::chrono::duration<double> long_away{30};       ///< when the server has been away for this long
};

enum class DrainEnd : std::uint8_t {
  kDone,      ///< the server has closed or refused every session
  kAway,      ///< no server for too long: waiting is pointless
  kTimeOver,  ///< connected, or lost only recently, but not done in time
  kStopped,   ///< by the caller
  kDenied,    ///< the server refuses us
};

/// Whether a drain that began at `began_ns` ends now, while sessions are still open. Pure.
std::optional<DrainEnd> drainEnd(const UplinkState& state, const DrainPatience& patience,
                                 std::int64_t began_ns, std::int64_t now_ns);

/// Polls `stopped` about 50 times a second. Thread: any but the uplink's.
DrainEnd drain(Uplink& uplink, const DrainPatience& patience, const std::function<bool()>& stopped);

/// Text for a person; may be empty.
std::string drainText(DrainEnd end, const UplinkState& state);

}  // namespace needlelab
