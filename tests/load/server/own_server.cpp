#include "tests/load/server/own_server.h"

#include <fmt/core.h>
#include <sodium.h>

#include "common/base/files/files.h"
#include "common/base/time/clock.h"
#include "db/login/credentials.h"
#include "db/people/people.h"
#include "db/service/start/bootstrap.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

std::string randomPassword() {
  const StationKeyBytes bytes = makeStationKey();
  std::string text(2 * bytes.size() + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), bytes.data(), bytes.size());
  text.pop_back();
  return text;
}

}  // namespace

Result<Enrolled> enrol(const std::filesystem::path& data, std::size_t stations,
                       const std::string& store_url) {
  Store::Options options;
  options.holder = "needlelab-load";
  options.store_url = store_url;
  ASSIGN_OR_RETURN(auto store, Store::open(data, options));

  Enrolled enrolled;
  enrolled.user = "load";
  enrolled.password = randomPassword();
  ASSIGN_OR_RETURN(auto hash, hashPassword(enrolled.password));
  for (std::size_t i = 0; i < stations; ++i) {
    const StationKeyBytes key = makeStationKey();
    enrolled.stations.emplace_back(fmt::format("load-{:04}", i + 1), std::string(key.begin(), key.end()));
  }
  // all in one transaction: a thousand transactions would take a minute
  const Status done = (store)->writer().run([&](Connection& writer) -> Status {
    const std::int64_t now_ns = wallNowNs();
    Person person;
    person.name = enrolled.user;
    person.role = pb::ADMINISTRATOR;
    person.password_hash = hash;
    person.created_unix_ns = now_ns;
    RETURN_IF_ERROR(PeopleStore(writer).add(person));
    for (const auto& [name, key] : enrolled.stations) {
      StationKeyBytes bytes{};
      std::copy(key.begin(), key.end(), bytes.begin());
      RETURN_IF_ERROR(StationStore(writer).add(name, hashStationKey(bytes), now_ns));
    }
    return {};
  });
  if (!done.ok()) return done.error();
  return enrolled;
}

Status joinServer(const std::filesystem::path& bin, const std::filesystem::path& from,
                  const std::filesystem::path& data, const std::string& name) {
  Process admin(std::filesystem::absolute(bin) / "needlelab-admin",
                {"--data", data, "server", "join", "--from", from, "--name", name, "--with-authority"},
                data.parent_path() / "join.log");
  if (admin.wait() == 0) return {};
  return Error{ErrorCode::kFailed, "the server '" + name + "' could not join: " + admin.said()};
}

OwnServer::OwnServer(std::filesystem::path server, std::filesystem::path folder,
                     std::vector<std::string> arguments)
    : server_(std::filesystem::absolute(server)),
      folder_(std::filesystem::absolute(folder)),
      arguments_(std::move(arguments)) {}

Error OwnServer::failed(const std::string& what) const {
  std::string said = process_ ? process_->said() : "";
  if (said.size() > 2000) said = said.substr(said.size() - 2000);
  return {ErrorCode::kFailed, what + ": " + said};
}

Status OwnServer::start() {
  const auto port_file = folder_ / "port";
  const auto metrics_port_file = folder_ / "metrics-port";
  std::error_code ignored;
  std::filesystem::remove(port_file, ignored);
  std::vector<std::string> arguments = {"--data",
                                        data(),
                                        "--listen",
                                        fmt::format("127.0.0.1:{}", port_),
                                        "--port-file",
                                        port_file,
                                        "--metrics",
                                        "0",
                                        "--metrics-port-file",
                                        metrics_port_file,
                                        "--log-level",
                                        "warning"};
  arguments.insert(arguments.end(), arguments_.begin(), arguments_.end());
  process_ = std::make_unique<Process>(server_, arguments, log());
  ASSIGN_OR_RETURN(port_, portOf(*process_, port_file));
  // written before the stations' port
  ASSIGN_OR_RETURN(const auto metrics, readWholeFile(metrics_port_file));
  metrics_port_ = static_cast<std::uint16_t>(std::stoi(metrics));
  return {};
}

Scrape OwnServer::scrape(std::chrono::milliseconds limit) const {
  if (!process_) return {};
  return parsePrometheus(
      httpSend(metrics_port_, "GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n", limit)
          .body);
}

std::optional<std::uint64_t> OwnServer::liveHeapBytes() const {
  const double bytes = scrape(1s)["needlelab_heap_live_bytes"];
  return bytes > 0 ? std::optional(static_cast<std::uint64_t>(bytes)) : std::nullopt;
}

std::optional<ProcessSample> OwnServer::sample() const {
  return process_ ? sampleProcess(process_->pid()) : std::nullopt;
}

bool OwnServer::running() {
  return process_ && !process_->wait(0ms).has_value();
}

void OwnServer::kill() {
  if (!process_) return;
  if (const auto last = sample()) earlier_cpu_s_ += last->cpu_s;
  process_->signal(SIGKILL);
  static_cast<void>(process_->wait());
}

Status OwnServer::stop() {
  if (!process_) return {};
  if (const auto last = sample()) earlier_cpu_s_ += last->cpu_s;
  process_->signal(SIGTERM);
  const auto code = process_->wait();
  if (code == 0) return {};
  const Error error = failed(code ? fmt::format("the server ended with {}", *code)
                                  : std::string("the server did not end within 60 s"));
  process_.reset();
  return error;
}

}  // namespace needlelab::test
