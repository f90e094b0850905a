/// Looks at the files that an erasure names, on a store in a fresh folder.
#pragma once

#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "db/service/files_of_erased.h"
#include "tests/unit/db/service/records_fixture.h"

namespace needlelab::test {

class FilesOfErasedTest : public RecordsTest {
 protected:
  void SetUp() override {
    addStation();
    addPerson("ada", pb::ADMINISTRATOR);
    std::filesystem::create_directory(kept);
  }
  std::filesystem::path backup(const std::string& name) {
    pb::Request request;
    request.mutable_backup()->set_path((kept / name).string());
    get(admin, request);
    return kept / name;
  }
  std::vector<std::string> filesOf(const std::string& name) {
    const auto erasure = get(admin, erase(name)).erasure();
    text = erasure.text();
    return {erasure.files().begin(), erasure.files().end()};
  }
  void give(const Uuid& session, const std::string& who) {
    pb::Request request;
    request.mutable_assign_session()->set_session_id(bytesOfId(session));
    request.mutable_assign_session()->set_trainee(who);
    request.mutable_assign_session()->set_reason("practised before the account");
    get(manager, request);
  }
  std::uint64_t chunks(const Uuid& id) {
    pb::Request show;
    show.mutable_get_session()->set_session_id(bytesOfId(id));
    return get(instructor, show).session().chunks();
  }
  std::size_t restore(const std::filesystem::path& from) {
    store.reset();
    for (const char* suffix : {"-wal", "-shm"}) std::filesystem::remove(database.string() + suffix);
    std::filesystem::copy_file(from, database, std::filesystem::copy_options::overwrite_existing);
    store = openStore(folder.path() / "data");
    return store->erasuresRepeated();
  }
  std::string everything() {
    std::string all;
    EXPECT_OK(change([&](Connection& c) -> Status {
      all = dump(c);
      return {};
    }));
    return all;
  }
  /// All turns of a look.
  std::vector<std::string> look(const ErasedRows& erased,
                                std::chrono::nanoseconds most_time = kMostTimeOfFiles,
                                TimeSource& time = machineTime()) {
    LookAtFiles files(folder.path() / "data", kept, erased, nullptr, most_time, time);
    std::uint64_t opened = 0;
    turns = opened_files = 0;
    longest_turn_ns = 0;
    for (bool done = false; !done; ++turns) {
      const std::int64_t began_ns = time.nowNs();
      done = files.goOn();
      longest_turn_ns = std::max(longest_turn_ns, time.nowNs() - began_ns);
      EXPECT_LE(files.opened() - opened, 1u) << "one a turn";
      opened = files.opened();
    }
    opened_files = files.opened();
    const FilesFound all = files.found();
    others = all.others;
    std::vector<std::string> found;
    for (const std::filesystem::path& path : all.named) found.push_back(path.string());
    return found;
  }
  static ErasedRows rowsOf(const std::string& name) {
    ErasedRows erased;
    erased.names.name = name;
    return erased;
  }
  /// More lines of the log than a page takes, about ben.
  void addLines(int lines) {
    ASSERT_OK(change([&](Connection& c) {
      return c.run(
          "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < ?)"
          " INSERT INTO audit (unix_ns, who, action, subject, detail)"
          " SELECT 1, 'ina', 'consent', 'ben', 'given' FROM n",
          lines);
    }));
  }
  void put(const std::filesystem::path& file, const std::string& sql) {
    auto writer = TestDb::must(Connection::open(file, {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(writer.script(sql));
    ASSERT_OK(writer.script("PRAGMA journal_mode=DELETE"));
  }
  std::uint64_t turns = 0, opened_files = 0;
  std::int64_t longest_turn_ns = 0;
  std::map<std::filesystem::path, std::uint64_t> others;
  const std::filesystem::path kept = folder.path() / "kept";
  const std::filesystem::path database = folder.path() / "data" / "needlelab.db";
  std::string text;
};

}  // namespace needlelab::test
