// Exporting an hour needs no more memory than exporting a minute; through a server, in the same process, so
// that both sides count. Short form: six minutes. NEEDLELAB_LONG=1: the hour.
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <thread>

#include "common/base/clock.h"
#include "server/live/log.h"
#include "server/server.h"
#include "tests/support/sanitized.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

class ExportMemory : public test::AdminTest {
 protected:
  /// A session of that many seconds at 1 kHz.
  Uuid addLong(std::uint64_t seconds) const {
    auto store = test::TestDb::must(Store::open(data(), {}));
    const Uuid id = makeUuidV7();
    EXPECT_OK(store->writer().run([&](Connection& c) -> Status {
      if (const auto known = StationStore(c).find("station-1"); known.ok() && !known->has_value()) {
        if (auto added = StationStore(c).add("station-1", StationKeyBytes{}, 1); !added) return added;
      }
      SessionStore sessions(c);
      if (auto opened = sessions.open(test::describe(id), 1); !opened) return opened.error();
      for (std::uint64_t seq = 0; seq < seconds; ++seq) {
        if (auto appended = sessions.append(id, seq, test::chunkOf(seq, 1000)); !appended)
          return appended.error();
      }
      pb::CloseSession close;
      close.set_session_id(test::bytesOfId(id));
      close.set_chunks(seconds);
      close.set_samples(1000 * seconds);
      const auto hashed = sessions.hashChunks(id, seconds);
      if (!hashed) return hashed.error();
      close.set_hash(hashed->hash.data(), hashed->hash.size());
      const auto closed = sessions.close(close, 2, {}, *hashed);
      return closed ? Status() : Status(closed.error());
    }));
    return id;
  }
  static std::uint64_t statusKiB(const std::string& key) {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);) {
      if (line.rfind(key + ":", 0) == 0) return std::strtoull(line.c_str() + key.size() + 1, nullptr, 10);
    }
    return 0;
  }
  /// The process's largest size while `work` ran.
  template <typename Work>
  static std::uint64_t peakKiB(const Work& work) {
    std::ofstream("/proc/self/clear_refs") << "5";
    work();
    return statusKiB("VmHWM");
  }
};

TEST_F(ExportMemory, doesNotGrowWithTheLength) {
  const bool lengthy = std::getenv("NEEDLELAB_LONG") != nullptr;
  const std::uint64_t seconds = lengthy ? 3600 : 360;
  const auto password = folder.write("pw", "correct horse").string();
  good({"user", "add", "ines", "--role", "instructor", "--password-file", password});
  const std::string minute = uuidText(addLong(60)), longer = uuidText(addLong(seconds));
  ServerOptions options;
  options.data = data();
  options.listen = "127.0.0.1:0";
  setLogLevel(LogLevel::kOff);
  auto server = Server::start(options);
  ASSERT_OK(server);
  std::thread thread([&] { EXPECT_EQ((*server)->run(), 0); });

  const auto take = [&](const std::string& id, const std::string& format, std::uint64_t samples) {
    const std::string out = file("out." + format);
    const Run run = this->run({"--server", "127.0.0.1:" + std::to_string((*server)->port()), "--ca",
                               (*server)->caFile().string(), "--user", "ines", "--password-file", password,
                               "session", "export", id, "--format", format, "--out", out});
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_NE(run.out.find("wrote " + std::to_string(samples) + " samples"), std::string::npos) << run.out;
    std::cout << run.out;
    std::filesystem::remove(out);
  };
  for (const std::string format : {"csv", "json"}) {
    take(minute, format, 60'000);  // caches and pools are filled by this one
    const auto small = peakKiB([&] { take(minute, format, 60'000); });
    const auto large = peakKiB([&] { take(longer, format, 1000 * seconds); });
    std::cout << format << ": peak " << small << " KiB for a minute, " << large << " KiB for " << seconds / 60
              << " minutes\n";
    if (!test::kSanitized) {
      EXPECT_LT(large, small + 4096) << format;
    }
  }
  (*server)->stop();
  thread.join();
}

}  // namespace
}  // namespace needlelab
