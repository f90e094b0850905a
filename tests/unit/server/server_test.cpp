#include "server/server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <future>

#include "common/base/files/files.h"
#include "common/wire/certificates.h"
#include "tests/support/patience.h"
#include "tests/support/sanitized.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;

std::uint64_t residentBytes() {
  std::uint64_t all = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> all >> resident;
  return resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

TEST(Server, memoryThatABurstLeftFreeGoesBackToTheSystem) {
  if (kSanitized) GTEST_SKIP() << "a sanitizer's allocator keeps what is freed";
  RunningServer server([](ServerOptions& options) { options.heap_every = milliseconds(50); });
  constexpr std::size_t kBurstBytes = 64u << 20, kPiece = 8u << 10;
  const std::uint64_t before = residentBytes();
  // Remaining blocks lie between freed blocks, as after many connections, so the heap cannot shrink.
  std::vector<std::string> pieces;
  for (std::size_t i = 0; i < kBurstBytes / kPiece; ++i) pieces.emplace_back(kPiece, 'x');
  ASSERT_GT(residentBytes(), before + kBurstBytes / 2);
  for (std::size_t i = 0; i < pieces.size(); ++i)
    if ((i + 1) % 64 != 0) std::string().swap(pieces[i]);
  EXPECT_TRUE(eventually([&] { return residentBytes() < before + kBurstBytes / 4; }));
}

TEST(Server, aNewCertificateIsUsedWithoutARestart) {
  RunningServer server([](ServerOptions& options) { options.certificate_every = milliseconds(10); });
  auto before = server.connect(stationLogin("bench-1", server.addStation("bench-1")));
  ASSERT_TRUE(before.ok());
  const TlsFiles files = tlsFilesIn(server.folder() / "data" / "tls");
  ASSERT_TRUE(prepareAuthority(files, {}).ok());
  ASSERT_TRUE(switchAuthority(files).ok());
  ASSERT_TRUE(dropOldAuthorities(files).ok());
  // this client trusts only the new authority
  const std::string other = server.addStation("bench-2");
  while (!server.connect(stationLogin("bench-2", other)).ok()) std::this_thread::sleep_for(milliseconds(10));
  pb::Envelope ping;
  ping.mutable_ping()->set_id(7);
  ASSERT_TRUE(before->send(ping).ok());
  EXPECT_EQ(waitFor(*before, [](const pb::Envelope& e) { return e.has_pong(); }).pong().id(), 7u);
}

TEST(Server, peersHearByeAndTheExitIsClean) {
  RunningServer server;
  auto station = server.connect(stationLogin("bench-1", server.addStation("bench-1")));
  ASSERT_TRUE(station.ok());
  FakeSession session("bench-1");
  ASSERT_TRUE(station->send(session.open()).ok());
  for (std::uint64_t seq = 0; seq < 20; ++seq) ASSERT_TRUE(station->send(session.chunk(seq)).ok());
  session.waitForAck(*station, 1);
  EXPECT_EQ(server.stop(), 0);
  std::uint64_t acked = 0;
  bool bye = false;
  for (;;) {
    const auto got = station->receive(kPatience);
    if (!got.ok()) break;
    if (got->has_ack()) acked = std::max(acked, got->ack().committed_seqs());
    bye |= got->has_bye();
  }
  EXPECT_TRUE(bye);
  // After the restart everything that was acknowledged exists.
  server.start();
  auto again = server.connect(stationLogin("bench-1", [&] { return std::string(32, 'x'); }()));
  EXPECT_FALSE(again.ok());
  pb::Request request;
  request.mutable_get_session()->set_session_id(session.id());
  EXPECT_GE(server.asAdmin(request).session().chunks(), acked);
}

TEST(Server, stoppingDoesNotWaitForAPeerThatDoesNotRead) {
  RunningServer server([](ServerOptions& options) { options.drain = milliseconds(1500); });
  auto station = server.connect(stationLogin("bench-1", server.addStation("bench-1")));
  ASSERT_TRUE(station.ok());
  EXPECT_EQ(server.stop(), 0);  // otherwise the test never ends
}

TEST(Server, stoppingDuringARunOfRetentionEndsTheServer) {
  setLogLevel(LogLevel::kOff);
  const TempFolder folder;
  ServerOptions options;
  options.data = folder.path() / "data";
  options.listen = "127.0.0.1:0";
  options.retention_first = std::chrono::minutes(0);
  auto started = Server::start(options);
  ASSERT_TRUE(started.ok()) << started.error().message;
  Server& server = **started;
  // The writer is blocked, so the run cannot end: it records its end through the writer.
  std::promise<void> go_on;
  std::atomic<bool> stands = false;
  DbWriter::Work wait = [&, may = go_on.get_future().share()](Connection&) -> Status {
    stands = true;
    may.wait();
    return {};
  };
  ASSERT_TRUE(server.store().writer().post(std::move(wait), [](const Status&) {}).ok());
  EXPECT_TRUE(eventually([&] { return stands.load(); }));
  auto ended = std::async(std::launch::async, [&] { return server.run(); });
  EXPECT_TRUE(eventually([&] { return server.store().writer().counters().waiting > 0; }));
  server.stop();
  // Once the port is closed, the server is stopping: work that the run posts to its thread comes later.
  EXPECT_TRUE(eventually([&] {
    asio::io_context io;
    Tcp::socket peer(io);
    boost::system::error_code refused;
    peer.connect({asio::ip::address_v4::loopback(), server.port()}, refused);
    return bool(refused);
  }));
  go_on.set_value();
  EXPECT_EQ(ended.wait_for(kPatience), std::future_status::ready)
      << "the server waits for its next daily run";
  EXPECT_EQ(ended.get(), 0);
}

TEST(Server, aStopBeforeTheRunEndsItAtOnce) {
  setLogLevel(LogLevel::kOff);
  const TempFolder folder;
  ServerOptions options;
  options.data = folder.path() / "data";
  options.listen = "127.0.0.1:0";
  options.handle_signals = true;
  auto started = Server::start(options);
  ASSERT_TRUE(started.ok()) << started.error().message;
  (*started)->stop();
  auto ended = std::async(std::launch::async, [&] { return (*started)->run(); });
  EXPECT_EQ(ended.wait_for(kPatience), std::future_status::ready);
  EXPECT_EQ(ended.get(), 0);
}

TEST(Server, aTakenPortIsUnavailableAndChangesNothingOnDisk) {
  RunningServer server;
  const TempFolder folder;
  ServerOptions options;
  options.data = folder.path() / "data";
  options.listen = "127.0.0.1:" + std::to_string(server.server().port());
  const auto second = Server::start(options);
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().message, testing::HasSubstr("taken"));
  EXPECT_FALSE(std::filesystem::exists(options.data));
}

TEST(Server, aFolderServesOneServer) {
  RunningServer server;
  ServerOptions options;
  options.data = server.folder() / "data";
  options.listen = "127.0.0.1:0";
  const auto second = Server::start(options);
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
}

TEST(Server, thePortFileHoldsThePort) {
  RunningServer server(
      [](ServerOptions& options) { options.port_file = options.data.parent_path() / "port"; });
  EXPECT_EQ(*readWholeFile(server.folder() / "port"), std::to_string(server.server().port()) + "\n");
}

TEST(Server, aFullHouseTurnsNewcomersAwayAndServesThoseInside) {
  RunningServer server([](ServerOptions& options) { options.max_connections = 1; });
  const std::string key = server.addStation("bench-1");
  auto inside = server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(inside.ok());
  EXPECT_EQ(server.connect(stationLogin("bench-1", key)).error().code, ErrorCode::kUnavailable);
  FakeSession session("bench-1");
  ASSERT_TRUE(inside->send(session.open()).ok());
  (void)waitFor(*inside, [](const pb::Envelope& e) { return e.has_session_opened(); });
}

}  // namespace
}  // namespace needlelab
