/// A server whose answers a test scripts, and a link clock that the test controls.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <utility>
#include <vector>

#include "client/net/link/server_link.h"
#include "common/wire/certificates.h"
#include "common/wire/protocol.h"
#include "tests/support/patience.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/client/net/link/loopback_server.h"

namespace needlelab::test {

/// A scripted server: answers each envelope as the test defines, on any number of connections.
class ScriptedServer : public LoopbackServer {
 public:
  using Script = std::function<std::vector<pb::Envelope>(const pb::Envelope&)>;

  explicit ScriptedServer(Script script) : script_(std::move(script)) {
    if (!ensureTlsFiles(files, {{"localhost", "127.0.0.1"}}).ok())
      throw std::runtime_error("no certificates");
    begin(*makeServerTls(files.certificate, files.key));
  }
  /// With the certificate of these files.
  ScriptedServer(Script script, TlsFiles given) : files(std::move(given)), script_(std::move(script)) {
    begin(*makeServerTls(files.certificate, files.key));
  }
  ~ScriptedServer() override { end(); }
  [[nodiscard]] ClientConfig config() const {
    ClientConfig config;
    config.server.port = port();
    config.ca_file = files.ca_certificate;
    config.login = personLogin("anna", "secret");
    config.connect_timeout = kPatience;
    config.limits.close_grace = std::chrono::milliseconds(100);
    return config;
  }
  /// Returns all envelopes received on all connections.
  std::vector<pb::Envelope> received() {
    const std::scoped_lock lock(mutex_);
    return received_;
  }
  std::size_t count(const std::function<bool(const pb::Envelope&)>& which) {
    const auto all = received();
    return static_cast<std::size_t>(std::count_if(all.begin(), all.end(), which));
  }
  std::size_t logins() {
    return count([](const pb::Envelope& e) { return e.has_login(); });
  }

  TempFolder folder;
  TlsFiles files = tlsFilesIn(folder.path());

 private:
  Task<> serve(std::shared_ptr<Channel> channel) override {
    const Status shaken = co_await channel->handshake(asio::ssl::stream_base::server);
    if (!shaken.ok()) co_return;
    channels_.push_back(channel);
    for (;;) {
      auto got = co_await channel->receive();
      if (!got.ok()) co_return;
      {
        const std::scoped_lock lock(mutex_);
        received_.push_back(*got);
      }
      for (const auto& answer : script_(*got)) channel->send(answer);
    }
  }

  Script script_;
  std::mutex mutex_;
  std::vector<pb::Envelope> received_;
};

inline pb::Envelope hello() {
  pb::Envelope envelope;
  *envelope.mutable_hello()->mutable_version() = ourVersion();
  return envelope;
}

/// A server of this version that accepts every log-in and sends nothing more.
inline std::vector<pb::Envelope> friendly(const pb::Envelope& got) {
  if (got.has_hello()) return {hello()};
  pb::Envelope envelope;
  if (got.has_login()) envelope.mutable_welcome()->set_name(got.login().person().user());
  return got.has_login() ? std::vector{envelope} : std::vector<pb::Envelope>{};
}

/// Answers that a request is done.
inline pb::Envelope doneWith(const pb::Request& request) {
  pb::Envelope envelope;
  envelope.mutable_reply()->set_id(request.id());
  envelope.mutable_reply()->mutable_done();
  return envelope;
}

/// Friendly, but refuses log-ins while `deny` is set. `deny` must outlive the server.
inline ScriptedServer::Script friendlyUnless(const std::atomic<bool>& deny) {
  return [&deny](const pb::Envelope& got) -> std::vector<pb::Envelope> {
    if (!got.has_login() || !deny) return friendly(got);
    pb::Envelope no;
    *no.mutable_refusal() = makeRefusal(pb::Refusal::LOGIN, "wrong password", true);
    return {no};
  };
}

/// Time passes only when a test says so.
class TestClock : public LinkClock {
 public:
  TestClock() : LinkClock(time_) {}
  [[nodiscard]] std::int64_t unixNs() const override { return steadyNs(); }
  Task<> wait(asio::steady_timer& timer, std::chrono::milliseconds time, LinkWait what) override {
    const std::int64_t due_ns =
        time >= ServerLink::kForever ? INT64_MAX : steadyNs() + std::chrono::nanoseconds(time).count();
    if (time < ServerLink::kForever && what != LinkWait::kConnect) asked.push_back(time);
    waits_.push_back({due_ns, &timer, what});
    timer.expires_at(asio::steady_timer::time_point::max());
    co_await timer.async_wait(kUseTuple);
    std::erase_if(waits_, [&](const Wait& each) { return each.timer == &timer; });
  }
  /// Network traffic takes none of this time. When there is nothing to do and `passes` returns true, the time
  /// jumps to the next due time.
  void runOne(asio::io_context& io, std::int64_t due_ns) override {
    if (io.poll_one() > 0) return;
    if (!passes()) {
      io.run_one_for(std::chrono::milliseconds(2));
      return;
    }
    for (const Wait& each : waits_)
      if (each.what != LinkWait::kConnect && each.due_ns > steadyNs()) due_ns = std::min(due_ns, each.due_ns);
    advanceTo(due_ns);
  }
  void advance(std::chrono::milliseconds time) {
    advanceTo(steadyNs() + std::chrono::nanoseconds(time).count());
  }
  void advanceTo(std::int64_t to_ns) {
    time_.advanceTo(to_ns);
    for (const Wait& each : waits_)
      if (each.due_ns <= steadyNs()) each.timer->cancel();
  }
  /// Whether the link waits for a time: its back-off or a request's limit.
  [[nodiscard]] bool linkWaits() const {
    return std::any_of(waits_.begin(), waits_.end(), [this](const Wait& each) {
      return each.what != LinkWait::kConnect && each.due_ns > steadyNs() && each.due_ns < INT64_MAX;
    });
  }
  /// The waits of the back-off and of requests' limits.
  std::vector<std::chrono::milliseconds> asked;
  std::function<bool()> passes = [] { return false; };

 private:
  struct Wait {
    std::int64_t due_ns;
    asio::steady_timer* timer;
    LinkWait what;
  };
  FakeTime time_;
  std::vector<Wait> waits_;
};

}  // namespace needlelab::test
