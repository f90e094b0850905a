/// A whole server in this process on a free port, and peers that connect to it over TLS.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "client/net/link/blocking_client.h"
#include "common/base/text/uuid.h"
#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"
#include "server/base/log.h"
#include "server/server.h"
#include "tests/support/patience.h"
#include "tests/support/store/postgres_database.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {

using std::chrono::milliseconds;

class RunningServer {
 public:
  explicit RunningServer(std::function<void(ServerOptions&)> tweak = {}) : tweak_(std::move(tweak)) {
    setLogLevel(LogLevel::kOff);
    start();
  }
  ~RunningServer() { (void)stop(); }

  void start() {
    ServerOptions options;
    options.data = folder_.path() / "data";
    options.listen = "127.0.0.1:0";
    options.writer.window = milliseconds(5);
    options.limits.close_grace = milliseconds(200);
    options.limits.handshake_timeout = kPatience;
    if (tweak_) tweak_(options);
    if (onPostgres() && options.store_url.empty()) options.store_url = postgresUrlOf(options.data);
    auto started = Server::start(std::move(options));
    if (!started.ok()) throw std::runtime_error(started.error().message);
    server_ = std::move(*started);
    thread_ = std::thread([this] { exit_code_ = server_->run(); });
  }
  /// Stops the server as SIGTERM does. Returns the exit code.
  int stop() {
    if (!server_) return exit_code_;
    server_->stop();
    thread_.join();
    counters_ = server_->counters();
    server_.reset();
    return exit_code_;
  }
  int restart() {
    const int code = stop();
    start();
    return code;
  }

  /// Of the last stopped server.
  [[nodiscard]] const ServerCounters& counters() const { return counters_; }

  Server& server() { return *server_; }
  Service& service() { return server_->store().service(); }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_.path(); }

  pb::Reply asAdmin(const pb::Request& request) {
    Outcome outcome = service().execute({"root", pb::ADMINISTRATOR}, request);
    if (outcome.error) throw std::runtime_error(outcome.error->message);
    return outcome.reply;
  }
  /// Adds a station and returns its key.
  std::string addStation(const std::string& name) {
    pb::Request request;
    request.mutable_add_station()->set_name(name);
    return asAdmin(request).station_key().key();
  }
  void addUser(const std::string& name, pb::Role role, const std::string& password) {
    pb::Request request;
    request.mutable_add_user()->set_name(name);
    request.mutable_add_user()->set_role(role);
    request.mutable_add_user()->set_password(password);
    asAdmin(request);
  }

  ClientConfig config(pb::Login login) {
    ClientConfig config;
    config.server.port = server_->port();
    config.ca_file = server_->caFile();
    config.program = programText("test");
    config.login = std::move(login);
    config.connect_timeout = config.reach_timeout = kPatience;
    config.limits.close_grace = milliseconds(200);
    return config;
  }
  Result<BlockingClient> connect(pb::Login login) {
    return BlockingClient::connect(config(std::move(login)));
  }

 private:
  TempFolder folder_;
  PostgresBelow dropped_at_end_{folder_.path()};
  std::function<void(ServerOptions&)> tweak_;
  std::unique_ptr<Server> server_;
  std::thread thread_;
  int exit_code_ = -1;
  ServerCounters counters_;
};

/// Returns the next message that `wanted` accepts and skips others. Fails the test if none arrives.
template <typename Wanted>
pb::Envelope waitFor(BlockingClient& client, Wanted wanted, milliseconds limit = kPatience) {
  const auto end = std::chrono::steady_clock::now() + limit;
  for (;;) {
    const auto left = std::chrono::duration_cast<milliseconds>(end - std::chrono::steady_clock::now());
    auto got = client.receive(std::max(left, milliseconds(0)));
    if (!got.ok()) {
      ADD_FAILURE() << "the awaited message did not come: " << got.error().message;
      return {};
    }
    if (wanted(*got)) return std::move(*got);
  }
}

inline pb::Refusal waitForRefusal(BlockingClient& client) {
  return waitFor(client, [](const pb::Envelope& e) { return e.has_refusal(); }).refusal();
}

/// A session as a station makes it: sample values depend on the tick; chunks of 100 samples.
class FakeSession {
 public:
  explicit FakeSession(std::string station) : station_(std::move(station)) {
    const Uuid id = makeUuidV7();
    id_.assign(id.begin(), id.end());
  }
  [[nodiscard]] const std::string& id() const { return id_; }

  pb::Envelope open(const std::string& profile_json = "{}") const {
    pb::Envelope envelope;
    pb::SessionDescription& d = *envelope.mutable_open_session()->mutable_description();
    d.set_session_id(id_);
    d.set_station(station_);
    d.set_trainee("tina");
    d.set_exercise_id("practice");
    d.set_profile_id("practice");
    d.set_profile_json(profile_json);
    d.set_engine_version("test");
    d.set_rate_hz(1000);
    d.set_started_unix_ns(1'000'000'000);
    d.mutable_resolution()->set_length_m(1e-6);
    d.mutable_resolution()->set_quaternion(0x1p-15);
    d.mutable_resolution()->set_force_n(1e-3);
    d.mutable_resolution()->set_torque_nm(1e-4);
    d.mutable_resolution()->set_time_s(1e-6);
    d.mutable_resolution()->set_speed_m_s(1e-4);
    return envelope;
  }

  static Bytes bytes(std::uint64_t seq, double offset_m = 0) {
    std::vector<GestureSample> samples(100);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      samples[i].tick = seq * 100 + i;
      samples[i].time_ns = static_cast<std::int64_t>(samples[i].tick) * 1'000'000;
      samples[i].p_WT_m[2] = offset_m + 1e-6 * static_cast<double>(samples[i].tick);
    }
    return encodeChunk(Resolution::standard(), samples);
  }
  [[nodiscard]] pb::Envelope chunk(std::uint64_t seq, double offset_m = 0) const {
    const Bytes data = bytes(seq, offset_m);
    pb::Envelope envelope;
    envelope.mutable_chunk()->set_session_id(id_);
    envelope.mutable_chunk()->set_seq(seq);
    envelope.mutable_chunk()->set_data(data.data(), data.size());
    return envelope;
  }
  [[nodiscard]] pb::Envelope close(std::uint64_t chunks) const {
    SessionHash hash;
    for (std::uint64_t seq = 0; seq < chunks; ++seq) hash.update(bytes(seq));
    const Digest digest = hash.digest();
    pb::Envelope envelope;
    pb::CloseSession& close = *envelope.mutable_close_session();
    close.set_session_id(id_);
    close.set_chunks(chunks);
    close.set_samples(chunks * 100);
    close.set_hash(digest.data(), digest.size());
    return envelope;
  }

  void waitForAck(BlockingClient& client, std::uint64_t committed) const {
    (void)waitFor(client, [&](const pb::Envelope& e) {
      return e.has_ack() && e.ack().session_id() == id_ && e.ack().committed_seqs() >= committed;
    });
  }

 private:
  std::string station_, id_;
};

}  // namespace needlelab::test
