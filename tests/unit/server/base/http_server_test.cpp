#include "server/base/http_server.h"

#include <gtest/gtest.h>

#include <ctime>
#include <memory>
#include <string>
#include <utility>

#include "server/live/work/offload.h"
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

/// Echoes each request at once.
class EchoServer : public HttpServer {
 public:
  EchoServer(asio::io_context& loop, Tcp::acceptor acceptor, HttpLimits limits)
      : HttpServer(loop, std::move(acceptor), std::nullopt, limits) {}
  Task<HttpAnswer> answer(std::shared_ptr<HttpRequest> request) override {
    if (request->target == "/closed") co_return errorAnswer(401, "not_logged_in", "log in");
    co_return plainAnswer(200, request->host + " " + request->target + " " + request->body +
                                   (request->upgrade ? " socket" : ""));
  }
  std::optional<HttpAnswer> unreadable(const boost::system::error_code& error) override {
    return unreadableAnswer(error);
  }

 protected:
  bool admit(std::uint64_t /*id*/, const Tcp::endpoint& /*peer*/) override { return true; }
};

class HttpAnswers : public testing::Test {
 protected:
  HttpAnswers() {
    Tcp::acceptor acceptor(loop_.io, Tcp::endpoint(asio::ip::address_v4::loopback(), 0));
    address_ = acceptor.local_endpoint();
    HttpLimits limits;
    limits.body_bytes = 100;
    server_ = std::make_shared<EchoServer>(loop_.io, std::move(acceptor), limits);
    server_->beginAccepting();
  }
  ~HttpAnswers() override {
    server_->stop();
    server_->cut();
    loop_.runUntil([&] { return server_->connections() == 0; });
  }
  /// What a client receives after sending this, up to `until`.
  std::string told(const std::string& request, const std::string& until = "\n\n") {
    Tcp::socket client(loop_.io);
    client.connect(address_);
    asio::write(client, asio::buffer(request));
    client.non_blocking(true);
    std::string got;
    loop_.runUntil([&] {
      char piece[4096];
      boost::system::error_code error;
      const std::size_t count = client.read_some(asio::buffer(piece), error);
      got.append(piece, count);
      return got.find(until) != std::string::npos || (error && error != asio::error::would_block);
    });
    return got;
  }
  static std::string withHeaders(const std::string& more, const std::string& target = "/a") {
    return "GET " + target + " HTTP/1.1\r\n" + more + "\r\n";
  }
  test::Loopback loop_;
  Tcp::endpoint address_;
  std::shared_ptr<EchoServer> server_;
};

TEST_F(HttpAnswers, haveTheDate) {
  const std::string got = told(withHeaders("Host: lab\r\n"), "lab /a");
  const std::size_t at = got.find("\r\nDate: ");
  ASSERT_NE(at, std::string::npos) << got;
  std::tm date{};
  const char* const rest = ::strptime(got.c_str() + at + 8, "%a, %d %b %Y %H:%M:%S GMT", &date);
  ASSERT_NE(rest, nullptr) << got;
  EXPECT_EQ(std::string(rest, 2), "\r\n");
  EXPECT_NEAR(static_cast<double>(::timegm(&date)), static_cast<double>(std::time(nullptr)), 60);
}

TEST_F(HttpAnswers, areRefusalsWithoutExactlyOneHost) {
  EXPECT_NE(told(withHeaders("Host: lab\r\n"), "lab /a").find(" 200 "), std::string::npos);
  for (const char* const hosts : {"", "Host: lab\r\nHost: lab\r\n", "Host: lab\r\nhost: evil\r\n"}) {
    const std::string got = told(withHeaders(hosts), "Host:");
    EXPECT_NE(got.find("HTTP/1.1 400 "), std::string::npos) << got;
  }
  EXPECT_NE(told("GET /a HTTP/1.0\r\n\r\n", "/a").find(" 200 "), std::string::npos) << "1.0 had none";
}

TEST_F(HttpAnswers, areTheSameForAnAbsoluteTarget) {
  EXPECT_NE(told(withHeaders("Host: other\r\n", "https://lab:7751/a?b=c"), "/a").find("lab:7751 /a?b=c"),
            std::string::npos);
  EXPECT_NE(told(withHeaders("Host: other\r\n", "HTTP://lab"), "lab").find("lab / "), std::string::npos);
}

TEST_F(HttpAnswers, sayHowToLogInWith401) {
  const std::string got = told(withHeaders("Host: lab\r\n", "/closed"), "log in");
  EXPECT_NE(got.find("401"), std::string::npos);
  EXPECT_NE(got.find("WWW-Authenticate: Session realm=\"needlelab\"\r\n"), std::string::npos) << got;
}

TEST_F(HttpAnswers, letAClientGoOnThatWaitsForItBeforeItsBody) {
  const std::string head = "POST /a HTTP/1.1\r\nHost: lab\r\nExpect: 100-continue\r\nContent-Length: ";
  EXPECT_EQ(told(head + "4\r\n\r\n", "\r\n\r\n"), "HTTP/1.1 100 Continue\r\n\r\n");
  const std::string too_long = told(head + "101\r\n\r\n", "too large");
  EXPECT_NE(too_long.find("HTTP/1.1 413 "), std::string::npos) << too_long;
  const std::string at_once = told(head + "4\r\n\r\nbody", "body");
  EXPECT_NE(at_once.find("HTTP/1.1 200 "), std::string::npos) << "it did not wait";
}

TEST_F(HttpAnswers, openAWebSocketOnlyWithItsKey) {
  const auto upgrade = [&](const std::string& key) {
    return told(withHeaders("Host: lab\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
                            "Sec-WebSocket-Version: 13\r\n" +
                            key),
                "/a");
  };
  EXPECT_NE(upgrade("Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n").find("socket"), std::string::npos);
  for (const char* const wrong :
       {"Sec-WebSocket-Key: short\r\n", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ\r\n",
        "Sec-WebSocket-Key: !!hlIHNhbXBsZSBub25jZQ==\r\n"})
    EXPECT_EQ(upgrade(wrong).find("socket"), std::string::npos) << wrong;
}

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
  server->checkHangUps();
  EXPECT_FALSE(server->asked->gone());
  client.close();
  EXPECT_TRUE(loop.runUntil([&] {
    server->checkHangUps();
    return server->asked->gone();
  }));
  server->may_answer.notify();
  EXPECT_TRUE(loop.runUntil([&] { return server->connections() == 0; }));
  server->stop();
  loop.io.poll();
}

}  // namespace
}  // namespace needlelab
