// Two servers on one PostgreSQL database: what ends an access at one ends it at the other.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "db/engine/open_postgres.h"
#include "db/service/start/bootstrap.h"
#include "server/web/web_call.h"
#include "tests/support/patience.h"
#include "tests/support/store/password_cost.h"
#include "tests/support/store/postgres_database.h"
#include "tests/unit/db/planted_here.h"
#include "tests/unit/server/live/access_requests.h"
#include "tests/unit/server/live/running_server.h"
#include "tests/unit/server/web/browser.h"

namespace needlelab {
namespace {

using namespace test;
using nlohmann::json;
using std::chrono::seconds;
using testing::HasSubstr;

constexpr const char* kPassword = "correct horse battery";

pb::Request roleOf(const std::string& name, pb::Role role) {
  pb::Request request;
  request.mutable_change_user()->set_name(name);
  request.mutable_change_user()->set_base_revision(1);
  request.mutable_change_user()->set_role(role);
  return request;
}
pb::Request erasureOf(const std::string& name) {
  pb::Request request;
  request.mutable_erase_person()->set_name(name);
  request.mutable_erase_person()->set_confirm(name);
  return request;
}

/// The database is unreachable during its lifetime.
class DatabaseAway {
 public:
  explicit DatabaseAway(std::string url) {
    const std::size_t from = url.find("dbname=") + std::string_view("dbname=").size();
    name_ = url.substr(from);
    auto opened = openPostgres({.url = url.replace(from, std::string::npos, "postgres")});
    if (!opened) throw std::runtime_error(opened.error().message);
    control_.emplace(std::move(*opened), "x");
    const Status away = control_->script(
        "ALTER DATABASE \"" + name_ + "\" ALLOW_CONNECTIONS false;" +
        " SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '" + name_ + "'");
    if (!away.ok()) throw std::runtime_error(away.error().message);
  }
  ~DatabaseAway() { (void)control_->script("ALTER DATABASE \"" + name_ + "\" ALLOW_CONNECTIONS true"); }
  DatabaseAway(const DatabaseAway&) = delete;
  DatabaseAway& operator=(const DatabaseAway&) = delete;

 private:
  std::string name_;
  std::optional<Connection> control_;
};

class AccessAtTwoServers : public testing::Test {
 protected:
  /// Servers A and B; `tweak` changes the options of both.
  void start(std::function<void(ServerOptions&)> tweak = {}) {
    files_ = folder_.path() / "console";
    std::filesystem::create_directories(files_);
    std::ofstream(files_ / "index.html") << "<!doctype html><title>needlelab</title>";
    const auto both = [this, tweak = std::move(tweak)](ServerOptions& options) {
      options.together = true;
      options.web.listen = "127.0.0.1:0";
      options.web.root = files_;
      if (tweak) tweak(options);
    };
    a_ = std::make_unique<RunningServer>(both);
    const auto data = a_->folder() / "data";
    b_ = std::make_unique<RunningServer>([both, data](ServerOptions& options) {
      both(options);
      options.store_url = postgresUrlOf(data);
      // what a second server gets from the first one's folder
      std::filesystem::create_directories(options.data);
      std::filesystem::permissions(options.data, std::filesystem::perms::owner_all);
      for (const char* file : {"store", "audit.key", "pseudonym.key"})
        std::filesystem::copy_file(data / file, options.data / file,
                                   std::filesystem::copy_options::overwrite_existing);
      std::ofstream(options.data / kServerFile) << serverFileText("b");
    });
    for (const char* name : {"ines", "ben"}) a_->addUser(name, pb::INSTRUCTOR, kPassword);
    a_->addUser("ada", pb::ADMINISTRATOR, kPassword);
    a_->addUser("mara", pb::CURRICULUM_MANAGER, kPassword);
  }
  RunningServer& a() { return *a_; }
  RunningServer& b() { return *b_; }

  static BlockingClient clientOf(RunningServer& server, const pb::Login& login) {
    auto client = server.connect(login);
    if (!client.ok()) throw std::runtime_error(client.error().message);
    return std::move(*client);
  }
  static Browser browserOf(RunningServer& server, const std::string& name) {
    Browser browser(server.server().webPort());
    const WebReply reply = browser.logIn(name, kPassword);
    EXPECT_EQ(reply.status, 200) << reply.body;
    return browser;
  }
  /// The same browser, with its next request going to another server.
  static Browser movedTo(RunningServer& server, const Browser& from) {
    Browser moved(server.server().webPort());
    moved.cookie = from.cookie;
    moved.csrf = from.csrf;
    return moved;
  }
  /// Waits for the message that ends a connection; returns its text.
  static std::string textAtEnd(BlockingClient& client) {
    const auto refusal = waitForRefusal(client);
    EXPECT_EQ(refusal.reason(), pb::Refusal::LOGIN) << refusal.text();
    EXPECT_TRUE(refusal.fatal());
    return refusal.text();
  }
  /// Whether a request on it is answered.
  static bool isOpen(BlockingClient& client) {
    pb::Envelope ask;
    ask.mutable_request()->set_id(77);
    if (client.welcome().role() == pb::STATION)
      ask.mutable_request()->mutable_check_trainee()->set_trainee("guest");
    else
      ask.mutable_request()->mutable_get_lab_settings();
    if (!client.send(ask).ok()) return false;
    const auto answer = waitFor(client, [](const pb::Envelope& e) {
      return (e.has_reply() && e.reply().id() == 77) || e.has_refusal();
    });
    return answer.has_reply();
  }
  /// Connections of A's and B's listeners.
  std::string sqlOf(const std::string& sql) {
    auto opened = openPostgres({.url = postgresUrlOf(a_->folder() / "data")});
    if (!opened) throw std::runtime_error(opened.error().message);
    Connection connection(std::move(*opened), "x");
    auto row = connection.prepare(sql);
    const auto there = row.step();
    if (!there) throw std::runtime_error(there.error().message);
    return *there ? row.text(0) : "";
  }
  static constexpr const char* kListeners =
      " FROM pg_stat_activity WHERE datname = current_database() AND application_name = 'needlelab access'";

  // a test of NOTIFY must not be helped by the poll every second
  static void onlyNotices(ServerOptions& options) {
    options.access.poll_every = std::chrono::hours(1);
    options.access.deaf_after = std::chrono::hours(1);
  }

  TempFolder folder_;
  std::filesystem::path files_;
  std::unique_ptr<RunningServer> a_, b_;  // B ends first: A owns the database
};

/// What ends an access, and whose.
struct Ending {
  const char* what;
  pb::Request request;
  const char* says;
};

TEST_F(AccessAtTwoServers, revokingAccessAtOneServerEndsSessionsAtTheOther) {
  start(onlyNotices);
  const Ending endings[] = {{"password", passwordOf("ines", "another horse battery"), "password was changed"},
                            {"role", roleOf("ben", pb::RESEARCHER), "log in again"},
                            {"disabled", disable("mara"), "disabled"}};
  for (const Ending& ending : endings) {
    SCOPED_TRACE(ending.what);
    const std::string name = ending.request.has_set_password()  ? "ines"
                             : ending.request.has_change_user() ? "ben"
                                                                : "mara";
    auto there = clientOf(b(), personLogin(name, kPassword));
    auto others = clientOf(b(), personLogin("ada", kPassword));
    Browser browser = browserOf(b(), name), at_a = movedTo(a(), browser);
    const auto live = name == "mara" ? nullptr : browser.live();
    EXPECT_EQ(at_a.get("/api/v1/session").status, 200) << "a session of B is one of A's";
    (void)a().asAdmin(ending.request);
    EXPECT_THAT(textAtEnd(there), HasSubstr(ending.says));
    EXPECT_EQ(browser.get("/api/v1/session").status, 401);
    EXPECT_EQ(at_a.get("/api/v1/session").status, 401);
    if (live) {
      std::optional<std::string> text;
      do text = live->readText();
      while (text && live->closeCode() == 0);
      EXPECT_EQ(live->closeCode(), 1008) << "the session has ended";
    }
    EXPECT_FALSE(b().connect(byToken(there.welcome().token())).ok()) << "its token, too";
    EXPECT_TRUE(isOpen(others));
  }
}

TEST_F(AccessAtTwoServers, anErasedPersonsAndARevokedStationsConnectionsEndAtBoth) {
  start(onlyNotices);
  const std::string key = a().addStation("bench");
  auto station = clientOf(b(), stationLogin("bench", key));
  auto ines = clientOf(b(), personLogin("ines", kPassword));
  auto ben = clientOf(b(), personLogin("ben", kPassword));
  pb::Request revoke;
  revoke.mutable_revoke_station()->set_name("bench");
  (void)a().asAdmin(revoke);
  EXPECT_THAT(textAtEnd(station), HasSubstr("key was revoked"));
  EXPECT_FALSE(b().connect(stationLogin("bench", key)).ok());

  (void)a().asAdmin(erasureOf("ines"));
  (void)textAtEnd(ines);
  EXPECT_TRUE(isOpen(ben));
  for (const char* table : {"access_numbers", "login_tokens"})
    EXPECT_EQ(sqlOf(std::string("SELECT count(*) FROM needlelab.") + table + " WHERE name = 'ines'"), "0");
}

TEST_F(AccessAtTwoServers, aLogOutAtOneEndsTheSessionAtTheOther) {
  start(onlyNotices);
  Browser browser = browserOf(a(), "ines"), at_b = movedTo(b(), browser);
  EXPECT_EQ(at_b.get("/api/v1/session").status, 200);
  const auto live = at_b.live();
  ASSERT_TRUE(live);
  EXPECT_EQ(browser.ask("DELETE", "/api/v1/session").status, 200);
  EXPECT_EQ(at_b.get("/api/v1/session").status, 401);
  std::optional<std::string> text;
  do text = live->readText();
  while (text && live->closeCode() == 0);
  EXPECT_EQ(live->closeCode(), 1008);
}

/// Whether B accepts a browser's session, and its token at the other port, after A has ended it; with the
/// planted bug it does.
struct Honoured {
  bool session = false, token = false;
};

class RevokedTokens : public AccessAtTwoServers {
 protected:
  Honoured honoured() {
    Browser browser = browserOf(a(), "ines"), at_b = movedTo(b(), browser);
    EXPECT_EQ(at_b.get("/api/v1/session").status, 200);
    EXPECT_EQ(browser.ask("DELETE", "/api/v1/session").status, 200);
    const auto token = bytesOfBase64Url(browser.cookie.substr(browser.cookie.find('=') + 1));
    if (!token) throw std::runtime_error("no token in " + browser.cookie);
    return {at_b.get("/api/v1/session").status == 200, b().connect(byToken(*token)).ok()};
  }
};

TEST_F(RevokedTokens, areNotHonouredAtTheOtherServer) {
  start();
  const Honoured is = honoured();
  EXPECT_FALSE(is.session);
  EXPECT_FALSE(is.token);
}

TEST_F(RevokedTokens, areFoundToBeHonouredWhereThatIsPlanted) {
  start();
  bugPlantedHere() = PlantedBug::kRevokedTokenHonoured;
  const Honoured is = honoured();
  bugPlantedHere().reset();
  EXPECT_TRUE(is.session);
  EXPECT_TRUE(is.token);
}

TEST_F(AccessAtTwoServers, aTokenOfOneLogsInAtTheOther) {
  start();
  const auto first = clientOf(a(), personLogin("ines", kPassword));
  const auto second = clientOf(b(), byToken(first.welcome().token()));
  EXPECT_EQ(second.welcome().name(), "ines");
  EXPECT_NE(second.welcome().token(), first.welcome().token());
  EXPECT_TRUE(a().connect(byToken(second.welcome().token())).ok());
  std::string other = first.welcome().token();
  other[1] = static_cast<char>(other[1] ^ 1);
  EXPECT_FALSE(b().connect(byToken(other)).ok());
}

TEST_F(AccessAtTwoServers, whatAPageShowsAndSendsGoesToEitherServer) {
  start();
  Browser browser = browserOf(a(), "mara"), at_b = movedTo(b(), browser);
  EXPECT_EQ(at_b.get("/api/v1/session").json()["csrf_token"], browser.csrf);
  EXPECT_EQ(
      at_b.ask("PATCH", "/api/v1/people/mara", R"({"full_name": "Mara B."})", {{"If-Match", "\"1\""}}).status,
      200);
  // while only a session may send
  const std::string body = json{{"csv", "name,role\n" + std::string(50'000, ' ')}}.dump();
  EXPECT_NE(movedTo(b(), browserOf(a(), "ada")).ask("POST", "/api/v1/people/import", body).status, 413);
}

TEST_F(AccessAtTwoServers, aLockOutAtOneHoldsAtTheOther) {
  start([](ServerOptions& options) {
    options.guard.allowed_per_name = 2;
    options.guard.first_wait = std::chrono::minutes(10);
  });
  EXPECT_FALSE(a().connect(personLogin("ines", "a guess")).ok());
  EXPECT_FALSE(b().connect(personLogin("ines", "a guess")).ok());
  for (RunningServer* server : {&a(), &b()}) {
    const auto locked = server->connect(personLogin("ines", kPassword));
    ASSERT_FALSE(locked.ok());
    EXPECT_THAT(locked.error().message, HasSubstr("too many failed log-ins"));
  }
  EXPECT_EQ(Browser(b().server().webPort()).logIn("ines", kPassword).status, 429);
  EXPECT_TRUE(b().connect(personLogin("ben", kPassword)).ok());
}

TEST_F(AccessAtTwoServers, guessesAtTwoServersShareOneLimit) {
  start([](ServerOptions& options) {
    options.guard.first_wait = std::chrono::minutes(10);
    options.limits.handshake_timeout = std::chrono::minutes(10);
  });
  std::atomic<int> refused{0}, limited{0};
  std::vector<std::thread> guessers;
  for (int i = 0; i < 12; ++i)
    guessers.emplace_back([&, i] {
      for (int n = 0; n < 2; ++n) {
        const auto guess =
            (i % 2 == 0 ? a() : b()).connect(personLogin("ines", "guess " + std::to_string(i)));
        if (guess.ok()) continue;
        ++(guess.error().message.find("RATE_LIMITED") == std::string::npos ? refused : limited);
      }
    });
  for (std::thread& guesser : guessers) guesser.join();
  EXPECT_EQ(refused.load(), 5) << "as many as one server lets pass";
  EXPECT_EQ(limited.load(), 19);
}

TEST_F(AccessAtTwoServers, wrongCodesAtTwoServersShareOneLimit) {
  start();
  a().addUser("tom", pb::TRAINEE, "");
  pb::Request code;
  code.mutable_set_code()->set_name("tom");
  code.mutable_set_code()->set_code("123456");
  (void)a().asAdmin(code);
  const std::string key = a().addStation("bench");
  int wrong = 0, waits = 0;
  for (int n = 0; n < 8; ++n) {
    pb::Request check;
    check.mutable_check_trainee()->set_trainee("tom");
    check.mutable_check_trainee()->set_code("000000");
    const Outcome outcome = (n % 2 == 0 ? a() : b()).service().execute({"bench", pb::STATION}, check);
    ASSERT_TRUE(outcome.error);
    EXPECT_EQ(outcome.error->code, ErrorCode::kCode) << outcome.error->message;
    ++(outcome.error->message.find("too many wrong codes") == std::string::npos ? wrong : waits);
  }
  EXPECT_EQ(wrong, 5);
  EXPECT_EQ(waits, 3);
}

// The listeners' connections are cut, and the account is disabled before they reconnect.
TEST_F(AccessAtTwoServers, aChangeWhoseNoticeWasMissedIsSeenAfterTheReconnection) {
  start([](ServerOptions& options) {
    onlyNotices(options);
    options.access.first_pause = seconds(2);
  });
  auto ines = clientOf(b(), personLogin("ines", kPassword));
  auto ben = clientOf(b(), personLogin("ben", kPassword));
  ASSERT_TRUE(eventually([&] { return sqlOf(std::string("SELECT count(*)") + kListeners) == "2"; }));
  (void)sqlOf(std::string("SELECT count(pg_terminate_backend(pid))") + kListeners);
  ASSERT_TRUE(eventually([&] { return sqlOf(std::string("SELECT count(*)") + kListeners) == "0"; }));
  (void)a().asAdmin(disable("ines"));
  EXPECT_EQ(sqlOf(std::string("SELECT count(*)") + kListeners), "0") << "no one heard of it";
  (void)textAtEnd(ines);
  EXPECT_EQ(sqlOf(std::string("SELECT count(*)") + kListeners), "2");
  EXPECT_TRUE(isOpen(ben));
}

// A changed password leaves role and account as they are: only the number changes.
TEST_F(AccessAtTwoServers, withoutChangeNoticesEachUseAsksTheDatabase) {
  start([](ServerOptions& options) {
    onlyNotices(options);
    options.access.first_pause = std::chrono::hours(1);
  });
  const std::string key = a().addStation("bench");
  auto ines = clientOf(b(), personLogin("ines", kPassword));
  auto ben = clientOf(b(), personLogin("ben", kPassword));
  auto station = clientOf(b(), stationLogin("bench", key));
  Browser browser = browserOf(b(), "ines");
  const std::string token = ines.welcome().token();
  (void)sqlOf(std::string("SELECT count(pg_terminate_backend(pid))") + kListeners);
  ASSERT_TRUE(eventually([&] { return sqlOf(std::string("SELECT count(*)") + kListeners) == "0"; }));
  EXPECT_TRUE(isOpen(ines));
  (void)a().asAdmin(passwordOf("ines", "another horse battery"));
  EXPECT_FALSE(isOpen(ines));
  EXPECT_EQ(browser.get("/api/v1/session").status, 401);
  EXPECT_FALSE(b().connect(byToken(token)).ok());
  EXPECT_TRUE(isOpen(ben));
  EXPECT_TRUE(isOpen(station));
  pb::Request revoke;
  revoke.mutable_revoke_station()->set_name("bench");
  (void)a().asAdmin(revoke);
  EXPECT_FALSE(isOpen(station));
}

TEST_F(AccessAtTwoServers, aServerThatCannotListenLooksAtAllAccountsEachSecond) {
  start([](ServerOptions& options) {
    options.access.first_pause = std::chrono::hours(1);
    options.access.deaf_after = milliseconds(500);
  });
  auto ines = clientOf(b(), personLogin("ines", kPassword));
  auto ben = clientOf(b(), personLogin("ben", kPassword));
  (void)sqlOf(std::string("SELECT count(pg_terminate_backend(pid))") + kListeners);
  (void)a().asAdmin(passwordOf("ines", "another horse battery"));
  (void)textAtEnd(ines);
  EXPECT_TRUE(isOpen(ben));
}

// Somebody may have been disabled in the meantime: after a while no one can start watching at a server that
// is cut off.
TEST_F(AccessAtTwoServers, aServerWithoutDatabaseRefusesNewViewers) {
  start([](ServerOptions& options) {
    options.access.deaf_after = milliseconds(300);
    options.access.watch_refused_after = milliseconds(500);
  });
  (void)a().addStation("bench");
  auto ines = clientOf(b(), personLogin("ines", kPassword));
  std::uint32_t number = 0;
  const auto isRefused = [&] {
    pb::Envelope subscribe;
    subscribe.mutable_subscribe()->set_subscription(++number);
    subscribe.mutable_subscribe()->set_station("bench");
    EXPECT_TRUE(ines.send(subscribe).ok());
    // everything received so far, including earlier answers
    for (auto got = ines.receive(milliseconds(100)); got.ok(); got = ines.receive(milliseconds(100)))
      if (got->has_refusal() &&
          got->refusal().text().find("does not reach its database") != std::string::npos)
        return true;
    return false;
  };
  EXPECT_FALSE(isRefused());
  const DatabaseAway away(postgresUrlOf(a().folder() / "data"));
  EXPECT_TRUE(eventually(isRefused));
}

// Nor does anyone stay longer than a log-in lasts. A station does.
TEST_F(AccessAtTwoServers, aServerWithoutDatabaseDropsPeopleAfterTheLogInPeriod) {
  start([](ServerOptions& options) {
    options.access.deaf_after = milliseconds(300);
    options.token_lifetime = seconds(1);
  });
  const std::string key = a().addStation("bench");
  auto station = clientOf(b(), stationLogin("bench", key));
  auto ines = clientOf(b(), personLogin("ines", kPassword));
  const DatabaseAway away(postgresUrlOf(a().folder() / "data"));
  EXPECT_THAT(textAtEnd(ines), HasSubstr("longer than a log-in lasts"));
  pb::Envelope status;
  status.mutable_station_status();
  EXPECT_TRUE(station.send(status).ok());
  (void)station.receive(milliseconds(100));
  EXPECT_TRUE(station.connected());
}

TEST_F(AccessAtTwoServers, changingYourPasswordKeepsOnlyYourConnection) {
  start(onlyNotices);
  auto asks = clientOf(a(), personLogin("ines", kPassword));
  auto second = clientOf(a(), personLogin("ines", kPassword));
  auto at_b = clientOf(b(), personLogin("ines", kPassword));
  pb::Envelope envelope;
  *envelope.mutable_request() = passwordOf("ines", "another horse battery");
  envelope.mutable_request()->set_id(5);
  envelope.mutable_request()->mutable_set_password()->set_old_password(kPassword);
  ASSERT_TRUE(asks.send(envelope).ok());
  const auto answer = waitFor(asks, [](const pb::Envelope& e) { return e.has_reply() || e.has_refusal(); });
  ASSERT_TRUE(answer.has_reply()) << answer.refusal().text();
  const auto changed = std::chrono::steady_clock::now();
  (void)textAtEnd(at_b);
  (void)textAtEnd(second);
  // a server is notified of its own changes a second later
  std::this_thread::sleep_until(changed + milliseconds(1'300));
  EXPECT_TRUE(isOpen(asks));
  EXPECT_TRUE(b().connect(personLogin("ines", "another horse battery")).ok());
}

TEST_F(AccessAtTwoServers, repeatedLogInsAreAuditedOnceAnHourAcrossServers) {
  start();
  const Principal ada{"ada", pb::ADMINISTRATOR, true, 7};
  for (RunningServer* server : {&a(), &b(), &a()})
    ASSERT_TRUE(server->service().notes().noteLogin(ada, "10.1.2.3").ok());
  EXPECT_EQ(sqlOf("SELECT count(*) FROM needlelab.audit WHERE action = 'log-in' AND detail LIKE '%10.1.2.3'"),
            "1");
}

// An erasure leaves a person's session under a pseudonym, and the change's row contains no name.
TEST_F(AccessAtTwoServers, anErasedNameLeavesTheLiveStatusOfBothServers) {
  start();
  a().addUser("tina", pb::TRAINEE, "");
  a().addUser("tom", pb::TRAINEE, "");
  const std::string key = a().addStation("bench"), other_key = a().addStation("other");
  auto station = clientOf(b(), stationLogin("bench", key)),
       other = clientOf(b(), stationLogin("other", other_key));
  auto ines = clientOf(b(), personLogin("ines", kPassword));
  const auto begin = [](BlockingClient& client, const std::string& name, const std::string& trainee) {
    const FakeSession session(name);
    pb::Envelope open = session.open();
    open.mutable_open_session()->mutable_description()->set_trainee(trainee);
    ASSERT_TRUE(client.send(open).ok());
    (void)waitFor(client, [](const pb::Envelope& e) { return e.has_session_opened(); });
    pb::Envelope status;
    status.mutable_station_status()->set_session_id(session.id());
    status.mutable_station_status()->set_trainee(trainee);
    ASSERT_TRUE(client.send(status).ok());
    (void)client.receive(milliseconds(100));  // it sends while it waits
  };
  begin(station, "bench", "tina");
  begin(other, "other", "tom");
  const auto shown = [&](int at) {
    pb::Request list;
    list.mutable_list_stations();
    const auto reply = ines.call(list);
    return reply.ok() ? reply->stations().stations(at).status().trainee() : reply.error().message;
  };
  ASSERT_TRUE(eventually([&] { return shown(0) == "tina" && shown(1) == "tom"; }))
      << shown(0) << "," << shown(1);
  pb::Request erasure = erasureOf("tina");
  erasure.mutable_erase_person()->set_with_open_sessions(true);
  (void)a().asAdmin(erasure);
  EXPECT_TRUE(eventually([&] { return shown(0).empty(); })) << shown(0);
  EXPECT_EQ(shown(1), "tom");
}

// Somebody changed the schema while the servers run.
TEST_F(AccessAtTwoServers, aDisabledTriggerIsReportedAndAllAccountsAreChecked) {
  start([](ServerOptions& options) {
    options.metrics = "127.0.0.1:0";
    options.access.poll_every = milliseconds(200);
    options.access.faults_every = milliseconds(100);
  });
  auto ines = clientOf(b(), personLogin("ines", kPassword));
  const auto health = [&] {
    WebWire wire(b().server().metricsPort(), false);
    (void)wire.sendPlain("GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n");
    return wire.receivePlain();
  };
  EXPECT_THAT(health(), testing::Not(HasSubstr("a trigger of")));
  (void)sqlOf("ALTER TABLE needlelab.people DISABLE TRIGGER people_access");
  EXPECT_TRUE(eventually([&] {
    return health().find("a trigger of the tables people, stations or access_numbers is missing or off") !=
           std::string::npos;
  }));
  (void)a().asAdmin(disable("ines"));
  (void)textAtEnd(ines);
  (void)sqlOf("ALTER TABLE needlelab.people ENABLE TRIGGER people_access");
  EXPECT_TRUE(eventually([&] { return health().find("a trigger of") == std::string::npos; }));
}

TEST_F(AccessAtTwoServers, healthReportsWhetherChangeNoticesArrive) {
  start([](ServerOptions& options) {
    options.metrics = "127.0.0.1:0";
    options.access.first_pause = seconds(30);
    options.access.deaf_after = milliseconds(500);
  });
  const auto get = [&](const std::string& path) {
    WebWire wire(b().server().metricsPort(), false);
    (void)wire.sendPlain("GET " + path + " HTTP/1.1\r\nHost: x\r\n\r\n");
    return wire.receivePlain();
  };
  EXPECT_THAT(get("/metrics"), HasSubstr("needlelab_access_heard 1\n"));
  EXPECT_THAT(get("/healthz"), HasSubstr("\"access_heard_s\":"));
  EXPECT_THAT(get("/healthz"), testing::Not(HasSubstr("changes of access")));
  (void)sqlOf(std::string("SELECT count(pg_terminate_backend(pid))") + kListeners);
  EXPECT_TRUE(eventually([&] {
    return get("/healthz").find("changes of access at other servers are not heard") != std::string::npos;
  }));
  EXPECT_TRUE(
      eventually([&] { return get("/metrics").find("needlelab_access_heard 0\n") != std::string::npos; }));
}

}  // namespace
}  // namespace needlelab
