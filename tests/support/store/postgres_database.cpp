#include "tests/support/store/postgres_database.h"

#include <unistd.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "db/engine/open_postgres.h"
#include "db/store/connection.h"
#include "db/store/schema.h"
#include "tests/support/patience.h"

namespace needlelab::test {
namespace {

constexpr const char* kTemplate = "needlelab_template";

std::string cluster() {
  const char* named = std::getenv("NEEDLELAB_TEST_POSTGRES");
  return named != nullptr ? named : "";
}

std::string urlOf(const std::string& database) {
  return cluster() + " dbname=" + database;
}

Connection open(const std::string& database) {
  auto engine = openPostgres({.url = urlOf(database)});
  if (!engine) throw std::runtime_error(engine.error().message);
  return {std::move(*engine), "needlelab.db"};
}

void must(const Status& status) {
  if (!status) throw std::runtime_error(status.error().message);
}

std::string textOf(Connection& connection, const std::string& sql) {
  auto row = connection.query(sql);
  const auto there = row.step();
  if (!there) throw std::runtime_error(there.error().message);
  return *there ? row.text(0) : "";
}

/// A fingerprint that changes with the schema, its privileges or the database's settings: how many rows of
/// each catalogue belong to the database, and the newest transaction that wrote one.
std::string schemaOf(Connection& connection) {
  static constexpr const char* kCatalogues[] = {"pg_class WHERE oid >= 16384",
                                                "pg_attribute WHERE attrelid >= 16384",
                                                "pg_attrdef",
                                                "pg_index WHERE indexrelid >= 16384",
                                                "pg_constraint WHERE oid >= 16384",
                                                "pg_trigger",
                                                "pg_rewrite WHERE oid >= 16384",
                                                "pg_policy",
                                                "pg_proc WHERE oid >= 16384",
                                                "pg_type WHERE oid >= 16384",
                                                "pg_namespace WHERE nspname !~ '^pg_'",
                                                "pg_default_acl",
                                                "pg_statistic_ext",
                                                "pg_event_trigger",
                                                "pg_extension",
                                                "pg_largeobject_metadata",
                                                "pg_db_role_setting",
                                                "pg_database WHERE datname = current_database()"};
  std::string sql = "SELECT concat_ws(' '";
  for (const char* catalogue : kCatalogues)
    sql += std::string(", (SELECT count(*) || ':' || coalesce(max(xmin::text::bigint), 0) FROM ") +
           catalogue + ")";
  return textOf(connection, sql + ")");
}

/// A database used for one folder after the other. One folder's data are removed before the next uses it:
/// that takes a tenth of the time of creating a database.
class KeptDatabase {
 public:
  explicit KeptDatabase(std::string name)
      : name_(std::move(name)), control_(open(name_)), schema_(schemaOf(control_)) {
    const std::string tables =
        "SELECT relname FROM pg_class WHERE relnamespace = 'needlelab'::regnamespace AND relkind = 'r'";
    std::string deleted, filled;
    for (std::string rest = textOf(control_, "SELECT string_agg(relname, ' ') FROM (" + tables + ") AS t");
         !rest.empty();) {
      const std::size_t end = rest.find(' ');
      const std::string table = "needlelab." + rest.substr(0, end);
      rest = end == std::string::npos ? "" : rest.substr(end + 1);
      deleted += "DELETE FROM " + table + ";";
      filled += textOf(control_, "SELECT 'INSERT INTO " + table +
                                     " SELECT * FROM jsonb_populate_recordset(NULL::" + table +
                                     ", ' || quote_literal(jsonb_agg(t)) || ');' FROM " + table + " AS t");
    }
    // without triggers and foreign keys, and without planner statistics
    emptied_ = "SET session_replication_role = replica;" + deleted + filled +
               "DELETE FROM pg_statistic WHERE starelid >= 16384;RESET session_replication_role";
  }

  [[nodiscard]] const std::string& name() const { return name_; }

  /// Restores its initial state. False: it cannot be reused. Somebody has changed more than rows, is still
  /// connected, or has ended this connection, too, as a test of lost connections does.
  bool empty() {
    const std::string others =
        " FROM pg_stat_activity WHERE datname = current_database() AND pid <> pg_backend_pid()"
        " AND backend_type = 'client backend'";
    try {
      must(control_.script("SELECT pg_terminate_backend(pid)" + others));
      // their transactions end with them
      const auto until = std::chrono::steady_clock::now() + kPatience;
      while (textOf(control_, "SELECT count(*)" + others) != "0") {
        if (std::chrono::steady_clock::now() > until) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
      if (schemaOf(control_) != schema_) return false;
      must(control_.script(emptied_));
      return true;
    } catch (const std::runtime_error&) {
      return false;
    }
  }

 private:
  std::string name_;
  Connection control_;
  std::string schema_;
  std::string emptied_;  ///< SQL
};

/// The databases of this process.
class Databases {
 public:
  Databases() : control_(open("postgres")) {
    // one process creates the template, the others wait for it
    must(control_.run("SELECT pg_advisory_lock(1)"));
    if (textOf(control_, std::string("SELECT 'there' FROM pg_database WHERE datname = '") + kTemplate + "'")
            .empty()) {
      const std::string unfinished = std::string(kTemplate) + "_new";
      must(control_.script("CREATE DATABASE " + unfinished));
      {
        Connection made = open(unfinished);
        must(migrate(made));
      }
      must(control_.script("ALTER DATABASE " + unfinished + " RENAME TO " + kTemplate));
    }
    must(control_.run("SELECT pg_advisory_unlock(1)"));
  }
  ~Databases() {
    for (const auto& [folder, database] : used_) drop(*database);
    for (const auto& database : free_) drop(*database);
  }
  Databases(const Databases&) = delete;
  Databases& operator=(const Databases&) = delete;

  std::string urlOfFolder(const std::filesystem::path& folder) {
    const std::lock_guard lock(mutex_);
    std::unique_ptr<KeptDatabase>& database = used_[folder];
    if (database == nullptr && !free_.empty()) {
      database = std::move(free_.back());
      free_.pop_back();
    } else if (database == nullptr) {
      const std::string name = "t" + std::to_string(::getpid()) + "_" + std::to_string(++made_);
      must(control_.script("CREATE DATABASE " + name + " TEMPLATE " + kTemplate + " STRATEGY file_copy"));
      database = std::make_unique<KeptDatabase>(name);
    }
    return urlOf(database->name());
  }

  void giveBackBelow(const std::filesystem::path& folder) {
    const std::lock_guard lock(mutex_);
    const std::string below = folder.string() + "/";
    for (auto one = used_.begin(); one != used_.end();) {
      if (one->first != folder && !one->first.string().starts_with(below)) {
        ++one;
        continue;
      }
      if (one->second->empty())
        free_.push_back(std::move(one->second));
      else
        drop(*one->second);
      one = used_.erase(one);
    }
  }

 private:
  void drop(const KeptDatabase& database) {
    (void)control_.script("DROP DATABASE IF EXISTS " + database.name() + " WITH (FORCE)");
  }

  std::mutex mutex_;
  Connection control_;
  std::uint64_t made_ = 0;
  std::map<std::filesystem::path, std::unique_ptr<KeptDatabase>> used_;
  std::vector<std::unique_ptr<KeptDatabase>> free_;
};

Databases& databases() {
  static Databases made;
  return made;
}

}  // namespace

bool onPostgres() {
  return !cluster().empty();
}

std::string postgresUrlOf(const std::filesystem::path& folder) {
  return databases().urlOfFolder(folder);
}

void dropPostgresBelow(const std::filesystem::path& folder) {
  databases().giveBackBelow(folder);
}

}  // namespace needlelab::test
