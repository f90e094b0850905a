/// Runs needlelab-admin in a fresh folder and returns its output and exit code.
#pragma once

#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "client/admin/command.h"
#include "db/service/start/bootstrap.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {

class AdminTest : public testing::Test {
 protected:
  struct Run {
    int code = -1;
    std::string out, err;
    /// Returns the rows of --json.
    [[nodiscard]] nlohmann::json rows() const { return nlohmann::json::parse(out).at("rows"); }
  };
  Run run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "needlelab-admin");
    std::vector<const char*> argv;
    for (const auto& argument : arguments) argv.push_back(argument.c_str());
    std::ostringstream out, err;
    Run result;
    result.code = runAdmin(static_cast<int>(argv.size()), argv.data(), out, err);
    result.out = out.str();
    result.err = err.str();
    return result;
  }
  /// Runs on the data folder; the exit code must be 0.
  Run good(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"--data", data()});
    Run result = run(arguments);
    EXPECT_EQ(result.code, 0) << result.err;
    return result;
  }
  Run onData(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"--data", data()});
    return run(arguments);
  }
  [[nodiscard]] std::string data() const { return (folder.path() / "data").string(); }
  [[nodiscard]] std::string file(const std::string& name) const { return (folder.path() / name).string(); }

  /// Adds a session of `chunks` chunks with 20 samples each, closed unless `open`. `sql` can damage it.
  Uuid addSession(std::uint64_t chunks, bool open = false, const std::string& sql = "") const {
    auto store = TestDb::must(Store::open(data(), {}));
    const Uuid id = makeUuidV7();
    EXPECT_OK(store->writer().run([&](Connection& c) -> Status {
      if (const auto known = StationStore(c).find("station-1"); known.ok() && !known->has_value()) {
        if (auto added = StationStore(c).add("station-1", StationKeyBytes{}, 1); !added) return added;
      }
      SessionStore sessions(c);
      if (auto opened = sessions.open(describe(id), 1); !opened) return opened.error();
      for (std::uint64_t seq = 0; seq < chunks; ++seq) {
        if (auto appended = sessions.append(id, seq, chunkOf(seq)); !appended) return appended.error();
      }
      if (!open) {
        if (auto closed = sessions.close(closeOf(id, chunks), 2); !closed) return closed.error();
      }
      return sql.empty() ? Status() : c.script(sql);
    }));
    return id;
  }

  TempFolder folder;
};

}  // namespace needlelab::test
