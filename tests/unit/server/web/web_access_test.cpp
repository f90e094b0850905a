// Access over HTTPS: log-in, sessions, forged requests, roles.
#include <algorithm>
#include <set>
#include <sstream>

#include "tests/support/patience.h"
#include "tests/unit/server/web/web_lab.h"

namespace needlelab {
namespace {

using namespace test;
using nlohmann::json;
using testing::HasSubstr;

TEST(WebLogIn, givesACookieThatOnlyThisServerReads) {
  WebLab lab;
  Browser browser = lab.browser();
  const WebReply reply = fits("POST", "/api/v1/session", browser.logIn("ines", kWebPassword));
  ASSERT_EQ(reply.status, 200) << reply.body;
  EXPECT_EQ(reply.json()["name"], "ines");
  EXPECT_EQ(reply.json()["role"], "INSTRUCTOR");
  const std::string cookie = reply.header("set-cookie");
  for (const char* part : {"__Host-needlelab=", "Secure", "HttpOnly", "SameSite=Strict", "Path=/"})
    EXPECT_THAT(cookie, HasSubstr(part));
  EXPECT_EQ(reply.header("cache-control"), "no-store");

  const WebReply me = askChecked(browser, "GET", "/api/v1/session");
  EXPECT_EQ(me.json()["csrf_token"], reply.json()["csrf_token"]);
  EXPECT_NEAR(me.json()["expires_unix_ms"].get<double>(), static_cast<double>(wallNowNs()) / 1e6 + 15 * 60e3,
              60e3);

  EXPECT_EQ(askChecked(browser, "DELETE", "/api/v1/session").status, 200);
  EXPECT_EQ(askChecked(browser, "GET", "/api/v1/session").status, 401);
  EXPECT_EQ(askChecked(browser, "GET", "/api/v1/people").status, 401);
}

TEST(WebLogIn, sharesLockOutsAndAuditWithTheOtherPort) {
  WebLab lab([](ServerOptions& options) { options.guard.allowed_per_name = 2; });
  Browser browser = lab.browser();
  EXPECT_EQ(fits("POST", "/api/v1/session", browser.logIn("ines", "wrong")).status, 401);
  const WebReply unknown = browser.logIn("nobody", "wrong");
  EXPECT_EQ(unknown.status, 401);
  EXPECT_EQ(browser.logIn("ines", "wrong").body, unknown.body) << "unknown and wrong must look the same";
  // After the second failure even the right password must wait, on both ports.
  const WebReply locked = fits("POST", "/api/v1/session", browser.logIn("ines", kWebPassword));
  EXPECT_EQ(locked.status, 429);
  EXPECT_GE(std::stoi("0" + locked.header("retry-after")), 1);
  pb::Login login;
  login.mutable_person()->set_user("ines");
  login.mutable_person()->set_password(kWebPassword);
  const auto wire = lab.server().connect(login);
  ASSERT_FALSE(wire.ok());
  EXPECT_THAT(wire.error().message, HasSubstr("RATE_LIMITED"));
  // another thread writes the line
  EXPECT_TRUE(eventually([&] {
    pb::Request request;
    request.mutable_list_audit();
    const pb::Reply reply = lab.server().asAdmin(request);
    const auto& entries = reply.audit().entries();
    return std::any_of(entries.begin(), entries.end(),
                       [](const auto& entry) { return entry.action() == "log-in locked"; });
  }));
}

TEST(WebLogIn, whatIsNoLogInIsRefused) {
  WebLab lab;
  Browser browser = lab.browser();
  const std::string good = json{{"name", "ines"}, {"password", kWebPassword}}.dump();
  for (const char* body : {"", "{", "[]", "{}", R"({"name": "ines"})", R"({"name": 1, "password": "x"})",
                           R"({"name": "ines", "name": "ada", "password": "x"})"}) {
    const WebReply reply =
        askChecked(browser, "POST", "/api/v1/session", body, {{"Content-Type", "application/json"}});
    EXPECT_EQ(reply.status, 400) << body;
  }
  // a form on another page could send these
  EXPECT_EQ(askChecked(browser, "POST", "/api/v1/session", good, {{"Content-Type", "text/plain"}}).status,
            415);
  EXPECT_EQ(askChecked(browser, "POST", "/api/v1/session", good, {{"Origin", "https://evil"}}).status, 403);
  EXPECT_EQ(askChecked(browser, "POST", "/api/v1/session", good, {{"Origin", "null"}}).status, 403);
  EXPECT_EQ(askChecked(browser, "POST", "/api/v1/session", good, {{"Sec-Fetch-Site", "cross-site"}}).status,
            403);
  EXPECT_EQ(browser.logIn("ines", kWebPassword).status, 200);
}

TEST(WebLogIn, saysTheFullNameAndEndsTheSessionThatTheBrowserHad) {
  WebLab lab;
  Browser ada = lab.browserOf("ada");
  EXPECT_EQ(askChecked(ada, "PATCH", "/api/v1/people/rhea", R"({"full_name": "Rhea Sato"})",
                       {{"If-Match", "\"1\""}})
                .status,
            200);
  Browser rhea = lab.browserOf("rhea"), before = lab.browser();
  before.cookie = rhea.cookie;
  EXPECT_EQ(askChecked(rhea, "GET", "/api/v1/session").json()["full_name"], "Rhea Sato");
  // A researcher sees only their own data.
  EXPECT_EQ(askChecked(rhea, "GET", "/api/v1/people/rhea").json()["full_name"], "Rhea Sato");
  EXPECT_EQ(askChecked(rhea, "GET", "/api/v1/people/ada").status, 403);
  const std::string body = json{{"name", "rhea"}, {"password", kWebPassword}}.dump();
  EXPECT_EQ(askChecked(rhea, "POST", "/api/v1/session", body).status, 200);
  EXPECT_EQ(askChecked(before, "GET", "/api/v1/session").status, 401);
}

TEST(WebSession, endsWithARoleThatAListOfPeopleChanges) {
  WebLab lab;
  Browser ada = lab.browserOf("ada"), ines = lab.browserOf("ines"), mara = lab.browserOf("mara");
  const auto viewer = ines.live();
  ASSERT_TRUE(viewer);
  const std::string csv = "name,role,full_name\nines,curriculum-manager,Ines\nmara,curriculum-manager,Mara\n";
  EXPECT_EQ(askChecked(ada, "POST", "/api/v1/people/import", json{{"csv", csv}}.dump()).json()["changed"], 2);
  EXPECT_EQ(askChecked(ines, "GET", "/api/v1/profiles").status, 401);
  EXPECT_EQ(askChecked(mara, "GET", "/api/v1/profiles").status, 200) << "only her full name is another";
  while (viewer->readText().has_value()) {
  }
  EXPECT_EQ(viewer->closeCode(), 1008);
}

TEST(WebSession, aChangeNeedsTheTokenOfItsSession) {
  WebLab lab;
  Browser ada = lab.browserOf("ada"), other = lab.browserOf("ada");
  const std::string body = R"({"disabled": true})";
  const std::string path = "/api/v1/people/tina";
  EXPECT_EQ(askChecked(ada, "PATCH", path, body, {{"X-CSRF-Token", ""}, {"If-Match", "\"1\""}}).status, 403);
  EXPECT_EQ(askChecked(ada, "PATCH", path, body, {{"X-CSRF-Token", "x"}}).status, 403);
  EXPECT_EQ(askChecked(ada, "PATCH", path, body, {{"X-CSRF-Token", other.csrf}}).status, 403);
  EXPECT_EQ(askChecked(ada, "PATCH", path, body, {{"Origin", "https://evil"}}).status, 403);
  EXPECT_EQ(askChecked(ada, "GET", path).json()["disabled"], false);
  EXPECT_EQ(
      askChecked(ada, "PATCH", path, body, {{"Origin", "https://localhost"}, {"If-Match", "\"1\""}}).status,
      200);
  EXPECT_EQ(askChecked(ada, "GET", path).json()["disabled"], true);
  // a cookie without a session
  Browser foreign = lab.browser();
  foreign.cookie = std::string(43, 'A');
  EXPECT_EQ(askChecked(foreign, "GET", "/api/v1/session").status, 401);
}

TEST(WebSession, endsWithItsTime) {
  // expires at once: Tokens' own tests use the clock
  WebLab lab([](ServerOptions& options) { options.token_lifetime = milliseconds(0); });
  Browser ines = lab.browserOf("ines");
  EXPECT_EQ(askChecked(ines, "GET", "/api/v1/profiles").status, 401);
}

TEST(WebSession, endsWithTheAccountAndThePassword) {
  WebLab lab;
  Browser ada = lab.browserOf("ada"), ines = lab.browserOf("ines"), mara = lab.browserOf("mara"),
          tina = lab.browserOf("tina");
  EXPECT_EQ(askChecked(ines, "GET", "/api/v1/profiles").status, 200);
  EXPECT_EQ(askChecked(ada, "PATCH", "/api/v1/people/ines", R"({"disabled": true})", {{"If-Match", "\"1\""}})
                .status,
            200);
  EXPECT_EQ(askChecked(ines, "GET", "/api/v1/profiles").status, 401);
  EXPECT_EQ(
      askChecked(ada, "POST", "/api/v1/people/mara/password", R"({"password": "another horse battery"})")
          .status,
      200);
  EXPECT_EQ(askChecked(mara, "GET", "/api/v1/profiles").status, 401);
  // disabled behind the server's back (needlelab-admin would not do this, but the store is queried each time)
  pb::Request request;
  request.mutable_disable_user()->set_name("tina");
  lab.server().asAdmin(request);
  EXPECT_EQ(askChecked(tina, "GET", "/api/v1/profiles").status, 401);
  EXPECT_EQ(askChecked(ada, "GET", "/api/v1/profiles").status, 200);
}

/// One row per route, written by hand: a route without a row fails, and so does a row without a route.
TEST(WebAccess, everyRouteIsForTheRolesOfTheTable) {
  WebLab lab;
  std::ifstream file(std::string(NEEDLELAB_SOURCE_DIR) + "/tests/unit/server/web/permissions_web.tsv");
  std::string line;
  std::getline(file, line);
  const std::vector<std::string> who = {"", "tina", "ines", "mara", "ada", "rhea"};
  std::set<std::string> rows;
  std::map<std::string, Browser> browsers;
  for (const std::string& name : who)
    browsers.emplace(name, name.empty() ? lab.browser() : lab.browserOf(name));
  while (std::getline(file, line)) {
    std::istringstream cells(line);
    std::string method, pattern, cell;
    cells >> method >> pattern;
    rows.insert(method + " " + pattern);
    std::string path = std::string(kApiBase) + pattern;
    // No such person or thing: a permitted user gets "not found".
    for (const char* part : {"{name}", "{id}", "{study}"})
      if (const auto at = path.find(part); at != std::string::npos)
        path.replace(at, std::string(part).size(),
                     pattern.starts_with("/sessions") ? "019aa0c3-7c1e-7b3a-9d5e-0123456789ab" : "nobody");
    for (const std::string& name : who) {
      ASSERT_TRUE(cells >> cell) << line;
      if (method == "DELETE" || pattern == "/backup")
        continue;  // log-out has its own test; a backup needs a path
      const std::string body = method == "GET"             ? ""
                               : method == "PATCH"         ? R"({"consent": true})"
                               : pattern.ends_with("word") ? R"({"password": "another horse battery"})"
                                                           : "{}";
      const int status = askChecked(browsers.at(name), method, path, body,
                                    {{"Origin", "https://localhost"}, {"If-Match", "\"1\""}})
                             .status;
      const bool refused = status == 401 || status == 403;
      EXPECT_EQ(!refused, cell == "yes") << method << " " << pattern << " as '" << name << "': " << status;
      if (name.empty() && cell == "no") {
        EXPECT_EQ(status, 401) << pattern;
      }
    }
  }
  for (const WebRoute& route : webRoutes()) {
    const std::string row = std::string(route.method) + " " + std::string(route.pattern);
    EXPECT_TRUE(rows.erase(row) == 1) << row << " has no row";
  }
  EXPECT_TRUE(rows.empty()) << *rows.begin() << " is not a route";
}

TEST(WebAccess, aTraineeSeesItsOwnSessionsOnly) {
  WebLab lab;
  lab.server().addUser("tom", pb::TRAINEE, kWebPassword);
  const std::string id = lab.recorded(3);  // tina's
  Browser tina = lab.browserOf("tina"), tom = lab.browserOf("tom"), ines = lab.browserOf("ines");
  for (const char* below :
       {"", "/score", "/events", "/samples", "/samples.csv", "/section", "/annotations"}) {
    const std::string path = "/api/v1/sessions/" + id + below;
    // Without a profile there is no score.
    if (std::string(below) != "/score") {
      EXPECT_NE(askChecked(tina, "GET", path).status, 404) << below;
    }
    EXPECT_EQ(askChecked(tom, "GET", path).status, 404) << below;
  }
  EXPECT_EQ(askChecked(tom, "GET", "/api/v1/sessions").json()["items"].size(), 0u);
  EXPECT_EQ(askChecked(tom, "GET", "/api/v1/sessions?trainee=tina").status, 403);
  EXPECT_EQ(askChecked(ines, "GET", "/api/v1/sessions").json()["items"].size(), 1u);
}

}  // namespace
}  // namespace needlelab
