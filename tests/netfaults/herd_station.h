/// A light station of the herd: connects as the real one does (connectClient, Backoff), sends a chunk of 1 s
/// each second, keeps what is not acknowledged.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "client/net/backoff.h"
#include "client/net/client.h"
#include "client/net/spool.h"
#include "common/gesture/session_hash.h"

namespace needlelab::test {

using HerdClock = std::chrono::steady_clock;

/// The chunks that all stations of the herd send: equal ones, because only their number matters here.
class HerdChunks {
 public:
  explicit HerdChunks(std::size_t most);
  [[nodiscard]] const std::string& data(std::uint64_t seq) const { return chunks_.at(seq); }
  [[nodiscard]] std::uint64_t most() const { return chunks_.size(); }
  static constexpr std::uint64_t kSamples = 1000;

 private:
  std::vector<std::string> chunks_;
};

/// What became of all attempts to connect. One thread.
struct HerdTally {
  std::vector<HerdClock::time_point> connected;  ///< logged in
  std::uint64_t lost = 0;                        ///< connections that ended
  std::map<std::string, std::uint64_t> failed;   ///< attempts, by the kind of failure
  std::uint64_t went_back = 0;  ///< sessions of which the server had less than it acknowledged
};

/// Thread: that of the io_context. Must outlive its coroutine.
class HerdStation {
 public:
  HerdStation(asio::io_context& io, ClientConfig config, std::uint64_t seed, const HerdChunks& chunks,
              HerdTally& tally);
  static Task<> run(HerdStation& self);

  /// Logged in, session open, and all made before `since` is acknowledged.
  [[nodiscard]] bool whole() const { return open_ && committed_ >= backlog_; }
  /// The server was killed now: when is it whole again, with what is made until it is back?
  void outage() { open_ = false, whole_at_.reset(); }
  [[nodiscard]] std::optional<HerdClock::time_point> wholeAt() const { return whole_at_; }
  /// No more chunks: send the rest and close the session.
  void end() { ending_ = true; }
  [[nodiscard]] bool complete() const { return complete_; }
  [[nodiscard]] std::uint64_t committed() const { return committed_; }
  [[nodiscard]] const std::string& trouble() const { return trouble_; }

 private:
  Task<> serve(std::shared_ptr<Channel> channel);
  static Task<> feed(HerdStation& self, std::shared_ptr<Channel> channel);
  void pump(Channel& channel);
  [[nodiscard]] std::uint64_t made() const;
  [[nodiscard]] pb::Envelope openMessage() const;
  [[nodiscard]] pb::Envelope closeMessage() const;
  void handle(Channel& channel, const pb::Envelope& envelope);

  asio::io_context& io_;
  ClientConfig config_;
  Backoff backoff_;
  const HerdChunks& chunks_;
  HerdTally& tally_;
  std::string id_;
  HerdClock::time_point began_;
  bool open_ = false, ending_ = false, closing_ = false, complete_ = false;
  std::uint64_t sent_ = 0, committed_ = 0, backlog_ = 0, end_at_ = 0;
  std::optional<HerdClock::time_point> whole_at_;
  std::string trouble_;
};

}  // namespace needlelab::test
