#include "tests/load/own_server.h"

#include <sodium.h>

#include "common/base/clock.h"
#include "common/base/files.h"
#include "common/base/text.h"
#include "db/credentials.h"
#include "db/people.h"
#include "db/service/bootstrap.h"

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

Result<Enrolled> enrol(const std::filesystem::path& data, std::size_t stations) {
  Store::Options options;
  options.holder = "needlelab-load";
  auto store = Store::open(data, options);
  if (!store.ok()) return store.error();

  Enrolled enrolled;
  enrolled.user = "load";
  enrolled.password = randomPassword();
  auto hash = hashPassword(enrolled.password);
  if (!hash.ok()) return hash.error();
  for (std::size_t i = 0; i < stations; ++i) {
    const StationKeyBytes key = makeStationKey();
    enrolled.stations.emplace_back(formatted("load-%04zu", i + 1), std::string(key.begin(), key.end()));
  }
  // all in one transaction: a thousand would take a minute
  const Status done = (*store)->writer().run([&](Connection& writer) -> Status {
    const std::int64_t now_ns = wallNowNs();
    Person person;
    person.name = enrolled.user;
    person.role = pb::ADMINISTRATOR;
    person.password_hash = *hash;
    person.created_unix_ns = now_ns;
    if (Status added = PeopleStore(writer).add(person); !added.ok()) return added;
    for (const auto& [name, key] : enrolled.stations) {
      StationKeyBytes bytes{};
      std::copy(key.begin(), key.end(), bytes.begin());
      if (Status added = StationStore(writer).add(name, hashStationKey(bytes), now_ns); !added.ok())
        return added;
    }
    return {};
  });
  if (!done.ok()) return done.error();
  return enrolled;
}

OwnServer::OwnServer(std::filesystem::path server, std::filesystem::path folder)
    : server_(std::filesystem::absolute(server)), folder_(std::filesystem::absolute(folder)) {}

Error OwnServer::failed(const std::string& what) const {
  std::string said = process_ ? process_->said() : "";
  if (said.size() > 2000) said = said.substr(said.size() - 2000);
  return {ErrorCode::kFailed, what + ": " + said};
}

Status OwnServer::start() {
  const auto port_file = folder_ / "port";
  std::error_code ignored;
  std::filesystem::remove(port_file, ignored);
  process_ = std::make_unique<Process>(
      server_,
      std::vector<std::string>{"--data", data(), "--listen", "127.0.0.1:" + std::to_string(port_),
                               "--port-file", port_file, "--log-level", "warning"},
      log());
  std::string text;
  const bool up = eventually(
      [&] {
        auto file = readWholeFile(port_file);
        if (file.ok()) text = *file;
        return !text.empty() || process_->wait(0ms).has_value();
      },
      60s);
  if (!up || text.empty()) return failed("the server did not start");
  port_ = static_cast<std::uint16_t>(std::stoi(text));
  return {};
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
  static_cast<void>(process_->wait(10s));
}

Status OwnServer::stop() {
  if (!process_) return {};
  if (const auto last = sample()) earlier_cpu_s_ += last->cpu_s;
  process_->signal(SIGTERM);
  const auto code = process_->wait(60s);
  if (code == 0) return {};
  const Error error = failed(code ? "the server ended with " + std::to_string(*code)
                                  : std::string("the server did not end within 60 s"));
  process_.reset();
  return error;
}

}  // namespace needlelab::test
