// The limits for every peer: sizes, times, numbers, and input that is not HTTP.
#include <algorithm>
#include <atomic>
#include <future>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/wire/tls.h"
#include "tests/unit/server/live/log_lines.h"
#include "tests/unit/server/web/web_lab.h"

namespace needlelab {
namespace {

using namespace test;
using nlohmann::json;
using testing::HasSubstr;

TEST(WebFiles, areServedWithTheirHeadersAndNothingElseIs) {
  WebLab lab;
  Browser browser = lab.browser();
  const WebReply index = browser.get("/");
  EXPECT_EQ(index.status, 200);
  EXPECT_THAT(index.body, HasSubstr("needlelab"));
  EXPECT_EQ(index.header("content-type"), "text/html; charset=utf-8");
  EXPECT_THAT(index.header("content-security-policy"), HasSubstr("default-src 'self'"));
  EXPECT_EQ(index.header("x-content-type-options"), "nosniff");
  EXPECT_EQ(index.header("referrer-policy"), "no-referrer");
  EXPECT_EQ(index.header("strict-transport-security"), "") << "localhost serves other programs, too";
  WebWire lab_name(lab.port());
  (void)lab_name.send("GET / HTTP/1.1\r\nHost: needlelab.example:7751\r\n\r\n");
  EXPECT_EQ(lab_name.read().header("strict-transport-security"), "max-age=31536000");
  EXPECT_EQ(browser.ask("GET", "/", "", {{"If-None-Match", index.header("etag")}}).status, 304);
  const WebReply script = browser.get("/app/main.js?v=1");
  EXPECT_EQ(script.body, "export const one = 1;\n");
  const WebReply head = browser.ask("HEAD", "/app/main.js");
  EXPECT_EQ(head.header("content-length"), std::to_string(script.body.size()));
  EXPECT_EQ(browser.get("/app/main.js").body, script.body) << "nothing of HEAD's body came";
  EXPECT_EQ(browser.ask("POST", "/", "{}").status, 405);
  for (const char* path : {"/none.js", "/app", "/app/", "/api", "/api/v2/session", "/.git", "/index.html/x"})
    EXPECT_EQ(browser.get(path).status, 404) << path;
  for (const char* path :
       {"/../etc/passwd", "/app/../../x", "/%2e%2e/x", "/app%2f..%2fx", "//etc/passwd", "/%00"})
    EXPECT_EQ(browser.get(path).status, 400) << path;
}

TEST(WebErrors, areJsonAndNameTheAllowedMethods) {
  WebLab lab;
  Browser ada = lab.browserOf("ada");
  const WebReply wrong = askChecked(ada, "PUT", "/api/v1/people", "{}");
  EXPECT_EQ(wrong.status, 405);
  EXPECT_THAT(wrong.header("allow"), HasSubstr("POST"));
  EXPECT_EQ(askChecked(ada, "GET", "/api/v1/nothing").status, 404);
  EXPECT_EQ(askChecked(ada, "GET", "/api/v1/sessions/no-uuid").status, 404);
  const WebReply role =
      askChecked(ada, "POST", "/api/v1/people", R"({"name": "x", "role": "KING", "password": "p"})");
  EXPECT_EQ(role.status, 400);
  EXPECT_EQ(role.json()["error"]["field"], "role");
  EXPECT_EQ(askChecked(ada, "GET", "/api/v1/sessions?limit=0").json()["error"]["field"], "limit");
  EXPECT_EQ(askChecked(ada, "GET", "/api/v1/sessions?verdict=good").json()["error"]["field"], "verdict");
  EXPECT_EQ(askChecked(ada, "GET", "/api/v1/sessions?from_ms=yesterday").json()["error"]["field"], "from_ms");
  EXPECT_EQ(askChecked(ada, "GET", "/api/v1/sessions?to_ms=99999999999999").json()["error"]["field"],
            "to_ms");
  EXPECT_EQ(askChecked(ada, "GET", "/api/v1/people?page=***").status, 400);
  EXPECT_EQ(askChecked(ada, "POST", "/api/v1/people", "{", {}).status, 400);
  EXPECT_EQ(askChecked(ada, "GET", "/api/v1/profiles/none").status, 404);
  EXPECT_EQ(askChecked(ada, "POST", "/api/v1/people",
                       R"({"name": "tina", "role": "TRAINEE", "password": "correct horse"})")
                .status,
            409);
}

TEST(WebLimits, aHeaderAndABodyHaveTheirSizes) {
  WebLab lab;
  {
    WebWire wire(lab.port());
    (void)wire.send(requestText("GET", "/", "", {{"X-Long", std::string(9000, 'a')}}));
    EXPECT_EQ(wire.read().status, 431);
    EXPECT_TRUE(wire.ends());
  }
  // before log-in 4 KiB, with or without a declared length
  const std::string body = R"({"name": ")" + std::string(5000, 'a') + R"(", "password": "x"})";
  {
    WebWire wire(lab.port());
    (void)wire.send(requestText("POST", "/api/v1/session", body));
    EXPECT_EQ(wire.read().status, 413);
  }
  {
    WebWire wire(lab.port());
    (void)wire.send(requestText("POST", "/api/v1/session", "",
                                {{"Transfer-Encoding", "chunked"}, {"Content-Type", "application/json"}}));
    (void)wire.send("1400\r\n" + std::string(0x1400, ' ') + "\r\n0\r\n\r\n");
    EXPECT_EQ(wire.read().status, 413);
  }
  Browser ada = lab.browserOf("ada");
  EXPECT_EQ(ada.ask("POST", "/api/v1/profiles/check", json{{"description", std::string(900'000, 'a')}}.dump())
                .status,
            200);
  EXPECT_EQ(
      ada.ask("POST", "/api/v1/profiles/check", json{{"description", std::string(1'100'000, 'a')}}.dump())
          .status,
      413);
  // a log-in must be short even with a session
  EXPECT_EQ(ada.ask("POST", "/api/v1/session", body).status, 413);
  EXPECT_EQ(ada.get("/api/v1/session").status, 200) << "the server continues";
}

// The finding: bodies of plot requests, which are never read, used the budget of parsed messages while the
// plots were made.
TEST(WebLimits, anUnexpectedBodyIsRefusedAndALongOneUnread) {
  WebLab lab;
  const std::string plot = "/api/v1/sessions/" + lab.recorded(1) + "/samples?points=10";
  Browser ada = lab.browserOf("ada");
  EXPECT_EQ(askChecked(ada, "GET", plot).status, 200);
  const std::vector<std::pair<std::string, std::string>> without = {{"GET", plot},
                                                                    {"GET", "/api/v1/people"},
                                                                    {"GET", "/api/v1/session"},
                                                                    {"GET", "/api/v1/openapi.json"},
                                                                    {"DELETE", "/api/v1/groups/none"},
                                                                    {"POST", "/api/v1/check"}};
  for (const auto& [method, path] : without) {
    const WebReply refused = askChecked(ada, method, path, "[1]");
    EXPECT_EQ(refused.status, 400) << method << " " << path;
    EXPECT_EQ(refused.json()["error"]["message"], "this address takes no body") << method << " " << path;
    // only the header is sent: a server that read the body would wait for it
    WebWire wire(lab.port());
    WebHeaders headers = ada.own(method);
    headers.emplace_back("Content-Type", "application/json");
    headers.emplace_back("Content-Length", "4097");
    (void)wire.send(requestText(method, path, "", headers));
    EXPECT_EQ(wire.read().status, 413) << method << " " << path;
  }
  EXPECT_EQ(askChecked(ada, "POST", "/api/v1/check", "{}").status, 200) << "an empty object is not a body";
}

TEST(WebLimits, aParsedRequestReleasesTheRoomOfItsJson) {
  WebLab lab([](ServerOptions& options) { options.bounds.decoded.people = 30'000; });
  Browser mara = lab.browserOf("mara"), ada = lab.browserOf("ada");
  // the lines of their log-ins wait for the writer on the workers' threads
  const auto lines = [&lab] {
    auto reader = lab.server().server().store().readers().borrow();
    return (*reader)
        ->query("SELECT count(*) FROM audit WHERE action = 'log-in'")
        .first([](const Statement& row) { return row.integer(0); });
  };
  while (*lines() != std::optional<std::int64_t>(2)) std::this_thread::yield();
  const auto padded = [](const json& body) { return std::string(20'000, ' ') + body.dump(); };
  std::promise<void> go;
  DbWriter::Work wait = [held = go.get_future().share()](Connection&) {
    held.wait();
    return Status();
  };
  ASSERT_TRUE(lab.server().server().store().writer().post(std::move(wait), {}).ok());
  WebWire waits(lab.port());
  WebHeaders headers = mara.own("POST");
  (void)waits.send(requestText("POST", "/api/v1/groups",
                               padded({{"id", "autumn"}, {"name", "Autumn"}, {"members", json::array()}}),
                               headers));
  // no two bodies fit in the budget: if the request that waits for the writer kept its share, no other
  // would be answered
  for (int i = 0; i < 50; ++i)
    ASSERT_EQ(ada.ask("POST", "/api/v1/profiles/check", padded(json::object())).status, 200) << i;
  go.set_value();
  EXPECT_EQ(waits.read().status, 201);
}

TEST(WebLimits, whatIsNoHttpIsEnded) {
  WebLab lab;
  {
    WebWire wire(lab.port(), false);
    (void)wire.sendPlain("GET / HTTP/1.1\r\n\r\n");  // not TLS
    EXPECT_TRUE(wire.ends());
  }
  for (const char* text : {"NONSENSE\r\n\r\n", "GET\r\n\r\n", "GET / HTTP/9.9\r\n\r\n", "\x16\x03\x01",
                           "GET / HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
                           "POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n",
                           "GET / HTTP/1.1\r\n bad\r\n\r\n"}) {
    WebWire wire(lab.port());
    (void)wire.send(std::string(text) + "\r\n\r\n");
    const WebReply reply = wire.read();
    EXPECT_EQ(reply.status, 400) << text;
  }
  WebWire old(lab.port());
  (void)old.send("GET / HTTP/1.0\r\n\r\n");
  EXPECT_EQ(old.read().status, 505);
  WebWire nameless(lab.port());
  (void)nameless.send("GET / HTTP/1.1\r\n\r\n");
  EXPECT_EQ(nameless.read().status, 400);
  Browser browser = lab.browser();
  EXPECT_EQ(browser.get("/").status, 200);
}

TEST(WebLimits, aPeerMayChangeTlsKeysAFewTimes) {
  WebLab lab;
  WebWire wire(lab.port());
  for (std::uint64_t change = 0; change < kMaxKeyUpdates; ++change) {
    ASSERT_TRUE(wire.changeKeys());
    (void)wire.send(requestText("GET", "/"));
    ASSERT_EQ(wire.read().status, 200) << change;
  }
  (void)wire.changeKeys();
  (void)wire.send(requestText("GET", "/"));
  EXPECT_EQ(wire.read().status, 0);
  EXPECT_TRUE(wire.ends());
  // also on a WebSocket
  Browser ada = lab.browserOf("ada");
  const auto live = ada.live();
  ASSERT_NE(live, nullptr);
  for (std::uint64_t change = 0; change <= kMaxKeyUpdates; ++change) (void)live->changeKeys();
  (void)live->sendFrame(9, "");
  EXPECT_TRUE(live->ends());
  EXPECT_EQ(lab.browser().get("/").status, 200) << "the server continues";
}

TEST(WebLimits, anOversizedTlsHandshakeEnds) {
  WebLab lab;
  // the beginning of a ClientHello of 65,536 bytes, in records of one byte (6 bytes each)
  std::string hello;
  for (const char content : {1, 1, 0, 0}) hello += std::string("\x16\x03\x01\x00\x01", 5) + content;
  while (hello.size() <= kMaxHandshakeBytes + 6) hello += std::string("\x16\x03\x01\x00\x01\x00", 6);
  WebWire wire(lab.port(), false);
  ASSERT_TRUE(wire.sendPlain(hello));
  EXPECT_TRUE(wire.ends()) << "the handshake has an hour";
  EXPECT_EQ(lab.browser().get("/").status, 200) << "the server continues";
}

TEST(WebLimits, aBodyInAnotherCodingIsNotReadAsARequest) {
  WebLab lab;
  const std::string body = R"({"name": "ada", "password": "wrong"})";
  const std::string chunked = "24\r\n" + body + "\r\n0\r\n\r\n";
  ASSERT_EQ(body.size(), 0x24u);
  const auto ask = [&](WebWire& wire, const std::string& coding, const char* version = "1.1") {
    (void)wire.send("POST /api/v1/session HTTP/" + std::string(version) +
                    "\r\nHost: localhost\r\nContent-Type: application/json\r\n" + coding + "\r\n" + chunked +
                    "GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    return wire.read();
  };
  // the body is read as one, and so is the request after it
  for (const char* coding : {"Transfer-Encoding: chunked\r\n", "transfer-encoding: \t CHUNKED \r\n"}) {
    WebWire wire(lab.port());
    EXPECT_EQ(ask(wire, coding).status, 401) << coding;
    EXPECT_EQ(wire.read().status, 200) << coding;
  }
  for (const char* coding :
       {"Transfer-Encoding: xchunked\r\n", "Transfer-Encoding: chunked, gzip\r\n",
        "Transfer-Encoding: gzip, chunked\r\n", "Transfer-Encoding: chunked, chunked\r\n",
        "Transfer-Encoding: identity\r\n", "Transfer-Encoding:\r\n", "Transfer-Encoding: \"chunked\"\r\n",
        "Transfer-Encoding: chunked;q=1\r\n", "Transfer-Encoding: chunked,\r\n",
        "Transfer-Encoding: chun ked\r\n", "Transfer-Encoding: gzip\r\nTransfer-Encoding: chunked\r\n",
        "Transfer-Encoding: chunked\r\nTransfer-Encoding: gzip\r\n",
        "Transfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n",
        "Transfer-Encoding: chunked\r\nContent-Length: 5\r\n",
        "Content-Length: 5\r\nTransfer-Encoding: chunked\r\n",
        "Transfer-Encoding: xchunked\r\nContent-Length: 5\r\n",
        "Content-Length: 5\r\nTransfer-Encoding: xchunked\r\n", "Transfer-Encoding : chunked\r\n"}) {
    WebWire wire(lab.port());
    const WebReply refused = ask(wire, coding);
    EXPECT_EQ(refused.status, 400) << coding;
    EXPECT_EQ(refused.header("connection"), "close") << coding;
  }
  WebWire old(lab.port());
  EXPECT_EQ(ask(old, "Transfer-Encoding: chunked\r\n", "1.0").status, 400);
  WebWire unknown(lab.port());
  EXPECT_THAT(ask(unknown, "Transfer-Encoding: xchunked\r\n").json()["error"]["message"].get<std::string>(),
              HasSubstr("Transfer-Encoding"));
  EXPECT_EQ(unknown.read().status, 0) << "nothing behind it is answered";
}

TEST(WebLimits, whoDawdlesIsCut) {
  WebLab lab([](ServerOptions& options) {
    options.web.handshake_timeout = milliseconds(300);
    options.web.header_timeout = milliseconds(400);
    options.web.idle_timeout = milliseconds(500);
    options.web.body_timeout = milliseconds(400);
  });
  // in the middle of the handshake
  WebWire half(lab.port(), false);
  (void)half.sendPlain(std::string("\x16\x03\x01\x02\x00", 5));
  EXPECT_TRUE(half.ends());
  // A slow header: each byte is in time, but the whole header is not.
  WebWire dripping(lab.port());
  if (dripping.connected()) {
    const std::string text = requestText("GET", "/");
    for (std::size_t i = 0; i < text.size() && i < 30; ++i) {
      if (!dripping.send(text.substr(i, 1))) break;
      std::this_thread::sleep_for(milliseconds(50));
    }
    EXPECT_TRUE(dripping.ends());
  }
  // a body that does not arrive
  WebWire bodyless(lab.port());
  if (bodyless.connected()) {
    (void)bodyless.send(requestText("POST", "/api/v1/session", "",
                                    {{"Content-Length", "100"}, {"Content-Type", "application/json"}}));
    EXPECT_TRUE(bodyless.ends());
  }
  // nothing after the first request
  WebWire idle(lab.port());
  if (idle.connected()) {
    (void)idle.send(requestText("GET", "/"));
    (void)idle.read();
    EXPECT_TRUE(idle.ends());
  }
}

TEST(WebLimits, requestsBehindEachOtherAreAnsweredInOrderUntilTheirNumber) {
  WebLab lab([](ServerOptions& options) { options.web.requests_per_connection = 3; });
  WebWire wire(lab.port());
  (void)wire.send(requestText("GET", "/") + requestText("HEAD", "/app/main.js") +
                  requestText("GET", "/app/main.js") + requestText("GET", "/"));
  EXPECT_THAT(wire.read().body, HasSubstr("needlelab"));
  EXPECT_EQ(wire.read(true).status, 200);
  const WebReply third = wire.read();
  EXPECT_EQ(third.body, "export const one = 1;\n");
  EXPECT_EQ(third.header("connection"), "close");
  EXPECT_EQ(wire.read().status, 0) << "the fourth is not answered";
}

// A reverse proxy or a NAT: strangers and people share an address. Silent connections do not lock people out,
// neither those logged in nor new ones.
TEST(WebLimits, silentConnectionsOfAnAddressDoNotKeepItsPeopleOut) {
  WebLab lab([](ServerOptions& options) { options.web.handshake_timeout = std::chrono::hours(1); });
  Browser ines = lab.browserOf("ines");
  WebWire kept(lab.port());
  const auto ask = [&](WebWire& wire) {
    (void)wire.send(requestText("GET", "/api/v1/session", "", ines.own("GET")));
    return wire.read().status;
  };
  EXPECT_EQ(ask(kept), 200);
  std::vector<std::unique_ptr<WebWire>> silent;
  for (int i = 0; i < 300; ++i) silent.push_back(std::make_unique<WebWire>(lab.port(), false));
  EXPECT_EQ(ask(kept), 200) << "a connection that has shown its session is not a stranger";
  EXPECT_EQ(ines.get("/api/v1/session").status, 200) << "and a new one of the same person gets in";
  EXPECT_EQ(lab.browser().logIn("mara", kWebPassword).status, 200);
  EXPECT_TRUE(silent.front()->ends()) << "the oldest stranger gave way";
}

TEST(WebLimits, anExhaustedShareIsCountedAndLoggedOnce) {
  WebLab lab([](ServerOptions& options) {  // for two consents, including overhead
    options.shares.own_bytes = 2.0 * (200 + PeopleShares::kRequestBytes);
    options.metrics = "127.0.0.1:0";
  });
  testing::internal::CaptureStderr();
  setLogLevel(LogLevel::kWarning);
  Browser tina = lab.browserOf("tina");
  int stored = 0, refused = 0;
  for (int i = 0; i < 7; ++i) {
    const json body = {{"consent", i % 2 == 0}, {"note", std::string(100, 'x')}};
    const WebReply reply = askChecked(tina, "PATCH", "/api/v1/people/tina", body.dump());
    stored += reply.status == 200;
    if (reply.status != 503) continue;
    ++refused;
    EXPECT_EQ(reply.json()["error"]["code"], "no_room");
  }
  setLogLevel(LogLevel::kOff);
  const std::string log = testing::internal::GetCapturedStderr();
  EXPECT_EQ(stored, 2);
  EXPECT_EQ(refused, 5);
  const std::size_t line = log.find("no_room");
  ASSERT_NE(line, std::string::npos) << log;
  EXPECT_EQ(log.find("no_room", line + 1), std::string::npos) << log;
  EXPECT_THAT(log, testing::AllOf(HasSubstr("port=web"), HasSubstr("who=@1")));
  WebWire wire(lab.server().server().metricsPort(), false);
  (void)wire.sendPlain("GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(wire.receivePlain(), HasSubstr("needlelab_refused_for_room_total 5\n"));
}

TEST(WebLimits, strangersLogLinesAreBoundedAndCounted) {
  WebLab lab([](ServerOptions& options) { options.bounds.log_lines.a_minute = 5; });
  Browser tina = lab.browserOf("tina"), stranger = lab.browser();  // the log-in was a stranger's request, too
  const std::string log = logOf(LogLevel::kInfo, [&] {
    for (int i = 0; i < 12; ++i) EXPECT_EQ(stranger.get("/api/v1/people").status, 401);
    for (int i = 0; i < 7; ++i) EXPECT_EQ(tina.get("/api/v1/session").status, 200);
    lab.server().stop();
  });
  EXPECT_EQ(countOf(log, "status=401"), 4u) << log;
  EXPECT_EQ(countOf(log, leftOut("strangers", "web_request", 8)), 1u) << log;
  EXPECT_EQ(countOf(log, "who=@1 method=GET"), 7u) << log;
}

// The finding: each request of a trainee wrote a line, 1 MB per second.
TEST(WebLimits, aPersonsLogLinesAreBoundedApartFromRefusals) {
  constexpr std::size_t kLines = 2, kAnswered = 4;
  WebLab lab([](ServerOptions& options) {
    options.bounds.log_lines.a_minute = kLines;
    options.bounds.log_lines.answered_a_minute = kAnswered;
  });
  Browser tina = lab.browserOf("tina"), ines = lab.browserOf("ines");
  const std::string log = logOf(LogLevel::kInfo, [&] {
    for (int i = 0; i < 10; ++i) EXPECT_EQ(tina.get("/api/v1/session").status, 200);
    for (int i = 0; i < 5; ++i) EXPECT_EQ(tina.get("/api/v1/people").status, 403);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(tina.get("/api/v1/sessions/none").status, 404);
    EXPECT_EQ(ines.get("/api/v1/session").status, 200);
    lab.server().stop();
  });
  const auto requestsOf = [&](const std::string& who, const std::string& status) {
    std::size_t count = 0;
    std::istringstream lines(log);
    for (std::string line; std::getline(lines, line);)
      count += line.find("web_request ") != std::string::npos &&
               line.find(" who=" + who + " ") != std::string::npos &&
               line.find(" status=" + status + " ") != std::string::npos;
    return count;
  };
  EXPECT_EQ(requestsOf("@1", "200"), kAnswered) << log;
  EXPECT_EQ(requestsOf("@1", "403"), kLines) << log;
  EXPECT_EQ(requestsOf("@1", "404"), kLines) << log;
  EXPECT_EQ(requestsOf("@2", "200"), 1u) << log;
  EXPECT_EQ(countOf(log, leftOut("\"person @1\"", "web_request/done", 10 - kAnswered)), 1u) << log;
  EXPECT_EQ(countOf(log, leftOut("\"person @1\"", "web_request/403", 5 - kLines)), 1u) << log;
  EXPECT_EQ(countOf(log, leftOut("\"person @1\"", "web_request/4xx", 3 - kLines)), 1u) << log;
}

constexpr std::uint64_t kMiB = 1u << 20;

// a disk with this much room, which the server checks every 5 ms; it keeps 64 MiB free
auto aDiskWith(std::shared_ptr<std::atomic<std::uint64_t>> free_bytes) {
  return [free_bytes = std::move(free_bytes)](ServerOptions& options) {
    options.free_bytes = [free_bytes](const std::filesystem::path&) {
      return std::optional(free_bytes->load());
    };
    options.room_every = milliseconds(5);
    options.min_free_bytes = 64 * kMiB;
  };
}

TEST(WebLogIn, tellsAdministratorsTheRoomOnTheDisk) {
  const auto free_bytes = std::make_shared<std::atomic<std::uint64_t>>(10'000 * kMiB);
  WebLab lab(aDiskWith(free_bytes));
  Browser ada = lab.browserOf("ada"), mara = lab.browserOf("mara");
  // the server checks only from time to time
  const auto levelBecomes = [&](const std::string& wanted) {
    json room;
    for (int i = 0; i < 2000; ++i) {
      room = askChecked(ada, "GET", "/api/v1/session").json()["disk_room"];
      if (room["level"] == wanted) return room["left_bytes"].get<std::uint64_t>();
    }
    ADD_FAILURE() << room.dump();
    return std::uint64_t{0};
  };
  EXPECT_GE(levelBecomes("plenty"), 10'000 * kMiB);
  *free_bytes = 200 * kMiB;  // less than four times the minimum
  EXPECT_GE(levelBecomes("no_new_sessions"), 100 * kMiB);
  *free_bytes = 20 * kMiB;
  EXPECT_LT(levelBecomes("no_chunks"), 64 * kMiB);
  EXPECT_FALSE(askChecked(mara, "GET", "/api/v1/session").json().contains("disk_room"));
}

TEST(WebLogIn, tellsAdministratorsWhatAnAckSurvives) {
  WebLab lab;
  Browser ada = lab.browserOf("ada"), mara = lab.browserOf("mara");
  const json store = askChecked(ada, "GET", "/api/v1/session").json()["store"];
  // the tests' cluster guarantees nothing
  EXPECT_EQ(store["ack_survives"], onPostgres() ? "nothing" : "a power cut") << store.dump();
  EXPECT_FALSE(store.contains("refused")) << store.dump();
  EXPECT_FALSE(store.contains("waits_s")) << store.dump();
  EXPECT_FALSE(askChecked(mara, "GET", "/api/v1/session").json().contains("store"));
}

TEST(WebStore, tellsAdministratorsWhatIsMissingAndUnstored) {
  WebLab lab([](ServerOptions& options) { options.writer.lack_at_start = "transaction 7 is unknown here"; });
  Browser ada = lab.browserOf("ada");
  const auto store = [&] { return askChecked(ada, "GET", "/api/v1/session").json()["store"]; };
  EXPECT_EQ(store()["lack"], "transaction 7 is unknown here");
  EXPECT_FALSE(store().contains("refused")) << store().dump();
  DbWriter& writer = lab.server().server().store().writer();
  const Status failed =
      writer.run([](Connection& connection) { return connection.run("INSERT INTO nowhere VALUES (1)"); });
  ASSERT_FALSE(failed.ok());
  EXPECT_EQ(store()["refused"], failed.error().message) << "others are stored meanwhile";
}

// The finding: remarks through this port used no daily share and no room, so one instructor filled the disk
// until the server ended.
TEST(WebLimits, aRemarkUsesItsAuthorsShareAndNeedsDiskRoom) {
  const auto free_bytes = std::make_shared<std::atomic<std::uint64_t>>(10'000 * kMiB);
  WebLab lab(aDiskWith(free_bytes));
  const std::string id = lab.recorded(1);
  Browser ada = lab.browserOf("ada"), ines = lab.browserOf("ines");
  const auto annotate = [&] {
    return askChecked(ines, "POST", "/api/v1/sessions/" + id + "/annotations",
                      R"({"t_s": 0.25, "text": "slow down"})");
  };
  EXPECT_EQ(annotate().status, 201);
  *free_bytes = 20 * kMiB;
  while (askChecked(ada, "GET", "/api/v1/session").json()["disk_room"]["level"] != "no_chunks") continue;
  const WebReply refused = annotate();
  EXPECT_EQ(refused.status, 503) << refused.body;
  EXPECT_EQ(refused.json()["error"]["code"], "no_room");
  EXPECT_EQ(askChecked(ines, "GET", "/api/v1/sessions/" + id + "/annotations").json()["items"].size(), 1u);
}

// The finding: remarks on missing sessions counted as used room, so one instructor prevented lessons from
// beginning.
TEST(WebLimits, onlyAStoredRemarkTakesDiskRoom) {
  WebLab lab([](ServerOptions& options) { options.room_every = std::chrono::hours(1); });
  const std::string id = lab.recorded(1);
  Browser ada = lab.browserOf("ada"), ines = lab.browserOf("ines");
  const auto left = [&] {
    return askChecked(ada, "GET", "/api/v1/session").json()["disk_room"]["left_bytes"].get<std::uint64_t>();
  };
  const std::string body = json{{"t_s", 0.25}, {"text", std::string(3'000, 'x')}}.dump();
  const auto annotate = [&](const std::string& session) {
    return askChecked(ines, "POST", "/api/v1/sessions/" + session + "/annotations", body).status;
  };
  const std::uint64_t before = left();
  for (int n = 0; n < 3; ++n) EXPECT_EQ(annotate("01890a5d-ac96-7b3c-8000-000000000000"), 404u);
  EXPECT_EQ(left(), before);
  EXPECT_EQ(annotate(id), 201u);
  EXPECT_EQ(left(), before - 2 * (body.size() + PeopleShares::kRequestBytes));
}

TEST(WebProxy, aTrustedOneIsNoStrangerAndNamesTheClient) {
  const auto guess = [](WebLab& lab, const char* from) {
    WebWire wire(lab.port());
    (void)wire.send(requestText("POST", "/api/v1/session",
                                json{{"name", "nobody" + std::string(from)}, {"password", "wrong"}}.dump(),
                                {{"X-Forwarded-For", from}}));
    return wire.read().status;
  };
  WebLab lab([](ServerOptions& options) {
    options.web.proxies = {"127.0.0.1"};
    options.web.admission.strangers_of_address = 1;
    options.guard.allowed_per_address = 2;
    options.guard.refill_address = std::chrono::hours(1);
  });
  std::vector<std::unique_ptr<WebWire>> open;
  for (int i = 0; i < 5; ++i) open.push_back(std::make_unique<WebWire>(lab.port()));
  for (const auto& wire : open) EXPECT_TRUE(wire->connected());
  for (const auto& wire : open) {
    (void)wire->send(requestText("GET", "/"));
    EXPECT_EQ(wire->read().status, 200) << "none of them gave way";
  }
  // guesses count for the client's address
  EXPECT_EQ(guess(lab, "203.0.113.5"), 401);
  EXPECT_EQ(guess(lab, "203.0.113.5"), 401);
  EXPECT_EQ(guess(lab, "203.0.113.5"), 429);
  EXPECT_EQ(guess(lab, "203.0.113.6"), 401);

  // an untrusted client cannot choose the address it is counted under
  WebLab plain([](ServerOptions& options) {
    options.guard.allowed_per_address = 2;
    options.guard.refill_address = std::chrono::hours(1);
  });
  EXPECT_EQ(guess(plain, "203.0.113.5"), 401);
  EXPECT_EQ(guess(plain, "203.0.113.6"), 401);
  EXPECT_EQ(guess(plain, "203.0.113.7"), 429);
}

TEST(WebLimits, onePersonsConnectionsGiveWayAmongThemselves) {
  WebLab lab([](ServerOptions& options) { options.web.admission.connections_of_account = 3; });
  Browser ines = lab.browserOf("ines"), mara = lab.browserOf("mara");
  std::vector<std::unique_ptr<WebWire>> open;
  const auto ask = [&](Browser& who, WebWire& wire) {
    (void)wire.send(requestText("GET", "/api/v1/session", "", who.own("GET")));
    return wire.read().status;
  };
  WebWire of_mara(lab.port());
  EXPECT_EQ(ask(mara, of_mara), 200);
  for (int i = 0; i < 3; ++i) open.push_back(std::make_unique<WebWire>(lab.port()));
  for (const auto& wire : open) EXPECT_EQ(ask(ines, *wire), 200);
  EXPECT_EQ(ask(ines, *open[0]), 200);  // now the second one has been idle longest
  WebWire fourth(lab.port());
  EXPECT_EQ(ask(ines, fourth), 200);
  EXPECT_TRUE(open[1]->ends());
  EXPECT_EQ(ask(ines, *open[0]), 200);
  EXPECT_EQ(ask(ines, *open[2]), 200);
  EXPECT_EQ(ask(mara, of_mara), 200);
}

TEST(WebLimits, whoHasTheMostConnectionsGivesWayToPeopleWhoHaveFewer) {
  WebLab lab([](ServerOptions& options) {  // four places for people
    options.web.admission.max_connections = 8;
    options.web.admission.newcomers_one_in = 2;
  });
  const auto logIn = [](WebWire& wire, const char* name) {
    (void)wire.send(
        requestText("POST", "/api/v1/session", json{{"name", name}, {"password", kWebPassword}}.dump()));
    return wire.read();
  };
  WebWire first(lab.port()), second(lab.port()), third(lab.port());
  const std::string cookie = logIn(first, "ines").header("set-cookie");
  for (WebWire* wire : {&second, &third}) EXPECT_EQ(logIn(*wire, "ines").status, 200);
  (void)first.send(
      requestText("GET", "/api/v1/session", "", {{"Cookie", cookie.substr(0, cookie.find(';'))}}));
  EXPECT_EQ(first.read().status, 200);  // now the second one has been idle longest
  WebWire of_mara(lab.port()), of_tina(lab.port()), of_ada(lab.port()), of_rhea(lab.port());
  EXPECT_EQ(logIn(of_mara, "mara").status, 200);
  EXPECT_EQ(logIn(of_tina, "tina").status, 200);
  EXPECT_TRUE(second.ends());
  EXPECT_EQ(logIn(of_ada, "ada").status, 200);
  EXPECT_TRUE(third.ends());
  const WebReply refused = logIn(of_rhea, "rhea");
  EXPECT_EQ(refused.status, 503) << "everybody has one";
  EXPECT_EQ(refused.json()["error"]["code"], "unavailable");
  EXPECT_TRUE(of_rhea.ends());
  for (WebWire* wire : {&first, &of_mara, &of_tina, &of_ada}) {
    (void)wire->send(requestText("GET", "/"));
    EXPECT_EQ(wire->read().status, 200);
  }
}

TEST(WebLimits, onePersonsRepliesAreBoundedOverAllConnectionsAndArrive) {
  constexpr std::size_t kLongest = 1u << 20;  // the memory of a reply while it is made
  WebLab lab([](ServerOptions& options) { options.bounds.replies.person = 2 * kLongest; });
  Browser ines = lab.browserOf("ines"), mara = lab.browserOf("mara");
  std::vector<std::unique_ptr<WebWire>> open;
  for (int i = 0; i < 12; ++i) {
    open.push_back(std::make_unique<WebWire>(lab.port()));
    (void)open.back()->send(requestText("GET", "/api/v1/people", "", ines.own("GET")));
  }
  EXPECT_EQ(mara.get("/api/v1/people").status, 200);
  for (const auto& wire : open) EXPECT_EQ(wire->read().status, 200);
  EXPECT_EQ(lab.server().stop(), 0);
  EXPECT_GE(lab.server().counters().max_reply_bytes, kLongest);
  EXPECT_LE(lab.server().counters().max_reply_bytes, 3 * kLongest) << "two of one person and one of another";
}

TEST(WebLimits, unreadDownloadsAreBoundedInBytesAndOthersComplete) {
  constexpr std::size_t kOfOne = 3u << 20, kOfPeople = 6u << 20;
  WebLab lab([](ServerOptions& options) {
    options.bounds.replies.person = kOfOne;
    options.bounds.replies.people = kOfPeople;
  });
  constexpr std::uint64_t kChunks = 1500;  // 100 samples each; 13 MB of CSV, more than the sockets hold
  const std::string path = "/api/v1/sessions/" + lab.recorded(kChunks) + "/samples.csv";
  const auto linesOf = [&](Browser& who) {
    const WebReply reply = who.get(path);
    EXPECT_EQ(reply.status, 200);
    return static_cast<std::uint64_t>(std::count(reply.body.begin(), reply.body.end(), '\n'));
  };
  Browser ines = lab.browserOf("ines"), mara = lab.browserOf("mara");
  std::vector<std::unique_ptr<WebWire>> unread;
  for (int i = 0; i < 10; ++i) {
    unread.push_back(std::make_unique<WebWire>(lab.port()));
    unread.back()->keepLittle();
    (void)unread.back()->send(requestText("GET", path, "", ines.own("GET")));
  }
  EXPECT_EQ(linesOf(mara), kChunks * 100 + 1) << "beside them";
  unread.clear();
  EXPECT_EQ(linesOf(ines), kChunks * 100 + 1) << "their room came back";
  EXPECT_EQ(lab.server().stop(), 0);
  EXPECT_GE(lab.server().counters().max_reply_bytes, kOfOne);
  EXPECT_LE(lab.server().counters().max_reply_bytes, kOfPeople);
}

TEST(WebLimits, strangersGiveWayAndTheOtherPortGoesOn) {
  WebLab lab([](ServerOptions& options) { options.web.admission.max_strangers = 3; });
  std::vector<std::unique_ptr<WebWire>> open;
  for (int i = 0; i < 8; ++i) open.push_back(std::make_unique<WebWire>(lab.port()));
  // The server closed the oldest connections in favour of the newest.
  EXPECT_TRUE(open.front()->ends());
  EXPECT_TRUE(open.back()->send(requestText("GET", "/")));
  EXPECT_EQ(open.back()->read().status, 200);
  pb::Login login;
  login.mutable_person()->set_user("ines");
  login.mutable_person()->set_password(kWebPassword);
  EXPECT_TRUE(lab.server().connect(login).ok());
}

TEST(WebServer, endsWithTheServerAfterItsCurrentWork) {
  WebLab lab;
  Browser ines = lab.browserOf("ines");
  WebWire idle(lab.port());
  ASSERT_TRUE(idle.connected());
  EXPECT_EQ(lab.server().stop(), 0);
  EXPECT_TRUE(idle.ends());
}

}  // namespace
}  // namespace needlelab
