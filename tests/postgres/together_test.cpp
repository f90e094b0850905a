// Servers that work together on one database, each with its own data folder: which exclude each other, which
// work only one does at a time, and what each has separately.
#include <gmock/gmock.h>

#include <sstream>
#include <string>
#include <vector>

#include "client/admin/command.h"
#include "common/base/files/files.h"
#include "common/wire/certificates.h"
#include "db/engine/open_postgres.h"
#include "db/erasure/erasure.h"
#include "db/people/people.h"
#include "db/service/start/bootstrap.h"
#include "db/store/duties.h"
#include "db/store/schema.h"
#include "tests/support/patience.h"
#include "tests/support/store/postgres_database.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class Together : public testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path at(const std::string& name) const { return folder.path() / name; }

  Result<std::unique_ptr<Store>> open(const std::string& name, bool together = true) {
    Store::Options options;
    options.together = together;
    options.writer.window = std::chrono::milliseconds(1);
    if (name == "a") options.store_url = url;
    return Store::open(at(name), options);
  }
  /// Creates a further server's folder. "a" must have been opened once.
  void join(const std::string& name) {
    ASSERT_OK(ensureTlsFiles(tlsFilesIn(at("a") / "tls"), {.hosts = {"localhost"}}));
    const std::string folder_of = at(name).string(), from = at("a").string();
    const char* const typed[] = {
        "needlelab-admin", "--data", folder_of.c_str(), "server",      "join",     "--from",
        from.c_str(),      "--name", name.c_str(),      "--host-name", "localhost"};
    std::ostringstream out, err;
    ASSERT_EQ(runAdmin(static_cast<int>(std::size(typed)), typed, out, err), 0) << err.str();
  }
  static std::string meta(Store& store, const std::string& key) {
    auto reader = TestDb::must(store.readers().borrow());
    return TestDb::must(MetaStore(*reader).get(key)).value_or("none");
  }
  static void addPeople(Store& store) {
    ASSERT_OK(store.writer().run([](Connection& c) -> Status {
      RETURN_IF_ERROR(PeopleStore(c).add({"ada", pb::ADMINISTRATOR, "$hash", false, 1}));
      RETURN_IF_ERROR(PeopleStore(c).add({"anna", pb::TRAINEE, "", false, 1}));
      return PeopleStore(c).add({"bob", pb::TRAINEE, "", false, 1});
    }));
  }
  static Outcome erase(Store& store, const std::string& name, bool with_waiting = false) {
    pb::Request request;
    request.mutable_erase_person()->set_name(name);
    request.mutable_erase_person()->set_confirm(name);
    request.mutable_erase_person()->set_with_waiting_sessions(with_waiting);
    return store.service().execute({"ada", pb::ADMINISTRATOR}, request);
  }

  TempFolder folder;
  PostgresBelow dropped_at_end{folder.path()};
  const std::string url = postgresUrlOf(folder.path() / "database");
};

TEST_F(Together, whoIsAloneAndWhoIsNotRefuseEachOther) {
  {
    const auto alone = open("a", false);
    ASSERT_OK(alone);
    EXPECT_EQ((*alone)->sharedServerName(), "");
    // so that the folder can be joined: --together does this at its start
    ASSERT_OK(PseudonymKey::ofFolder(at("a")));
    join("b");
    const auto refused = open("b");
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
    EXPECT_THAT(refused.error().message, HasSubstr("start that server with --together"));
  }
  const auto a = open("a"), b = open("b");
  ASSERT_OK(a);
  ASSERT_OK(b);
  EXPECT_EQ((*a)->sharedServerName(), kFirstServer);
  EXPECT_EQ((*b)->sharedServerName(), "b");
  join("c");
  const auto refused = open("c", false);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(refused.error().message, HasSubstr("end it (each, where servers work together)"));
  // both write
  addPeople(**a);
  ASSERT_OK((*b)->writer().run([](Connection& c) {
    return PeopleStore(c).add({"cleo", pb::TRAINEE, "", false, 1});
  }));
}

TEST_F(Together, aCopyOfAFolderIsNoFurtherServer) {
  ASSERT_OK(open("a"));
  join("b");
  const auto b = open("b");
  ASSERT_OK(b);
  std::filesystem::copy(at("b"), at("copy"), std::filesystem::copy_options::recursive);
  const auto copy = open("copy");
  ASSERT_FALSE(copy.ok());
  EXPECT_THAT(copy.error().message, HasSubstr("a server 'b' works on this database already"));
}

TEST_F(Together, anSqliteFileIsOneServersOnly) {
  Store::Options options;
  options.together = true;
  const auto refused = Store::open(at("lite"), options);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused.error().message, HasSubstr("--together: the database of"));
  EXPECT_FALSE(std::filesystem::exists(at("lite") / "needlelab.db"));
}

TEST_F(Together, aNewerSchemaIsMadeByWhoHasTheDatabaseForItself) {
  const auto a = open("a");
  ASSERT_OK(a);
  join("b");
  // no version is older than the first: imitate one, without the table of versions
  const auto rename = [&](const std::string& from, const std::string& to) {
    const auto own = openPostgres({.url = url});
    ASSERT_OK(own);
    ASSERT_OK((*own)->script("ALTER TABLE needlelab." + from + " RENAME TO " + to));
  };
  rename("schema_version", "away");
  const auto refused = open("b");
  rename("away", "schema_version");
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable) << "the one that ends the others tries again";
  EXPECT_THAT(refused.error().message, HasSubstr("end the other servers, start this one"));
  ASSERT_OK(open("b"));
}

TEST_F(Together, theDailyWorkIsOneServersUntilItEnds) {
  auto a = open("a");
  ASSERT_OK(a);
  join("b");
  const auto b = open("b");
  ASSERT_OK(b);
  const auto runs = [](Store& store) {
    const auto report = store.service().retention().daily();
    EXPECT_OK(report);
    return report && report->has_value();
  };
  EXPECT_TRUE(runs(**a));
  EXPECT_FALSE(runs(**b));
  EXPECT_TRUE(runs(**a)) << "the next day, too";
  a->reset();
  EXPECT_TRUE(runs(**b));
}

TEST_F(Together, whatOneServerDoesAtATimeIsRefusedAtAnother) {
  const auto a = open("a");
  ASSERT_OK(a);
  join("b");
  const auto b = open("b");
  ASSERT_OK(b);
  addPeople(**a);
  const Duties elsewhere(StoreAddress(at("a") / "needlelab.db", url));
  const Principal ada{"ada", pb::ADMINISTRATOR};
  pb::Request retention, rescoring;
  retention.mutable_run_retention();
  rescoring.mutable_rescore_all();
  const auto refused = [&](const Outcome& outcome, const char* words) {
    ASSERT_TRUE(outcome.error.has_value()) << words;
    EXPECT_EQ(outcome.error->code, ErrorCode::kUnavailable);
    EXPECT_THAT(outcome.error->message, HasSubstr(words));
  };
  const auto done = [](const Outcome& outcome) { EXPECT_FALSE(outcome.error) << outcome.error->message; };
  {
    auto run = elsewhere.take(Duty::kRetention);
    ASSERT_OK(run);
    ASSERT_TRUE(run->has_value());
    EXPECT_TRUE(TestDb::must((*run)->isHeld()));
    refused((*b)->service().execute(ada, retention), "under way at another server");
    retention.mutable_run_retention()->set_dry_run(true);
    done((*b)->service().execute(ada, retention));
    // an erased person's chunks wait for the next run
    const Outcome erased = erase(**b, "bob");
    done(erased);
    EXPECT_THAT(erased.reply.erasure().text(),
                HasSubstr("A run of retention is under way at another server"));
  }
  retention.mutable_run_retention()->set_dry_run(false);
  done((*b)->service().execute(ada, retention));
  {
    const auto run = elsewhere.take(Duty::kRescoring);
    refused((*b)->service().execute(ada, rescoring), "under way at another server");
  }
  done((*b)->service().execute(ada, rescoring));
  {
    const auto erasure = elsewhere.take(Duty::kErasure);
    refused(erase(**b, "anna"), "an erasure is under way at another server");
    // a start first completes those of its own folder
    join("c");
    const auto start = open("c");
    ASSERT_FALSE(start.ok());
    EXPECT_EQ(start.error().code, ErrorCode::kUnavailable);
    EXPECT_THAT(start.error().message, HasSubstr("start again when it is done"));
  }
  done(erase(**b, "anna"));
  ASSERT_OK(open("c"));
}

// its connection is lost, and the lock with it
TEST_F(Together, aDutyWhoseConnectionIsLostMayBeAnothersThen) {
  const auto a = open("a");
  ASSERT_OK(a);
  const StoreAddress address(at("a") / "needlelab.db", url);
  const Duties one(address), other(address);
  auto held = TestDb::must(one.take(Duty::kRescoring));
  ASSERT_TRUE(held.has_value());
  EXPECT_FALSE(TestDb::must(other.take(Duty::kRescoring)).has_value());
  const auto cut = [&] {
    ASSERT_OK((*a)->writer().run([](Connection& c) {
      return c.run(
          "SELECT pg_terminate_backend(pid, 10000) FROM pg_locks WHERE locktype = 'advisory' AND objid = ?",
          static_cast<std::int64_t>(Duty::kRescoring));
    }));
  };
  cut();
  {
    const auto next = TestDb::must(other.take(Duty::kRescoring));
    ASSERT_TRUE(next.has_value());
    EXPECT_FALSE(TestDb::must(held->isHeld()));
  }
  // PostgreSQL releases the lock a moment after its connection has ended
  EXPECT_TRUE(eventually([&] { return TestDb::must(held->isHeld()); }))
      << "no one has it, so it is had again";
}

TEST_F(Together, eachServerListsTheErasuresOfTheOthers) {
  const auto a = open("a");
  ASSERT_OK(a);
  addPeople(**a);
  join("b");
  auto b = open("b");
  ASSERT_OK(b);
  ASSERT_FALSE(erase(**a, "anna").error.has_value());
  ASSERT_FALSE(erase(**a, "bob", true).error.has_value());
  const auto listed = TestDb::must(readErasures(at("a")));
  ASSERT_EQ(listed.size(), 2u);
  EXPECT_THAT(TestDb::must(readErasures(at("b"))), IsEmpty());
  ASSERT_OK((*b)->service().erasures().completeList());
  EXPECT_EQ(TestDb::must(readErasures(at("b"))), listed);
  // and at its start, for what arrived while it did not run
  b->reset();
  ASSERT_OK((*a)->writer().run([](Connection& c) {
    return PeopleStore(c).add({"carl", pb::TRAINEE, "", false, 1});
  }));
  ASSERT_FALSE(erase(**a, "carl").error.has_value());
  b = open("b");
  ASSERT_OK(b);
  EXPECT_EQ(TestDb::must(readErasures(at("b"))).size(), 3u);
  EXPECT_EQ((*b)->erasuresRepeated(), 0u);
}

TEST_F(Together, eachServerTracksItsOwnAcknowledgements) {
  auto a = open("a");
  ASSERT_OK(a);
  join("b");
  auto b = open("b");
  ASSERT_OK(b);
  const auto store = [](Store& server, const std::string& name) {
    ASSERT_OK(server.writer().run([&](Connection& c) {
      return PeopleStore(c).add({name, pb::TRAINEE, "", false, 1});
    }));
    ASSERT_OK(server.keepAcknowledged());
    ASSERT_OK(server.writer().run([](Connection&) { return Status(); }));  // waits for the number
    ASSERT_OK(server.keepAcknowledged());
  };
  store(**b, "one");
  store(**b, "two");
  store(**a, "three");
  const int of_a = std::stoi(meta(**a, "acknowledged")), of_b = std::stoi(meta(**a, "acknowledged b"));
  EXPECT_GT(of_b, of_a);
  a->reset();
  b->reset();
  // a server that is alone again keeps its name
  b = open("b", false);
  ASSERT_OK(b);
  EXPECT_EQ((*b)->acknowledgedMissing(), "");
  // an older database: its own number is missing, regardless of another server's
  b->reset();
  a = open("a", false);
  ASSERT_OK(a);
  EXPECT_EQ((*a)->acknowledgedMissing(), "");
  ASSERT_OK((*a)->writer().run([](Connection& c) { return MetaStore(c).set("acknowledged b", "0"); }));
  a->reset();
  b = open("b", false);
  ASSERT_OK(b);
  EXPECT_THAT((*b)->acknowledgedMissing(), HasSubstr("does not have all that was acknowledged"));
}

// a lagging standby was promoted, and another server's transactions took the missing numbers
TEST_F(Together, aServerThatRunsFindsThatItsNumberIsMissing) {
  const auto a = open("a");
  ASSERT_OK(a);
  const auto store = [&](const std::string& name) {
    ASSERT_OK((*a)->writer().run([&](Connection& c) {
      return PeopleStore(c).add({name, pb::TRAINEE, "", false, 1});
    }));
    ASSERT_OK((*a)->keepAcknowledged());
    ASSERT_OK((*a)->writer().run([](Connection&) { return Status(); }));
  };
  store("one");
  store("two");
  EXPECT_EQ((*a)->writer().lack(), "");
  ASSERT_OK((*a)->writer().run([](Connection& c) { return MetaStore(c).set("acknowledged", "0"); }));
  store("three");
  EXPECT_THAT((*a)->writer().lack(), HasSubstr("does not have all that was acknowledged"));
}

}  // namespace
}  // namespace needlelab::test
