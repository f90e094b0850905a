/// A server that speaks the real protocol over TLS, but keeps sessions in memory and misbehaves on demand.
#pragma once

#include <atomic>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "client/net/link/connect.h"
#include "common/base/time/clock.h"
#include "common/wire/certificates.h"
#include "common/wire/channel.h"
#include "common/wire/protocol.h"
#include "common/wire/tls.h"
#include "tests/support/patience.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/net/link/loopback_server.h"

namespace needlelab::test {

/// The server's misbehaviour. May be set before or while the server runs.
struct ServerFaults {
  std::atomic<int> drop_after_chunks{-1};  ///< close the connection after this many chunks, once
  std::atomic<int> forget_every_chunk{0};  ///< n > 0: drop every n-th chunk, so that a gap appears
  std::atomic<bool> deny_login{false};
  std::atomic<bool> never_ack{false};
  std::atomic<bool> contradict{false};      ///< reject every chunk as contradictory
  std::atomic<bool> busy_for_codes{false};  ///< refuse a lesson with a code: queue full
  std::atomic<bool> fail_codes{false};      ///< refuse a lesson with a code as INTERNAL
  std::atomic<bool> no_room{false};         ///< refuse to open a session: disk full
  std::atomic<bool> forget_session{false};  ///< once: reject a chunk with "unknown session"
};

/// The server's stored data of a session.
struct KeptSession {
  pb::SessionDescription description;
  std::vector<std::string> chunks;
  std::uint64_t repeated = 0;  ///< chunks received again
  std::uint64_t opened = 0;    ///< how often the session was opened
  bool closed = false;
  pb::CloseSession close;
  std::int64_t clock_round_trip_ns = 0;
};

/// Runs in its own thread.
class FakeServer : public LoopbackServer {
 public:
  FakeServer() : FakeServer(0) {}
  explicit FakeServer(std::uint16_t port) : LoopbackServer(port) { begin(tls().server); }
  ~FakeServer() override { end(); }
  [[nodiscard]] ClientConfig clientConfig() const { return clientConfig(port()); }
  static ClientConfig clientConfig(std::uint16_t port) {
    ClientConfig config;
    config.server = {"127.0.0.1", port};
    config.tls = tls().client;
    config.program = "test";
    config.login = stationLogin("station-1", std::string(32, 'k'));
    config.connect_timeout = kPatience;
    return config;
  }
  /// Returns a copy of the stored sessions, by session id.
  std::map<std::string, KeptSession> sessions() {
    const std::scoped_lock lock(mutex_);
    return sessions_;
  }
  std::uint64_t liveFrames() { return live_frames_; }
  /// The capture time stated in the newest live frame.
  std::int64_t newestCapture_unix_ns() { return newest_capture_unix_ns_; }
  /// Live frames that carry the memory of the cuts.
  std::uint64_t liveMemories() { return live_memories_; }
  /// Pings by which a station asks for our clock.
  std::uint64_t probes() { return probes_; }
  std::uint64_t statusLines() { return status_lines_; }
  pb::StationStatus newestStatus() {
    const std::scoped_lock lock(status_mutex_);
    return newest_status_;
  }
  /// Returns the largest number of chunks of one session so far.
  std::uint64_t mostChunks() { return most_chunks_; }
  /// The certificate authority of `clientConfig`, for programs that read it from a file.
  static std::filesystem::path caFile() { return tls().files.ca_certificate; }
  /// The lesson returned for every known exercise.
  void setLesson(const pb::Lesson& lesson) {
    const std::scoped_lock lock(mutex_);
    lesson_ = lesson;
  }
  pb::Lesson lesson() {
    const std::scoped_lock lock(mutex_);
    return lesson_;
  }
  /// GetLesson and CheckTrainee are refused while this trainee's code is missing or wrong, and always after
  /// five wrong ones. Empty: the trainee has no code.
  void setCode(const std::string& trainee, const std::string& code) {
    const std::scoped_lock lock(mutex_);
    codes_[trainee] = code;
    wrong_codes_[trainee] = 0;
  }
  /// Returns the codes sent with GetLesson and CheckTrainee, in order; empty where there was none.
  std::vector<std::string> givenCodes() {
    const std::scoped_lock lock(mutex_);
    return given_codes_;
  }
  /// Acknowledges all stored chunks of every session (for use with `never_ack`).
  void ackNow() {
    asio::post(io_, [this] {
      const std::scoped_lock lock(mutex_);
      for (const auto& channel : channels_)
        for (const auto& [id, session] : sessions_) sendAck(channel, id, session);
    });
  }
  ServerFaults faults;

 private:
  struct Tls {
    TempFolder folder;
    TlsFiles files = tlsFilesIn(folder.path() / "tls");
    TlsContext server, client;
    Tls() {
      const auto made = ensureTlsFiles(files, {{"127.0.0.1"}});
      if (!made.ok()) throw std::runtime_error(made.error().message);
      server = *makeServerTls(files.certificate, files.key);
      client = *makeClientTls(files.ca_certificate);
    }
  };
  static Tls& tls() {
    static Tls made;
    return made;
  }

  /// Only logged-in clients are in `channels_`.
  Task<> serve(std::shared_ptr<Channel> channel) override {
    if (auto shaken = co_await channel->handshake(asio::ssl::stream_base::server); !shaken.ok()) co_return;
    pb::Envelope hello;
    *hello.mutable_hello()->mutable_version() = ourVersion();
    channel->send(hello);
    bool logged_in = false;
    for (;;) {
      auto got = co_await channel->receive();
      if (!got.ok()) co_return;
      if (got->has_login()) {
        if (faults.deny_login) {
          pb::Envelope no;
          *no.mutable_refusal() = makeRefusal(pb::Refusal::LOGIN, "wrong key", true);
          channel->finish(CloseReason::kRefused, "login", &no);
          co_return;
        }
        channel->established();
        logged_in = true;
        pb::Envelope welcome;
        welcome.mutable_welcome()->set_name(got->login().station().station());
        channel->send(welcome);
        channels_.push_back(channel);
        continue;
      }
      if (logged_in) handle(channel, *got);
    }
  }

  void handle(const std::shared_ptr<Channel>& channel, const pb::Envelope& envelope) {
    const std::scoped_lock lock(mutex_);
    pb::Envelope answer;
    if (envelope.has_open_session()) {
      const auto& description = envelope.open_session().description();
      if (faults.no_room) {
        *answer.mutable_refusal() = makeRefusal(pb::Refusal::NO_ROOM, "the disk is full");
        answer.mutable_refusal()->set_session_id(description.session_id());
        channel->send(answer);
        return;
      }
      KeptSession& session = sessions_[description.session_id()];
      session.description = description;
      ++session.opened;
      answer.mutable_session_opened()->set_session_id(description.session_id());
      answer.mutable_session_opened()->set_next_seq(session.chunks.size());
      channel->send(answer);
    } else if (envelope.has_chunk()) {
      takeChunk(channel, envelope.chunk());
    } else if (envelope.has_close_session()) {
      KeptSession& session = sessions_[envelope.close_session().session_id()];
      session.closed = true;
      session.close = envelope.close_session();
      answer.mutable_session_closed()->set_session_id(envelope.close_session().session_id());
      answer.mutable_session_closed()->set_state(session.close.interrupted() ? pb::SESSION_INTERRUPTED
                                                                             : pb::SESSION_COMPLETE);
      answer.mutable_session_closed()->set_score_json("[]");
      channel->send(answer);
    } else if (envelope.has_ping()) {
      ++probes_;
      channel->send(pongTo(envelope.ping(), steadyNowNs()));
    } else if (envelope.has_clock_offset()) {
      sessions_[envelope.clock_offset().session_id()].clock_round_trip_ns =
          envelope.clock_offset().round_trip_ns();
    } else if (envelope.has_live_frame()) {
      newest_capture_unix_ns_ = envelope.live_frame().capture_unix_ns();
      ++live_frames_;
      if (!envelope.live_frame().cut_memory().empty()) ++live_memories_;
    } else if (envelope.has_station_status()) {
      const std::scoped_lock status_lock(status_mutex_);
      newest_status_ = envelope.station_status();
      ++status_lines_;
    } else if (envelope.has_request()) {
      answerRequest(channel, envelope.request());
    }
  }

  void answerRequest(const std::shared_ptr<Channel>& channel, const pb::Request& request) {
    pb::Envelope answer;
    std::optional<pb::Refusal> refusal;
    if (request.has_get_lesson()) {
      const pb::GetLesson& call = request.get_lesson();
      refusal = call.exercise_id() == "unknown" ? makeRefusal(pb::Refusal::NOT_FOUND, "no such exercise")
                                                : refusalOfCode(call.trainee(), call.code());
      *answer.mutable_reply()->mutable_lesson() = lesson_;
      answer.mutable_reply()->mutable_lesson()->set_code_checked(!codes_[call.trainee()].empty());
    } else if (request.has_check_trainee()) {
      refusal = refusalOfCode(request.check_trainee().trainee(), request.check_trainee().code());
      answer.mutable_reply()->mutable_trainee_checked()->set_code_checked(
          !codes_[request.check_trainee().trainee()].empty());
    } else {
      return;  // does not answer
    }
    answer.mutable_reply()->set_id(request.id());
    const bool has_code = !request.get_lesson().code().empty() || !request.check_trainee().code().empty();
    if (has_code && faults.busy_for_codes)
      refusal = makeRefusal(pb::Refusal::QUEUE_OVERFLOW, "the test says so");
    if (has_code && faults.fail_codes) refusal = makeRefusal(pb::Refusal::INTERNAL, "the test says so");
    if (refusal) {
      answer = {};
      *answer.mutable_refusal() = *refusal;
      answer.set_refused_request(request.id());
    }
    channel->send(answer);
  }

  std::optional<pb::Refusal> refusalOfCode(const std::string& trainee, const std::string& given) {
    given_codes_.push_back(given);
    const std::string& code = codes_[trainee];
    int& wrong = wrong_codes_[trainee];
    constexpr int kTries = 5;
    if (code.empty()) return std::nullopt;
    if (given.empty())
      return makeRefusal(pb::Refusal::CODE,
                         trainee + " has a code: type the PIN or hold the badge to the reader");
    if (wrong >= kTries)
      return makeRefusal(pb::Refusal::CODE, "too many wrong codes of " + trainee + ": try again in a minute");
    if (given == code) return std::nullopt;
    const std::string no = "this is not the code of " + trainee + "; ";
    if (++wrong == kTries) return makeRefusal(pb::Refusal::CODE, no + "try again in a minute");
    return makeRefusal(pb::Refusal::CODE, no + std::to_string(kTries - wrong) + " tries left");
  }

  static pb::Lesson smallLesson() {
    pb::Lesson lesson;
    lesson.set_profile_json("{}");
    lesson.set_profile_revision(7);
    return lesson;
  }

  void takeChunk(const std::shared_ptr<Channel>& channel, const pb::Chunk& chunk) {
    KeptSession& session = sessions_[chunk.session_id()];
    ++chunks_seen_;
    const auto refuse = [&](pb::Refusal::Reason reason) {
      pb::Envelope no;
      *no.mutable_refusal() = makeRefusal(reason, "the test says so");
      no.mutable_refusal()->set_session_id(chunk.session_id());
      no.mutable_refusal()->set_expected_seq(session.chunks.size());
      // like the real server: two recordings share an id, so no later chunk can be right
      const bool ends = reason == pb::Refusal::CONTRADICTION;
      no.mutable_refusal()->set_fatal(ends);
      if (ends)
        channel->finish(CloseReason::kRefused, "contradiction", &no);
      else
        channel->send(no);
    };
    if (faults.contradict) return refuse(pb::Refusal::CONTRADICTION);
    if (faults.forget_session.exchange(false)) return refuse(pb::Refusal::UNKNOWN_SESSION);
    if (faults.forget_every_chunk > 0 &&
        chunks_seen_ % static_cast<std::uint64_t>(faults.forget_every_chunk) == 0)
      return;
    if (chunk.seq() > session.chunks.size()) return refuse(pb::Refusal::GAP);
    if (chunk.seq() < session.chunks.size()) {
      ++session.repeated;
      if (session.chunks[chunk.seq()] != chunk.data()) return refuse(pb::Refusal::CONTRADICTION);
    } else {
      session.chunks.push_back(chunk.data());
    }
    most_chunks_ = std::max<std::uint64_t>(most_chunks_, session.chunks.size());
    if (faults.drop_after_chunks >= 0 && --faults.drop_after_chunks < 0) {
      // accepted, but not acknowledged
      channel->close(CloseReason::kLocal, "dropped by the test");
      std::erase(channels_, channel);
      return;
    }
    if (!faults.never_ack) sendAck(channel, chunk.session_id(), session);
  }

  static void sendAck(const std::shared_ptr<Channel>& channel, const std::string& id,
                      const KeptSession& session) {
    pb::Envelope ack;
    ack.mutable_ack()->set_session_id(id);
    ack.mutable_ack()->set_committed_seqs(session.chunks.size());
    channel->send(ack);
  }

  std::uint64_t chunks_seen_ = 0;
  std::mutex mutex_;
  std::map<std::string, KeptSession> sessions_;
  pb::Lesson lesson_ = smallLesson();
  std::map<std::string, std::string> codes_;  // by trainee
  std::map<std::string, int> wrong_codes_;
  std::vector<std::string> given_codes_;
  std::atomic<std::uint64_t> live_frames_{0}, live_memories_{0}, status_lines_{0}, most_chunks_{0},
      probes_{0};
  std::atomic<std::int64_t> newest_capture_unix_ns_{0};
  std::mutex status_mutex_;
  pb::StationStatus newest_status_;
};

}  // namespace needlelab::test
