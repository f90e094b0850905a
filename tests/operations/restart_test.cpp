// A server is replaced while stations run: systemd holds the port, no station is refused, and all continue at
// once.
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "common/base/files/files.h"
#include "tests/integration/lab.h"
#include "tests/operations/prometheus_text.h"
#include "tests/support/patience.h"

namespace needlelab {
namespace {

using namespace test;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr int kStations = 4;

/// Plays systemd for a unit with a socket and Type=notify.
class Manager {
 public:
  explicit Manager(const std::filesystem::path& folder) : path_(folder / "notify") {
    listening_ = ::socket(AF_INET, SOCK_STREAM, 0);  // inherited
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    if (::bind(listening_, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
        ::listen(listening_, 512) != 0 ||
        ::getsockname(listening_, reinterpret_cast<sockaddr*>(&address), &size) != 0)
      throw std::runtime_error("cannot listen");
    port_ = ntohs(address.sin_port);
    notify_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    path_.copy(name.sun_path, sizeof name.sun_path - 1);
    if (::bind(notify_, reinterpret_cast<sockaddr*>(&name), sizeof name) != 0)
      throw std::runtime_error("cannot bind");
  }
  ~Manager() {
    ::close(listening_);
    ::close(notify_);
  }
  Manager(const Manager&) = delete;
  Manager& operator=(const Manager&) = delete;

  /// Starts through a shell, because LISTEN_PID must be the program's own pid.
  std::unique_ptr<Process> start(const std::vector<std::string>& arguments,
                                 const std::filesystem::path& log) const {
    std::string line = "LISTEN_FDS=1 LISTEN_PID=$$ NOTIFY_SOCKET='" + path_ +
                       "' WATCHDOG_USEC=400000; "
                       "export LISTEN_FDS LISTEN_PID NOTIFY_SOCKET WATCHDOG_USEC; exec '" NEEDLELAB_BIN
                       "/needlelab-server'";
    for (const std::string& argument : arguments) line += " '" + argument + "'";
    line += " 3<&" + std::to_string(listening_);
    return std::make_unique<Process>("/bin/sh", std::vector<std::string>{"-c", line}, log,
                                     Process::Inherits::kAll);
  }
  /// Waits for the next message with this line. Returns false if none arrives.
  [[nodiscard]] bool hears(const std::string& wanted) const {
    const auto end = Clock::now() + kPatience;
    while (Clock::now() < end) {
      pollfd readable{notify_, POLLIN, 0};
      if (::poll(&readable, 1, 50) <= 0) continue;
      char text[500] = {};
      if (::recv(notify_, text, sizeof text - 1, 0) > 0 &&
          (std::string(text) + "\n").find(wanted + "\n") == 0)
        return true;
    }
    return false;
  }
  [[nodiscard]] int port() const { return port_; }

 private:
  std::string path_;
  int listening_ = -1, notify_ = -1, port_ = 0;
};

TEST(Restart, stationsGoOnAndNothingIsLost) {
  Lab lab;
  for (int i = 2; i <= kStations; ++i) {
    const std::string name = "station-" + std::to_string(i);
    ASSERT_EQ(lab.admin({"station", "add", name, "--out", lab.path(name + ".key")}), 0);
  }
  std::filesystem::rename(lab.path("station.key"), lab.path("station-1.key"));
  const Manager manager(lab.path(""));
  const auto startServer = [&](const std::string& name) {
    std::filesystem::remove(lab.path("metrics.port"));
    return manager.start(
        {"--data", lab.path("data"), "--metrics", "0", "--metrics-port-file", lab.path("metrics.port")},
        lab.path(name));
  };
  auto server = startServer("first.log");
  ASSERT_TRUE(manager.hears("READY=1")) << server->said();

  std::vector<std::unique_ptr<Process>> stations;
  for (int i = 1; i <= kStations; ++i) {
    const std::string name = "station-" + std::to_string(i);
    stations.push_back(
        std::make_unique<Process>("needlelab-station",
                                  std::vector<std::string>{"--server",
                                                           "127.0.0.1:" + std::to_string(manager.port()),
                                                           "--ca",
                                                           lab.path("data") / "tls" / "ca.crt",
                                                           "--key",
                                                           lab.path(name + ".key"),
                                                           "--trainee",
                                                           "tom",
                                                           "--headless",
                                                           "--spool",
                                                           lab.path(name),
                                                           "--exercise",
                                                           "shoulder-bursa",
                                                           "--device",
                                                           "simulated",
                                                           "--seconds",
                                                           "5",
                                                           "--drain",
                                                           "30",
                                                           "--json",
                                                           lab.path(name + ".json")},
                                  lab.path(name + ".log")));
  }
  const auto inSession = [&] {
    const auto port = readWholeFile(lab.path("metrics.port"));
    if (!port.ok()) return 0.0;
    return parsePrometheus(httpGet(static_cast<std::uint16_t>(std::stoi(*port)), "/metrics")
                               .body)["needlelab_connections{role=\"station\",state=\"in_session\"}"];
  };
  ASSERT_TRUE(eventually([&] { return inSession() == kStations; })) << server->said();
  EXPECT_TRUE(manager.hears("WATCHDOG=1")) << "it says that it turns";

  // the restart
  const auto began = Clock::now();
  server->signal(SIGTERM);
  EXPECT_TRUE(manager.hears("STOPPING=1"));
  ASSERT_EQ(server->wait(), 0) << server->said();
  const auto drained = Clock::now();
  auto second = startServer("second.log");
  ASSERT_TRUE(manager.hears("READY=1")) << second->said();
  const auto ready = Clock::now();
  // Opening a session is acknowledged with the committed chunks: all stations receive acknowledgements.
  const bool whole = eventually([&] { return inSession() == kStations; });
  const auto resumed = Clock::now();
  ASSERT_TRUE(whole) << second->said();
  const auto ms = [](auto duration) {
    return std::chrono::duration_cast<std::chrono::milliseconds>(duration).count();
  };
  std::printf(
      "restart under %d stations: drained in %lld ms, new server ready after %lld ms, all acknowledged again "
      "%lld ms later\n",
      kStations, static_cast<long long>(ms(drained - began)), static_cast<long long>(ms(ready - drained)),
      static_cast<long long>(ms(resumed - ready)));

  for (int i = 1; i <= kStations; ++i) {
    const std::string name = "station-" + std::to_string(i);
    const auto process = stations[static_cast<std::size_t>(i - 1)].get();
    EXPECT_EQ(process->wait(), 0) << process->said();
    EXPECT_THAT(process->said(), testing::Not(testing::HasSubstr("refused"))) << "the port was never closed";
    const auto summary = nlohmann::json::parse(*readWholeFile(lab.path(name + ".json")), nullptr, false);
    EXPECT_EQ(summary["spool_left"], 0) << name;
    EXPECT_EQ(summary["samples_acked"], summary["samples"]) << name;
    EXPECT_EQ(summary["state"], "COMPLETE") << name;
  }
  second->signal(SIGTERM);
  EXPECT_EQ(second->wait(), 0);
}

}  // namespace
}  // namespace needlelab
