/// One session on its way from the spool to the server: what to send next, and what the server's answers
/// mean.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "client/net/spool.h"
#include "needlelab/envelope.pb.h"

namespace needlelab {

/// States of a connection: not opened → opening → open → closing → closed; or refused, for good in this run.
/// A closed session that no verified backup covers is asked for once a connection: a server that was restored
/// from an older backup has lost it, and gets it again. A Welcome names 1,000 open sessions at most
/// (kFullWelcome); of a station with more of them, each closed session is asked for and its end sent again,
/// which changes nothing at a server that has it.
/// No network in here: the uplink asks for messages and hands over answers. Thread: one.
class UplinkSession {
 public:
  /// Whether the server had a session as open when it welcomed us.
  enum class AtServer : std::uint8_t { kOpen, kNotOpen, kUnknown };
  /// A Welcome with so many open sessions may not have named all (session.proto).
  static constexpr int kFullWelcome = 1000;

  /// `station`: the name that the uplink logs in with; a session that was recorded without one gets it.
  explicit UplinkSession(std::shared_ptr<SpoolSession> spool, std::string station = {});

  /// The next message to send now, if any: OpenSession, Chunk, CloseSession. `may_send_chunk`: the window has
  /// room.
  std::optional<pb::Envelope> next(bool may_send_chunk);

  /// A new connection; `at_server`: what its Welcome said of this session.
  void onConnected(AtServer at_server);
  void onOpened(std::uint64_t next_seq);
  void onAck(const pb::Ack& ack);
  void onClosed(const pb::SessionClosed& closed);
  void onRefusal(const pb::Refusal& refusal);
  /// The connection is gone: whatever was not acknowledged is sent again.
  void onConnectionLost();
  /// Writes what the server has to the spool, at most every 2 s unless `now`.
  void saveReceipt(std::int64_t now_steady_ns, bool now);

  [[nodiscard]] const std::shared_ptr<SpoolSession>& spool() const { return spool_; }
  [[nodiscard]] std::uint64_t inFlight() const { return sent_ > committed_ ? sent_ - committed_ : 0; }
  [[nodiscard]] std::uint64_t committed() const { return committed_; }
  [[nodiscard]] bool opened() const { return state_ == State::kOpen || state_ == State::kClosing; }
  [[nodiscard]] bool closed() const { return state_ == State::kClosed; }
  [[nodiscard]] bool refused() const { return state_ == State::kRefused; }
  /// Closed, and the server has not answered yet whether it still has it.
  [[nodiscard]] bool asking() const { return closed() && asking_; }
  /// Nothing more can be done for it in this run.
  [[nodiscard]] bool finished() const { return closed() || refused(); }
  /// Why the server refused it, for a person.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }
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
  State state_ = State::kNew;
  std::uint64_t sent_ = 0;       // chunks 0 … sent−1 were sent on this connection, or are committed
  std::uint64_t committed_ = 0;  // by the server's word
  std::uint64_t safe_ = 0;
  bool asked_ = false;          // on this connection, whether the server still has what it closed
  bool asking_ = false;         // … and it has not answered yet
  bool end_unknown_ = false;    // the Welcome did not say whether the server has its end
  bool end_due_ = false;        // the server has all its chunks: now the end again
  bool reconnected_ = false;    // the connection was lost before
  std::uint32_t reopened_ = 0;  // on the server's demand, since the last ack that brought something
  std::int64_t saved_ns_ = 0, not_before_ns_ = 0;
  std::string trouble_;
  pb::SessionClosed verdict_;
};

}  // namespace needlelab
