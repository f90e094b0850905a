/// Two ends of a TLS connection on 127.0.0.1, on one io_context that the test runs.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "common/wire/certificates.h"
#include "common/wire/channel.h"
#include "common/wire/tls.h"
#include "tests/support/patience.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {

/// One private CA and one server certificate for all tests of a binary.
struct TestTls {
  TempFolder folder;
  TlsFiles files = tlsFilesIn(folder.path() / "tls");
  TlsContext server, client;
  TestTls() {
    const auto made = ensureTlsFiles(files, {{"localhost", "127.0.0.1"}});
    if (!made.ok()) throw std::runtime_error(made.error().message);
    server = *makeServerTls(files.certificate, files.key);
    client = *makeClientTls(files.ca_certificate);
  }
  static TestTls& get() {
    static TestTls tls;
    return tls;
  }
};

class Loopback {
 public:
  using Ms = std::chrono::milliseconds;

  asio::io_context io{1};
  std::shared_ptr<Channel> server, client;

  /// Returns a connected pair of plain TCP sockets: {server, client}.
  std::pair<Tcp::socket, Tcp::socket> sockets() {
    Tcp::acceptor acceptor(io, Tcp::endpoint(asio::ip::address_v4::loopback(), 0));
    Tcp::socket near(io), far(io);
    near.connect(acceptor.local_endpoint());
    acceptor.accept(far);
    return {std::move(far), std::move(near)};
  }

  /// Returns both channels after the handshake.
  void connect(ChannelLimits server_limits = {}, ChannelLimits client_limits = {}) {
    auto [far, near] = sockets();
    server = Channel::make(TlsStream(std::move(far), *TestTls::get().server), server_limits);
    client = Channel::make(TlsStream(std::move(near), *TestTls::get().client), client_limits);
    int done = 0;
    for (const auto& [channel, side] : {std::pair{server, asio::ssl::stream_base::server},
                                        std::pair{client, asio::ssl::stream_base::client}}) {
      asio::co_spawn(io, shake(channel, side, &done), rethrow);
    }
    ASSERT_TRUE(runUntil([&] { return done == 2; }));
  }

  static Task<> shake(std::shared_ptr<Channel> channel, asio::ssl::stream_base::handshake_type side,
                      int* done) {
    auto status = co_await channel->handshake(side);
    EXPECT_TRUE(status.ok()) << (status.ok() ? "" : status.error().message);
    ++*done;
  }

  /// Runs until `done()` is true. Returns false after `limit`.
  bool runUntil(const std::function<bool()>& done, Ms limit = kPatience) {
    const auto deadline = std::chrono::steady_clock::now() + limit;
    while (!done()) {
      io.restart();
      io.run_one_until(std::min(deadline, std::chrono::steady_clock::now() + Ms(20)));
      if (std::chrono::steady_clock::now() >= deadline) return done();
    }
    return true;
  }
  void runFor(Ms time) {
    (void)runUntil([] { return false; }, time);
  }

  /// Returns the next envelope of a channel, or the error. Returns kNotFound if none arrived in time; the
  /// next call continues to wait.
  Result<pb::Envelope> receive(const std::shared_ptr<Channel>& channel, Ms limit = kPatience) {
    auto& got = pending_[channel.get()];
    if (!got) {
      got = std::make_shared<std::optional<Result<pb::Envelope>>>();
      asio::co_spawn(io, receiveInto(channel, got), rethrow);
    }
    if (!runUntil([&] { return got->has_value(); }, limit))
      return Error{ErrorCode::kNotFound, "nothing came"};
    const auto taken = std::exchange(got, nullptr);
    return **taken;
  }

 private:
  static Task<> receiveInto(std::shared_ptr<Channel> channel,
                            std::shared_ptr<std::optional<Result<pb::Envelope>>> into) {
    auto got = co_await channel->receive();
    into->emplace(std::move(got));
  }

  std::map<Channel*, std::shared_ptr<std::optional<Result<pb::Envelope>>>> pending_;
};

}  // namespace needlelab::test
