/// A server's connection to one peer, from the TLS handshake to the end: its state, role and pending work.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <initializer_list>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "common/wire/channel.h"
#include "common/wire/envelope_scan.h"
#include "db/sessions/session_store.h"
#include "db/sessions/station_claims.h"
#include "needlelab/envelope.pb.h"
#include "server/live/context.h"
#include "server/live/limits/byte_budget.h"
#include "server/live/limits/peer_lines.h"
#include "server/live/login/tokens.h"
#include "server/live/port/live_peer.h"
#include "server/live/work/offload.h"

namespace needlelab {

/// Thread: the network's. Ownership: shared by its coroutines and callbacks; the context must outlive it.
class PeerConnection : public LivePeer, public std::enable_shared_from_this<PeerConnection> {
 public:
  PeerConnection(ServerContext& context, std::uint64_t id, std::shared_ptr<Channel> channel);
  ~PeerConnection() override;
  PeerConnection(const PeerConnection&) = delete;
  PeerConnection& operator=(const PeerConnection&) = delete;

  /// Runs the connection: handshake, messages, end. It is in ServerContext::connections meanwhile.
  static Task<> run(std::shared_ptr<PeerConnection> self);

  /// For co_spawn of a connection's work. An exception (out of memory) is logged and ends only this
  /// connection.
  static std::function<void(std::exception_ptr)> endOnException(std::shared_ptr<PeerConnection> self);

  void refuseAndClose(pb::Refusal refusal) override;
  void cut(const std::string& reason) override;
  void shutDown(const std::string& reason) override;
  void checkHangUp() override;
  void sendSafe() override;
  Task<bool> sendConfirmed(pb::Envelope envelope) override;

  void sendControl(const pb::Envelope& envelope) override;
  void sendLive(Frame frame, bool counted) override;
  [[nodiscard]] std::string account() const override { return who_.name; }

  [[nodiscard]] std::uint64_t id() const override { return id_; }
  [[nodiscard]] ConnectionState state() const override { return state_; }
  [[nodiscard]] const Principal& who() const override { return who_; }
  [[nodiscard]] const std::string& address() const { return channel_->peerAddress(); }
  /// The address without the port.
  [[nodiscard]] std::string peerHost() const;
  [[nodiscard]] const Channel& channel() const override { return *channel_; }
  /// True once the peer no longer waits for replies: the connection is ending or the peer has hung up.
  [[nodiscard]] bool gone() const { return *gone_; }
  [[nodiscard]] bool hasRequests() const override { return requests_at_work_ > 0; }

 private:
  /// A session's watermarks that this connection has sent or is about to send.
  struct Watermarks {
    std::uint64_t committed = 0;
    std::uint64_t safe = 0;
    std::uint64_t max_safe = UINT64_MAX;  // most chunks that acks make Safe, SessionStore::mostSafeSeqs()
    bool ack_due = false;
    bool open = false;        // opened here, and its close has not been answered on this connection
    std::string trainee_ref;  // sessions.trainee
    std::string trainee;      // the displayed name; empty: closed, or without a person
    std::string full_name;    // empty: not known

    void noteCommitted(std::uint64_t seqs, bool acks_are_safe) {
      committed = std::max(committed, seqs);
      if (acks_are_safe) safe = std::max(safe, std::min(committed, max_safe));
    }
  };

  /// A message's shares of the budgets.
  struct Shares {
    std::optional<ByteBudget::Share> decoded;  // for a message that is not small
    std::optional<ByteBudget::Share> reply;    // for a request
  };

  // --- connection.cpp: lifetime
  Task<Status> shakeHands();
  static Task<> shutDownOf(std::shared_ptr<PeerConnection> self, std::string reason);
  static void grantTurns(ServerContext& context);
  void setState(ConnectionState next);
  void refuse(pb::Refusal refusal, std::uint64_t request = 0);
  void refuse(pb::Refusal::Reason reason, std::string text, std::uint64_t request = 0);
  /// Writes a log line, for the account or, before log-in, for strangers (PeerLines).
  void note(const PeerLineKind& kind, std::initializer_list<LogField> fields);
  void refusedByPeer(const pb::Refusal& refusal);
  /// Answers a browser that took this port for the console's, and ends the connection.
  void answerHttp();
  void leave();
  [[nodiscard]] bool busy() const;
  /// `until_sent`: as in Channel::send.
  void sendHolding(const pb::Envelope& envelope, std::shared_ptr<const void> until_sent);

  // --- connection_messages.cpp
  bool passLive(ByteView frame);
  Task<Status> take(ByteView frame);
  [[nodiscard]] bool mayRead(const EnvelopeHead& head);
  [[nodiscard]] std::optional<pb::Refusal> tooLong(const EnvelopeHead& head) const;
  Task<std::optional<ByteBudget::Share>> roomForDecoded(std::size_t bytes, std::uint64_t request);
  Task<std::optional<ByteBudget::Share>> roomIn(ByteBudget& budget, std::shared_ptr<Signal> freed,
                                                std::size_t bytes);
  Task<Result<pb::Envelope>> parse(ByteView frame, const PayloadCost& cost);
  Task<> dispatch(pb::Envelope envelope, Shares shares);
  void answerPing(const pb::Ping& ping);
  [[nodiscard]] bool tooOften(pb::Envelope::BodyCase body);

  // --- connection_requests.cpp
  static Task<> execute(std::shared_ptr<PeerConnection> self, pb::Request request, Shares shares);
  Task<> answer(const pb::Request& request, Outcome outcome, ByteBudget::Share room);
  static Task<bool> confirmedBy(std::shared_ptr<PeerConnection> self, pb::Envelope envelope);

  // --- connection_login.cpp
  void greet(const pb::Hello& hello);
  Task<> logIn(pb::Login given);
  Task<Result<Tokens::Holder>> checkLogin(std::shared_ptr<const pb::Login> login);
  bool takePlace();
  Task<> welcome(std::int64_t password_ns);
  bool isLateLogin();
  Task<bool> claimStation();
  void refuseClaim(const Error& why);
  static Task<> checkClaim(std::shared_ptr<PeerConnection> self);

  // --- connection_session.cpp: the durable plane
  Task<> openSession(pb::OpenSession request);
  [[nodiscard]] bool isStationsPeer() const;
  /// Removes the trainee from a status unless the server keeps the session open under that name.
  std::optional<pb::Refusal> onStationStatus(pb::StationStatus status);
  void onCloseSession(pb::CloseSession request);
  static Task<> closeSession(std::shared_ptr<PeerConnection> self, pb::CloseSession request,
                             std::optional<ByteBudget::Share> place);
  void onClockOffset(const pb::ClockOffset& offset);
  bool endedAsDeposed(const Status& status);
  void onDisplaced() override;
  Watermarks& watermarks(const std::string& session_id);
  static Result<Uuid> sessionIdOf(const std::string& bytes);
  static std::string sessionText(const std::string& bytes);
  static pb::Refusal sessionRefusal(pb::Refusal::Reason reason, std::string text,
                                    const std::string& session_id, std::uint64_t expected_seq = 0);

  // --- connection_chunks.cpp: the durable plane's chunks
  void onChunk(pb::Chunk chunk);
  void chunkDone(const pb::Chunk& chunk, const Status& status, const Appended& appended);
  void refuseChunk(const pb::Chunk& chunk, const Appended& appended);
  void scheduleAcks();
  void sendAcks();
  static Task<> safeOf(std::shared_ptr<PeerConnection> self);

  ServerContext& context_;
  const std::uint64_t id_;
  const std::shared_ptr<Channel> channel_;
  ConnectionState state_ = ConnectionState::kConnecting;
  Principal who_;
  std::shared_ptr<const StationClaim> claim_;  // of a station; null: no other server uses the database
  std::string program_;                        // from its Hello, at most kMaxProgramBytes
  Signal pong_;                                // a Pong has arrived, or this connection is ending
  // ids of this connection's own Pings; the channel's Pings have no ids
  std::uint64_t pings_asked_ = 0, pings_answered_ = 0;
  Signal freed_;  // pending work has ended: there may be room to read on
  std::size_t chunks_in_flight_ = 0;
  std::size_t requests_at_work_ = 0;
  std::size_t refusals_ = 0;          // sent by this server
  std::size_t refusals_of_peer_ = 0;  // after log-in
  std::string turn_name_;  // owner of the small messages' count: the account, before log-in the connection
  bool acks_scheduled_ = false;
  /// gone(), for work on other threads that waits for its turn.
  const std::shared_ptr<std::atomic<bool>> gone_ = std::make_shared<std::atomic<bool>>(false);
  const std::string address_key_;  // the peer's address as a key (Admission::keyOf)
  bool my_turn_ = false;           // for the handshake; stays true
  std::map<std::string, Watermarks> sessions_;
  std::set<std::string> closing_sessions_;
};

}  // namespace needlelab
