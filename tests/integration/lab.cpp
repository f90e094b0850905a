#include "tests/integration/lab.h"

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <stdexcept>

#include "common/base/files/files.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

// A free port below the range in which the kernel assigns arbitrary ports (ip_local_port_range): no other
// program gets it while the server restarts.
int ownPort() {
  static int next = static_cast<int>(::getpid()) * 16;
  for (int tried = 0; tried < 12'000; ++tried) {
    const int port = 20'000 + next++ % 12'000;
    const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_ANY);
    const bool is_free = ::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    ::close(fd);
    if (is_free) return port;
  }
  throw std::runtime_error("no port from 20000 to 31999 is free");
}

}  // namespace

Lab::Lab(const std::string& store) {
  folder_.write("password", "correct horse\n");
  // the folder remembers its store
  std::vector<std::string> first = {"user",          "add", "ines", "--role", "instructor", "--password-file",
                                    path("password")};
  if (!store.empty()) first.insert(first.begin(), {"--store", store});
  const bool made = admin(first) == 0 && admin({"user", "add", "tom", "--role", "trainee"}) == 0 &&
                    admin({"station", "add", "station-1", "--out", path("station.key")}) == 0;
  if (!made) throw std::runtime_error("needlelab-admin could not set up the lab");
}

int Lab::admin(const std::vector<std::string>& arguments) const {
  std::vector<std::string> all = {"--data", path("data")};
  all.insert(all.end(), arguments.begin(), arguments.end());
  Process process("needlelab-admin", all, path("admin.log"));
  const auto code = process.wait();
  if (code != 0) ADD_FAILURE() << process.said();
  return code.value_or(-1000);
}

void Lab::startServer() {
  std::filesystem::remove(path("port"));
  if (port_ == 0) port_ = ownPort();
  // the same port after a restart: the stations reconnect to it
  std::vector<std::string> arguments = {"--data",      path("data"),
                                        "--listen",    listen_host + ":" + std::to_string(port_),
                                        "--port-file", path("port")};
  arguments.insert(arguments.end(), server_arguments.begin(), server_arguments.end());
  server_ = std::make_unique<Process>("needlelab-server", arguments, path("server.log"));
  const auto port = portOf(*server_, path("port"));
  if (!port.ok()) throw std::runtime_error(port.error().message);
  port_ = *port;
}

void Lab::killServer() {
  server_->signal(SIGKILL);
  (void)server_->wait();
  server_.reset();
}

int Lab::stopServer() {
  server_->signal(SIGTERM);
  const auto code = server_->wait();
  return code.value_or(-1000);
}

std::vector<std::string> Lab::stationArguments(const std::vector<std::string>& more,
                                               const std::filesystem::path& spool) const {
  std::vector<std::string> arguments = {"--server",
                                        "127.0.0.1:" + std::to_string(port_),
                                        "--ca",
                                        path("data") / "tls" / "ca.crt",
                                        "--key",
                                        path("station.key"),
                                        "--trainee",
                                        "tom",
                                        "--headless",
                                        "--spool",
                                        spool.empty() ? path("spool") : spool};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

std::unique_ptr<Process> Lab::startStation(const std::string& name, const std::vector<std::string>& more) {
  auto arguments = stationArguments(more);
  arguments.insert(arguments.end(), {"--json", path(name + ".json")});
  return std::make_unique<Process>("needlelab-station", arguments, path(name + ".log"));
}

nlohmann::json Lab::summary(const std::string& name) const {
  auto text = readWholeFile(path(name + ".json"));
  return text.ok() ? nlohmann::json::parse(*text, nullptr, false) : nlohmann::json();
}

Result<BlockingClient> Lab::instructor() const {
  ClientConfig config;
  config.server.port = static_cast<std::uint16_t>(port_);
  config.ca_file = path("data") / "tls" / "ca.crt";
  config.program = programText("test");
  config.login = personLogin("ines", "correct horse");
  config.connect_timeout = std::chrono::minutes(1);
  return BlockingClient::connect(config);
}

pb::Reply Lab::ask(const pb::Request& request) const {
  auto client = instructor();
  if (!client.ok()) throw std::runtime_error(client.error().message);
  auto reply = client->call(request);
  if (!reply.ok()) throw std::runtime_error(reply.error().message);
  return *reply;
}

std::vector<pb::SessionInfo> Lab::sessions() const {
  pb::Request request;
  request.mutable_list_sessions();
  const pb::Reply reply = ask(request);
  return {reply.sessions().sessions().begin(), reply.sessions().sessions().end()};
}

StoredSession Lab::stored(const std::string& session_id) const {
  const Uuid id = *parseUuid(session_id);
  StoredSession session;
  pb::Request request;
  request.mutable_get_session()->set_session_id(id.data(), id.size());
  session.info = ask(request).session();
  for (;;) {
    request.mutable_read_chunks()->set_session_id(id.data(), id.size());
    request.mutable_read_chunks()->set_from_seq(session.chunks.size());
    request.mutable_read_chunks()->set_max_chunks(50);
    const pb::Reply reply = ask(request);
    for (const pb::Chunk& chunk : reply.chunks().chunks()) {
      session.chunks.push_back(chunk.data());
      auto samples = decodeChunk(viewOf(chunk.data()));
      EXPECT_TRUE(samples.ok());
      session.samples.insert(session.samples.end(), samples->begin(), samples->end());
    }
    if (reply.chunks().end() || reply.chunks().chunks().empty()) break;
  }
  return session;
}

bool Lab::verifies(const std::string& session_id) const {
  const Uuid id = *parseUuid(session_id);
  pb::Request request;
  request.mutable_verify_session()->set_session_id(id.data(), id.size());
  return ask(request).verified().ok();
}

std::vector<std::string> Lab::spooledChunks(const std::filesystem::path& spool,
                                            const std::string& session_id) {
  std::vector<std::string> chunks;
  auto file = SpoolFile::open(spool / session_id / "chunks");
  EXPECT_TRUE(file.ok());
  auto end = file->scan([&](const SpoolRecord& record) {
    EXPECT_EQ(record.seq, chunks.size());
    chunks.emplace_back(textOf(record.data));
    return true;
  });
  EXPECT_TRUE(end.ok());
  return chunks;
}

double scoreOf(const nlohmann::json& row, const std::string& measure) {
  for (const auto& one : row["score"])
    if (one["measure"] == measure) return one["value"];
  return -1;
}

}  // namespace needlelab::test
