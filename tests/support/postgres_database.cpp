#include "tests/support/postgres_database.h"

#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "db/connection.h"
#include "db/engine/open_postgres.h"
#include "db/schema.h"

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

/// The databases of this process.
class Databases {
 public:
  Databases() : control_(open("postgres")) {
    // one process makes the template, the others wait for it
    must(control_.run("SELECT pg_advisory_lock(1)"));
    auto there = control_.query("SELECT 1 FROM pg_database WHERE datname = ?", kTemplate);
    const auto found = there.step();
    if (!found) throw std::runtime_error(found.error().message);
    if (!*found) {
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
    for (const auto& [folder, name] : names_)
      (void)control_.script("DROP DATABASE IF EXISTS " + name + " WITH (FORCE)");
  }
  Databases(const Databases&) = delete;
  Databases& operator=(const Databases&) = delete;

  std::string urlOfFolder(const std::filesystem::path& folder) {
    const std::lock_guard lock(mutex_);
    std::string& name = names_[folder];
    if (name.empty()) {
      name = "t" + std::to_string(::getpid()) + "_" + std::to_string(++made_);
      must(control_.script("CREATE DATABASE " + name + " TEMPLATE " + kTemplate + " STRATEGY file_copy"));
    }
    return urlOf(name);
  }

  void dropBelow(const std::filesystem::path& folder) {
    const std::lock_guard lock(mutex_);
    const std::string below = folder.string() + "/";
    std::erase_if(names_, [&](const auto& one) {
      if (one.first != folder && !one.first.string().starts_with(below)) return false;
      (void)control_.script("DROP DATABASE IF EXISTS " + one.second + " WITH (FORCE)");
      return true;
    });
  }

 private:
  std::mutex mutex_;
  Connection control_;
  std::uint64_t made_ = 0;
  std::map<std::filesystem::path, std::string> names_;
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
  databases().dropBelow(folder);
}

}  // namespace needlelab::test
