/// A server's connection to one peer, from TLS to the end: its state, role and pending work.
#pragma once

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
#include "db/session_store.h"
#include "db/station_claims.h"
#include "needlelab/envelope.pb.h"
#include "server/live/context.h"
#include "server/live/hub.h"
#include "server/live/offload.h"
#include "server/live/rules.h"

namespace needlelab {

/// Thread: the network's. Ownership: shared by its coroutines and callbacks; the context must outlive it.
class PeerConnection : public HubPeer, public std::enable_shared_from_this<PeerConnection> {
 public:
  PeerConnection(ServerContext& context, std::uint64_t id, std::shared_ptr<Channel> channel);
  ~PeerConnection() override;
  PeerConnection(const PeerConnection&) = delete;
  PeerConnection& operator=(const PeerConnection&) = delete;

  /// Runs the connection: handshake, messages, end. The context lists it for that time.
  static Task<> run(std::shared_ptr<PeerConnection> self);

  /// When the server stops: reads no more, waits until the received chunks are committed and acknowledged,
  /// sends Bye.
  static Task<> shutDown(std::shared_ptr<PeerConnection> self, std::string reason);

  /// Sends the refusal as the last message and closes.
  void refuseAndClose(pb::Refusal refusal);

  /// Closes the connection now, without a last message.
  void cut(const std::string& reason);

  /// For co_spawn of a connection's work. What it throws (no memory) becomes a log line and ends this
  /// connection alone.
  static std::function<void(std::exception_ptr)> endsAlone(std::shared_ptr<PeerConnection> self);

  /// After a verified backup: tells the station the sessions and chunks that it covers.
  static Task<> tellSafe(std::shared_ptr<PeerConnection> self);

  /// Sends a message to this peer and waits until the peer has read it, confirmed by its answer to a Ping
  /// sent after the message.
  static Task<bool> sendConfirmed(std::shared_ptr<PeerConnection> self, pb::Envelope envelope);

  void sendControl(const pb::Envelope& envelope) override;
  void sendLive(Frame frame, bool counted) override;
  [[nodiscard]] std::string account() const override { return who_.name; }

  [[nodiscard]] std::uint64_t id() const { return id_; }
  [[nodiscard]] ConnectionState state() const { return state_; }
  [[nodiscard]] const Principal& who() const { return who_; }
  [[nodiscard]] const std::string& address() const { return channel_->peerAddress(); }
  /// The address without the port.
  [[nodiscard]] std::string peerHost() const;
  [[nodiscard]] const Channel& channel() const { return *channel_; }
  /// Whether the peer no longer waits for replies: the connection ends, or the peer has hung up.
  [[nodiscard]] bool gone() const { return *gone_; }
  /// Asks the kernel whether the peer has hung up: of one with the most requests nothing is read. Call it by
  /// the clock while hasRequests().
  void lookForHangUp();
  [[nodiscard]] bool hasRequests() const { return requests_at_work_ > 0; }
  [[nodiscard]] bool isLoggingIn() const { return state_ == ConnectionState::kLoggingIn; }
  [[nodiscard]] bool over() const { return state_ >= ConnectionState::kClosing; }

 private:
  /// A session's watermarks that this connection has sent or is about to send.
  struct Watermarks {
    std::uint64_t committed = 0;
    std::uint64_t safe = 0;
    std::uint64_t most_safe = UINT64_MAX;  // of what acks make Safe, SessionStore::mostSafeSeqs()
    bool ack_due = false;
    bool open = false;        // here: its close has not been answered on this connection
    std::string trainee_ref;  // sessions.trainee
    std::string trainee;      // as people read it; empty: it is closed, or no person's

    void noteCommitted(std::uint64_t seqs, bool acks_are_safe) {
      committed = std::max(committed, seqs);
      if (acks_are_safe) safe = std::max(safe, std::min(committed, most_safe));
    }
  };

  /// A message's parts of the budgets.
  struct Shares {
    std::optional<ByteBudget::Share> decoded;  // of a message that is not small
    std::optional<ByteBudget::Share> reply;    // of a request
  };

  // --- connection.cpp: lifetime
  Task<Status> shakeHands();
  static void giveTurns(ServerContext& context);
  void setState(ConnectionState next);
  void refuse(pb::Refusal refusal, std::uint64_t request = 0);
  void refuse(pb::Refusal::Reason reason, std::string text, std::uint64_t request = 0);
  /// A line of the log, of the account's, or before the log-in of all strangers' (PeerLines).
  void note(const PeerLineKind& kind, std::initializer_list<LogField> fields);
  void refusedByPeer(const pb::Refusal& refusal);
  /// To a browser that took this port for the console's; then the connection ends.
  void answerHttp();
  void leave();
  [[nodiscard]] bool busy() const;
  /// `until_sent`: as Channel::send.
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

  // --- connection_login.cpp
  void greet(const pb::Hello& hello);
  Task<> logIn(pb::Login given);
  Task<Result<Tokens::Holder>> checkLogin(std::shared_ptr<const pb::Login> login);
  bool takePlace();
  Task<> welcome(std::int64_t password_ns);
  bool isLateLogin();
  Task<bool> claimStation();
  void refuseClaim(const Error& why);
  static Task<> lookAtClaim(std::shared_ptr<PeerConnection> self);

  // --- connection_session.cpp: the durable plane
  Task<> openSession(pb::OpenSession request);
  [[nodiscard]] bool isStationsPeer() const;
  /// Forgets the name in a status unless the server keeps its session open in this name.
  std::optional<pb::Refusal> takeStatus(pb::StationStatus status);
  void takeChunk(pb::Chunk chunk);
  void chunkDone(const pb::Chunk& chunk, const Status& status, const Appended& appended);
  void refuseChunk(const pb::Chunk& chunk, const Appended& appended);
  void scheduleAcks();
  void sendAcks();
  void takeClose(pb::CloseSession request);
  static Task<> closeSession(std::shared_ptr<PeerConnection> self, pb::CloseSession request,
                             std::optional<ByteBudget::Share> place);
  void takeClockOffset(const pb::ClockOffset& offset);
  bool endedAsDeposed(const Status& status);
  void onDisplaced() override;
  Watermarks& watermarks(const std::string& session_id);

  ServerContext& context_;
  const std::uint64_t id_;
  const std::shared_ptr<Channel> channel_;
  ConnectionState state_ = ConnectionState::kConnecting;
  Principal who_;
  std::shared_ptr<const StationClaim> claim_;  // of a station; null: no other server works on the database
  std::string program_;                        // from its Hello, at most kMostProgramBytes
  Signal pong_;                                // a Pong has arrived, or this connection ends
  // ids of this connection's own Pings; the channel's Pings have no ids
  std::uint64_t pings_asked_ = 0, pings_answered_ = 0;
  Signal freed_;  // pending work has ended: there may be capacity to read on
  std::size_t chunks_in_flight_ = 0;
  std::size_t requests_at_work_ = 0;
  std::size_t refusals_ = 0;          // sent by this server
  std::size_t refusals_of_peer_ = 0;  // after log-in
  std::string turn_name_;             // whose small messages count: until the log-in its own
  bool acks_scheduled_ = false;
  /// gone(), for work on other threads that waits for its turn.
  const std::shared_ptr<std::atomic<bool>> gone_ = std::make_shared<std::atomic<bool>>(false);
  const std::string address_key_;  // the peer's address as a key (Admission::keyOf)
  bool my_turn_ = false;           // for the handshake; it stays true
  std::map<std::string, Watermarks> sessions_;
  std::set<std::string> closing_sessions_;
};

}  // namespace needlelab
