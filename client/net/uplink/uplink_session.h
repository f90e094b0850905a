/// The upload of one session from the spool to the server: chooses the next message and interprets the
/// server's answers.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "client/net/spool/spool.h"
#include "common/base/time/time_source.h"
#include "needlelab/envelope.pb.h"

namespace needlelab {

/// States on a connection: not opened → opening → open → closing → closed; or refused for the rest of this
/// run. Once per connection the session asks for a closed session that the spool still has, Safe or not: a
/// server restored from an older backup, or a standby promoted too early, has lost it and gets it again. A
/// Welcome names at most 1,000 open sessions (kFullWelcome); if a station has more, each closed session asks
/// and sends its end again, which changes nothing at a server that has it. Contains no network code: the
/// uplink fetches messages and passes in answers. Thread: one.
class UplinkSession {
 public:
  /// Whether the session was open at the server when it sent Welcome.
  enum class AtServer : std::uint8_t { kOpen, kNotOpen, kUnknown };
  /// A Welcome with this many open sessions may not name all of them (session.proto).
  static constexpr int kFullWelcome = 1000;

  /// `station`: the uplink's log-in name, given to a session recorded without a station's name.
  explicit UplinkSession(std::shared_ptr<SpoolSession> spool, std::string station = {},
                         TimeSource& time = machineTime());

  /// Returns the next message to send now, if any: OpenSession, Chunk or CloseSession. `may_send_chunk`: the
  /// window has room.
  std::optional<pb::Envelope> next(bool may_send_chunk);

  /// Starts on a new connection; `at_server`: the session's state by its Welcome.
  void onConnected(AtServer at_server);
  void onOpened(std::uint64_t next_seq);
  void onAck(const pb::Ack& ack);
  void onClosed(const pb::SessionClosed& closed);
  void onRefusal(const pb::Refusal& refusal);
  /// Handles a lost connection: everything unacknowledged is sent again.
  void onConnectionLost();
  /// Writes the receipt to the spool, at most every 2 s unless `now`.
  void saveReceipt(bool now);

  [[nodiscard]] const std::shared_ptr<SpoolSession>& spool() const { return spool_; }
  [[nodiscard]] std::uint64_t inFlight() const { return sent_ > committed_ ? sent_ - committed_ : 0; }
  [[nodiscard]] std::uint64_t committed() const { return committed_; }
  [[nodiscard]] bool opened() const { return state_ == State::kOpen || state_ == State::kClosing; }
  [[nodiscard]] bool closed() const { return state_ == State::kClosed; }
  [[nodiscard]] bool refused() const { return state_ == State::kRefused; }
  /// The session is closed, and we wait for the server to confirm that it still has it.
  [[nodiscard]] bool asking() const { return closed() && asking_; }
  /// Number of chunks that the server had acknowledged but lacked at its last answer to OpenSession; resets
  /// it to 0.
  [[nodiscard]] std::uint64_t takeMissingCount() { return std::exchange(lacking_, 0); }
  /// Whether nothing is left to do in this run.
  [[nodiscard]] bool finished() const { return closed() || refused(); }
  /// Why the server refused the session, for a person.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  /// The server's message while it has no room for the session, which is retried; otherwise empty.
  [[nodiscard]] const std::string& waitsFor() const { return waits_for_; }
  /// The server's verdict and score, once closed.
  [[nodiscard]] const pb::SessionClosed& verdict() const { return verdict_; }

 private:
  enum class State { kNew, kOpening, kOpen, kClosing, kClosed, kRefused };
  void refuse(std::string why);
  std::optional<pb::Envelope> nextChunk();
  [[nodiscard]] pb::Envelope openMessage() const;
  void sendAgain(std::uint64_t next_seq);
  void endAgain();
  [[nodiscard]] pb::Envelope closeMessage(const SpoolContents& contents) const;

  std::shared_ptr<SpoolSession> spool_;
  std::string station_;
  TimeSource& time_;
  State state_ = State::kNew;
  std::uint64_t sent_ = 0;       // chunks 0 … sent−1 were sent on this connection or are committed
  std::uint64_t committed_ = 0;  // acknowledged by the server
  std::uint64_t safe_ = 0;
  std::uint64_t lacking_ = 0;   // acknowledged, but missing at the last answer
  bool asked_ = false;          // on this connection: whether the server still has the closed session
  bool asking_ = false;         // asked, but not answered yet
  bool end_unknown_ = false;    // the Welcome did not say whether the server has its end
  bool end_due_ = false;        // the server has all chunks; the end is due again
  bool reconnected_ = false;    // the connection was lost before
  std::uint32_t reopened_ = 0;  // on the server's demand, since the last ack that made progress
  std::int64_t saved_ns_ = 0, not_before_ns_ = 0;
  std::string trouble_, waits_for_;
  pb::SessionClosed verdict_;
};

}  // namespace needlelab
