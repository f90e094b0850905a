/// A lab in a data folder, an empty database on PostgreSQL, and `needlelab-admin store copy` between them.
#pragma once

#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "common/base/files/files.h"
#include "common/base/time/clock.h"
#include "db/service/folder/data_folder.h"
#include "db/service/start/store_move.h"
#include "db/store/schema.h"
#include "tests/support/store/postgres_database.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab::test {

class StoreMoveTest : public AdminTest {
 protected:
  [[nodiscard]] std::filesystem::path lab(const std::string& name) const {
    return folder.path() / "data" / name;
  }
  [[nodiscard]] StoreMove toPostgres() const {
    return {.folder = data(), .url = url, .by = "local:tess", .now_unix_ns = wallNowNs()};
  }
  [[nodiscard]] Run copyTo(std::vector<std::string> more = {}) const {
    std::vector<std::string> all{"store", "copy", "--from", data(), "--to", url};
    all.insert(all.end(), more.begin(), more.end());
    return run(all);
  }
  [[nodiscard]] Run copyBack(std::vector<std::string> more = {}) const {
    std::vector<std::string> all{"store", "copy", "--from", url, "--to", data()};
    all.insert(all.end(), more.begin(), more.end());
    return run(all);
  }
  /// Expects that the lab works, on the right engine, with its data.
  void expectSound(bool on_postgres, std::uint64_t sessions) const {
    {
      const auto store = Store::open(data(), {.create = false});
      ASSERT_OK(store);
      auto reader = TestDb::must((*store)->readers().borrow());
      EXPECT_EQ(reader->sqlite() == nullptr, on_postgres);
      for (const char* key : {"copy_under_way", "copied_to"})
        EXPECT_FALSE(TestDb::must(MetaStore(*reader).get(key)).has_value()) << key;
    }
    const Run check = onData({"check", "--json"});
    EXPECT_EQ(check.code, 0) << check.err << check.out;
    if (check.code == 0) {
      EXPECT_EQ(check.rows()[0]["sessions"], sessions);
    }
    const Run verify = onData({"audit", "verify"});
    EXPECT_EQ(verify.code, 0) << verify.err << verify.out;
  }
  /// A copy that ended before it was compared: `pages` pages of one row each exist, those of `table` if
  /// given.
  void leaveUnfinished(int pages, const std::string& table = "") const {
    StoreMove move = toPostgres();
    move.copy = {.on_progress = [pages, table](const CopyProgress& progress) mutable -> Status {
                   const bool counts = !progress.table_ended && (table.empty() || progress.table == table);
                   if (!counts || --pages > 0) return {};
                   return Error{ErrorCode::kUnavailable, "killed"};
                 },
                 .max_rows = 1};
    const auto moved = moveStore(move);
    ASSERT_FALSE(moved.ok());
    EXPECT_EQ(moved.error().message, "killed");
  }

  PostgresBelow dropped_at_end{folder.path()};
  const std::string url = postgresUrlOf(folder.path() / "one");
};

/// A PostgreSQL user who may only log in, and a database.
class PlainUser {
 public:
  /// `owns`: the user owns the database, and it is empty; otherwise it has another user's tables, which this
  /// one may change.
  explicit PlainUser(bool owns)
      : cluster_(std::getenv("NEEDLELAB_TEST_POSTGRES")),
        control_(connect("postgres")),
        name_("plain" + std::to_string(::getpid()) + (owns ? "a" : "b")) {
    run(control_, "CREATE ROLE " + name_ + " LOGIN");
    run(control_, "CREATE DATABASE " + name_ +
                      " TEMPLATE template0 ENCODING 'UTF8' LC_COLLATE 'C' LC_CTYPE 'C'" +
                      (owns ? " OWNER " + name_ : ""));
    if (owns) return;
    Connection made = connect(name_);
    EXPECT_OK(migrate(made));
    run(made, "GRANT USAGE ON SCHEMA needlelab TO " + name_ +
                  "; GRANT ALL ON ALL TABLES IN SCHEMA needlelab TO " + name_);
  }
  ~PlainUser() {
    (void)control_.script("DROP DATABASE IF EXISTS " + name_ + " WITH (FORCE)");
    (void)control_.script("DROP ROLE IF EXISTS " + name_);
  }
  PlainUser(const PlainUser&) = delete;
  PlainUser& operator=(const PlainUser&) = delete;
  [[nodiscard]] std::string url() const {
    return cluster_.substr(0, cluster_.find(" user=")) + " user=" + name_ + " dbname=" + name_;
  }

 private:
  [[nodiscard]] Connection connect(const std::string& database) const {
    return TestDb::must(
        openAt(StoreAddress("needlelab.db", cluster_ + " dbname=" + database), Connection::Mode::kWriter));
  }
  static void run(Connection& connection, const std::string& sql) { EXPECT_OK(connection.script(sql)); }

  const std::string cluster_;
  Connection control_;
  const std::string name_;
};

}  // namespace needlelab::test
