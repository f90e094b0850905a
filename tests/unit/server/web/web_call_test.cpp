#include "server/web/web_call.h"

#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "common/base/text/uuid.h"
#include "common/base/time/clock.h"
#include "common/profile/profile.h"
#include "needlelab/control.pb.h"
#include "server/base/http_message.h"
#include "server/web/web_server.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/fake_time.h"

namespace needlelab {
namespace {

using test::TempFolder;

TEST(WebCall, aTargetIsSplitAndDecoded) {
  const auto target = parseTarget("/api/v1/people/anna%20b%C3%BC?page=x%3D1&who=a+b&empty=");
  ASSERT_TRUE(target.ok());
  EXPECT_EQ(target->segments, (std::vector<std::string>{"api", "v1", "people", "anna b\u00fc"}));
  EXPECT_EQ(target->query.at("page"), "x=1");
  EXPECT_EQ(target->query.at("who"), "a b");
  EXPECT_EQ(target->query.at("empty"), "");
  EXPECT_EQ(target->path(), "/api/v1/people/anna b\u00fc");
  EXPECT_EQ(parseTarget("/")->path(), "/");
  // a final slash belongs to the last part
  EXPECT_EQ(parseTarget("/app/")->segments.size(), 1u);
}

TEST(WebHost, onlyANameOfTheLabMayDemandHttps) {
  for (const char* host : {"needlelab.example", "needlelab.example:7751", "lab", "lab.local:7751",
                           "LAB.example.", "localhost.example", "10.example"})
    EXPECT_TRUE(mayDemandHttps(host)) << host;
  for (const char* host :
       {"", "localhost", "LocalHost:7751", "localhost.", "console.localhost:7751", "localhost.localdomain",
        "127.0.0.1", "127.0.0.1:7751", "192.0.2.7", "[::1]", "[::1]:7751"})
    EXPECT_FALSE(mayDemandHttps(host)) << host;
}

TEST(WebCall, aTargetNamesNoOneInTheLog) {
  EXPECT_EQ(pathForLog("/api/v1/people/anna%20b?x=y", "GET /people/{name}"), "/api/v1/people/*");
  EXPECT_EQ(pathForLog("/api/v1/people/anna/export", "GET /people/{name}/export"), "/api/v1/people/*/export");
  EXPECT_EQ(pathForLog("/api/v1/sessions/019aa0c3/score", "GET /sessions/{id}/score"),
            "/api/v1/sessions/019aa0c3/score")
      << "an id is what one looks for";
  EXPECT_EQ(pathForLog("/api/v1/audit?who=anna", "GET /audit"), "/api/v1/audit");
  EXPECT_EQ(pathForLog("/app/main.js?anna", "file"), "/app/main.js");
  // not an address of this server: it may contain anything
  EXPECT_EQ(pathForLog("/api/v1/persons/anna", ""), "*");
  EXPECT_EQ(pathForLog("/my password", ""), "*");
  EXPECT_EQ(pathForLog("/api/v9/people/anna", "GET /people/{name}"), "*");
}

TEST(WebCall, everythingDoubtfulInATargetIsRefused) {
  const std::string long_one = "/" + std::string(2048, 'a');
  std::string many = "/?";
  for (int i = 0; i < 33; ++i) many += "a" + std::to_string(i) + "=&";
  for (const std::string& text : {std::string(),
                                  std::string("a"),
                                  std::string("*"),
                                  std::string("https://elsewhere/"),
                                  std::string("//x"),
                                  std::string("/a//b"),
                                  std::string("/../x"),
                                  std::string("/a/./b"),
                                  std::string("/%2e%2e/x"),
                                  std::string("/a%2fb"),
                                  std::string("/%00"),
                                  std::string("/%0a"),
                                  std::string("/%7f"),
                                  std::string("/%"),
                                  std::string("/%4"),
                                  std::string("/%zz"),
                                  std::string("/%ff"),
                                  std::string("/%c0%af"),
                                  std::string("/a?x=1&x=2"),
                                  std::string("/a?x=%0d"),
                                  many,
                                  long_one}) {
    EXPECT_FALSE(parseTarget(text).ok()) << text.substr(0, 60);
  }
}

TEST(Cookies, theCookieIsFoundUnlessItOccursTwice) {
  EXPECT_EQ(cookieNamed("a=1; __Host-needlelab=xyz; b=2", "__Host-needlelab"), "xyz");
  EXPECT_EQ(cookieNamed("__Host-needlelab=x=y", "__Host-needlelab"), "x=y");
  EXPECT_FALSE(cookieNamed("x__Host-needlelab=1", "__Host-needlelab").has_value());
  EXPECT_FALSE(cookieNamed("", "__Host-needlelab").has_value());
  EXPECT_FALSE(cookieNamed(";;;=;", "__Host-needlelab").has_value());
  // An attacker who can set a second one must not be able to choose the valid one.
  EXPECT_FALSE(cookieNamed("__Host-needlelab=a; __Host-needlelab=b", "__Host-needlelab").has_value());
}

TEST(IfMatch, isARevisionInQuotes) {
  EXPECT_EQ(*parseIfMatch("\"7\""), 7u);
  EXPECT_EQ(*parseIfMatch(" W/\"12\" "), 12u);
  for (const char* text : {"", "7", "\"\"", "\"-1\"", "\"7x\"", "\"4294967296\"", "*", "\"1\", \"2\""})
    EXPECT_FALSE(parseIfMatch(text).ok()) << text;
}

TEST(Origin, onlyThisServerOverTls) {
  EXPECT_TRUE(isSameOrigin("https://lab:7751", "lab:7751"));
  EXPECT_TRUE(isSameOrigin("https://LAB:7751", "lab:7751"));
  EXPECT_TRUE(isSameOrigin("https://lab", "lab:443")) << "443 is https without a port";
  EXPECT_TRUE(isSameOrigin("https://lab:443", "lab"));
  for (const char* origin : {"http://lab:7751", "https://lab", "https://lab:7751.evil",
                             "https://evil/lab:7751", "null", "", "https://", "https://lab:7751/"})
    EXPECT_FALSE(isSameOrigin(origin, "lab:7751")) << origin;
  EXPECT_FALSE(isSameOrigin("https://", ""));
}

TEST(Base64Url, decodesOnlyItsOwnEncoding) {
  std::mt19937 random(7);
  for (std::size_t size = 0; size < 70; ++size) {
    std::string bytes(size, '\0');
    for (char& c : bytes) c = static_cast<char>(random());
    const std::string text = base64Url(bytes);
    EXPECT_EQ(text.find_first_of("+/="), std::string::npos);
    EXPECT_EQ(bytesOfBase64Url(text), bytes);
  }
  EXPECT_EQ(base64Url("\xfb\xff"), "-_8");
  // An extra digit, unused bits, other letters: two texts never mean the same bytes.
  for (const char* text : {"A", "-_9", "AAAAA", "AA=", "A+", "A A"})
    EXPECT_FALSE(bytesOfBase64Url(text)) << text;
}

TEST(Numbers, ofAQueryAreWithinTheirRange) {
  EXPECT_EQ(*wholeOf("n", "12", 1, 100), 12u);
  EXPECT_DOUBLE_EQ(*numberOf("s", "1.5e1", 0, 100), 15);
  for (const char* text : {"", "0", "101", "-1", "1.5", "1 ", "x", "99999999999999999999"})
    EXPECT_FALSE(wholeOf("n", text, 1, 100).ok()) << text;
  for (const char* text : {"", "nan", "inf", "-1", "101", "1x", "0x10"})
    EXPECT_FALSE(numberOf("s", text, 0, 100).ok()) << text;
  EXPECT_NE(wholeOf("limit", "0", 1, 9).error().message.find("limit"), std::string::npos);
}

TEST(Faults, nameTheirField) {
  EXPECT_EQ(fieldOfMessage("layers[2].cut_force_n: 75 is out of range"), "layers[2].cut_force_n");
  EXPECT_EQ(fieldOfMessage("profile: layers[0].tissue: is missing"), "layers[0].tissue");
  EXPECT_EQ(fieldOfMessage("there is no session x"), "");
  EXPECT_EQ(fieldOfMessage("Something: else"), "");
  EXPECT_EQ(fieldOfMessage(""), "");
}

TEST(ReplyJson, timesIdsAndInnerTextsAreAsABrowserReadsThem) {
  pb::SessionInfo session;
  auto& d = *session.mutable_description();
  const Uuid id = makeUuidV7();
  d.set_session_id(std::string(id.begin(), id.end()));
  d.set_started_unix_ns(1'700'000'000'123'456'789);
  d.set_profile_json(R"({"id": "knee"})");
  session.set_hash("\x01\xff");
  session.set_score_json("not json");
  const WebJson shown = jsonOf(session);
  EXPECT_EQ(shown["description"]["session_id"], uuidText(id));
  EXPECT_NEAR(shown["description"]["started_unix_ms"].get<double>(), 1'700'000'000'123.4568, 1e-3);
  EXPECT_EQ(shown["description"]["profile"]["id"], "knee");
  EXPECT_EQ(shown["hash"], "01ff");
  EXPECT_TRUE(shown["closed_unix_ms"].is_null());
  EXPECT_EQ(shown["score"], "not json");
  EXPECT_FALSE(shown.contains("removed_original"));
  // no ns anywhere: JavaScript would round them
  EXPECT_EQ(shown.dump().find("_unix_ns"), std::string::npos);

  pb::AuditEntry entry;
  entry.set_unix_ns(5'000'000);
  EXPECT_EQ(jsonOf(entry)["unix_ms"], 5.0);
}

TEST(ReplyJson, whatABrowserSendsIsReadStrictly) {
  pb::Annotate annotate;
  EXPECT_TRUE(messageOf({{"tick", 12}, {"text", "slow down"}}, annotate).ok());
  EXPECT_EQ(annotate.tick(), 12u);
  for (const nlohmann::json& body :
       {nlohmann::json{{"tick", -1}}, nlohmann::json{{"tick", 1.5}}, nlohmann::json{{"text", 3}},
        nlohmann::json{{"other", 1}}, nlohmann::json(), nlohmann::json::array(),
        nlohmann::json{{"session_id", "x"}}}) {
    pb::Annotate other;
    EXPECT_FALSE(messageOf(body, other).ok()) << body.dump();
  }
  EXPECT_FALSE(sessionBytesOf("no-uuid").ok());
  EXPECT_EQ(sessionBytesOf("no-uuid").error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(pageOf("***").ok());
}

TEST(StaticFiles, onlyThoseOfTheFolderThatAreOfAPage) {
  TempFolder folder;
  const auto web = folder.path() / "web";
  std::filesystem::create_directories(web / "app" / ".hidden");
  for (const char* name :
       {"index.html", "app/main.js", "app/.secret.js", "app/.hidden/x.js", "_draft.html", "notes.md"})
    std::ofstream(web / name) << name;
  std::ofstream(folder.path() / "outside.js") << "secret";
  std::filesystem::create_symlink(folder.path() / "outside.js", web / "link.js");
  const auto files = StaticFiles::load(web);
  ASSERT_TRUE(files.ok());
  EXPECT_EQ(files->size(), 2u);
  ASSERT_NE(files->find("/"), nullptr);
  EXPECT_EQ(*files->find("/")->body, "index.html");
  EXPECT_EQ(files->find("/app/main.js")->type, "text/javascript; charset=utf-8");
  EXPECT_NE(files->find("/app/main.js")->etag, files->find("/index.html")->etag);
  for (const char* path : {"/outside.js", "/link.js", "/../outside.js", "/app", "/app/.secret.js",
                           "/notes.md", "index.html", ""})
    EXPECT_EQ(files->find(path), nullptr) << path;
  EXPECT_EQ(StaticFiles::load(folder.path() / "none")->size(), 0u);
}

std::optional<WebSession> found(const WebSessions& sessions, const std::string& cookie) {
  asio::io_context io{1};
  Result<std::optional<WebSession>> result = Error{ErrorCode::kFailed, "did not end"};
  const auto find = [&]() -> Task<> {
    auto got = co_await sessions.find(cookie, "here");
    result = std::move(got);
  };
  asio::co_spawn(io, find(), rethrow);
  io.run();
  return result.ok() ? *result : std::nullopt;
}

TEST(WebSessions, aTokenAgainstForgedRequestsIsOfItsSessionOnly) {
  test::FakeTime time(0);
  LoginsInMemory logins({}, LoginGuard(), Tokens({.lifetime = std::chrono::milliseconds(1000)}), time);
  Tokens& tokens = logins.tokens;
  const WebSessions sessions(logins), other_server(logins);
  const auto anna = tokens.issue({{"anna", pb::INSTRUCTOR}, 0}, 0),
             bert = tokens.issue({{"bert", pb::INSTRUCTOR}, 0}, 0);
  const std::string csrf = sessions.csrfOf(anna.token);
  EXPECT_TRUE(sessions.csrfFits(anna.token, csrf));
  EXPECT_FALSE(sessions.csrfFits(bert.token, csrf));
  EXPECT_FALSE(sessions.csrfFits(anna.token, ""));
  EXPECT_FALSE(sessions.csrfFits(anna.token, csrf.substr(1)));
  EXPECT_FALSE(other_server.csrfFits(anna.token, csrf));

  const std::string cookie = WebSessions::cookieFor(anna.token);
  for (const char* part : {"Secure", "HttpOnly", "SameSite=Strict", "Path=/"})
    EXPECT_NE(cookie.find(part), std::string::npos) << part;
  EXPECT_EQ(cookie.find("Domain"), std::string::npos);
  const std::string sent = cookie.substr(0, cookie.find(';'));
  time.advanceTo(999'000'000);
  ASSERT_TRUE(found(sessions, sent).has_value());
  EXPECT_EQ(found(sessions, sent)->holder.who.name, "anna");
  EXPECT_TRUE(sessions.mayBeSession(sent));
  time.advanceTo(1'000'000'000);
  EXPECT_FALSE(found(sessions, sent).has_value());
  EXPECT_FALSE(sessions.mayBeSession(sent));
}

TEST(Tokens, lastLongerByUseAndEndOnLogOut) {
  Tokens tokens({.lifetime = std::chrono::milliseconds(1000),
                 .max_tokens = 10,
                 .longest = std::chrono::milliseconds(2500)});
  const auto issued = tokens.issue({{"anna", pb::INSTRUCTOR}, 0}, 0);
  EXPECT_EQ(tokens.renew(issued.token, 900'000'000), 1'900'000'000);
  EXPECT_EQ(tokens.renew(issued.token, 1'800'000'000),
            2'500'000'000);  // maximum time after the password
  EXPECT_EQ(tokens.endOf(issued.token, 2'400'000'000), 2'500'000'000);
  EXPECT_FALSE(tokens.renew(issued.token, 2'500'000'000).has_value());
  const auto next = tokens.issue({{"anna", pb::INSTRUCTOR}, 0}, 0);
  EXPECT_TRUE(tokens.end(next.token));
  EXPECT_FALSE(tokens.end(next.token));
  EXPECT_FALSE(tokens.endOf(next.token, 1).has_value());
}

TEST(Tokens, repeatedLogInsCostNoOneElseAToken) {
  Tokens tokens;
  const auto bert = tokens.issue({{"bert", pb::INSTRUCTOR}, 0}, 0);
  for (std::size_t i = 0; i < TokenLimits{}.max_of_person + 100; ++i)
    (void)tokens.issue({{"anna", pb::INSTRUCTOR}, 0}, static_cast<std::int64_t>(i));
  EXPECT_EQ(tokens.size(), TokenLimits{}.max_of_person + 1);
  EXPECT_TRUE(tokens.endOf(bert.token, 1).has_value());
}

TEST(ProfileFaults, allOfThemWithTheirPaths) {
  const auto faults = profileFaults(R"({"id": "x", "layers": [{"tissue": "SKIN", "thickness_m": 2},
      {"tissue": "ROCK", "thickness_m": 0.01, "colour": 3}]})");
  std::vector<std::string> paths;
  for (const Error& fault : faults) paths.push_back(fieldOfMessage(fault.message));
  for (const char* path :
       {"layers[0].thickness_m", "layers[1].tissue", "layers[1]", "name", "needle", "limb", "tracking_wall"})
    EXPECT_EQ(std::count(paths.begin(), paths.end(), path), 1) << path;
  EXPECT_EQ(profileFaults("{").size(), 1u);
}

}  // namespace
}  // namespace needlelab
