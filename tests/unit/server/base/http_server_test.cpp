#include "server/base/http_server.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>

#include "server/live/offload.h"
#include "tests/unit/common/wire/loopback.h"

namespace needlelab {
namespace {

/// Answers when the test says so.
class PatientServer : public HttpServer {
 public:
  PatientServer(asio::io_context& loop, Tcp::acceptor acceptor)
      : HttpServer(loop, std::move(acceptor), std::nullopt, {}), may_answer(loop.get_executor()) {}

  Task<HttpAnswer> answer(std::shared_ptr<HttpRequest> request) override {
    asked = std::move(request);
    co_await may_answer.wait();
    co_return plainAnswer(200, "done");
  }
  std::optional<HttpAnswer> unreadable(const boost::system::error_code& error) override {
    return unreadableAnswer(error);
  }

  std::shared_ptr<HttpRequest> asked;
  Signal may_answer;

 protected:
  bool admit(std::uint64_t /*id*/, const Tcp::endpoint& /*peer*/) override { return true; }
};

TEST(HttpServer, whoHangsUpWhileARequestIsAnsweredIsGone) {
  test::Loopback loop;
  Tcp::acceptor acceptor(loop.io, Tcp::endpoint(asio::ip::address_v4::loopback(), 0));
  const Tcp::endpoint address = acceptor.local_endpoint();
  const auto server = std::make_shared<PatientServer>(loop.io, std::move(acceptor));
  server->beginAccepting();
  Tcp::socket client(loop.io);
  client.connect(address);
  const std::string request = "GET / HTTP/1.1\r\nHost: x\r\n\r\n";
  asio::write(client, asio::buffer(request));
  ASSERT_TRUE(loop.runUntil([&] { return server->asked != nullptr; }));
  server->lookForHangUps();
  EXPECT_FALSE(server->asked->gone());
  client.close();
  EXPECT_TRUE(loop.runUntil([&] {
    server->lookForHangUps();
    return server->asked->gone();
  }));
  server->may_answer.notify();
  EXPECT_TRUE(loop.runUntil([&] { return server->connections() == 0; }));
  server->stop();
  loop.io.poll();
}

}  // namespace
}  // namespace needlelab
