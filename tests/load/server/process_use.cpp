#include "tests/load/server/process_use.h"

#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vector>

#include "common/base/files/files.h"

namespace needlelab::test {
namespace {

template <typename T>
std::optional<T> difference(const std::optional<T>& begin, const std::optional<T>& end) {
  return begin && end && *end >= *begin ? std::optional<T>(*end - *begin) : std::nullopt;
}

template <typename T>
void add(std::optional<T>& sum, const std::optional<T>& value) {
  if (sum && value) *sum += *value;
}

std::string procFolder(pid_t pid) {
  return "/proc/" + std::to_string(pid);
}

// /proc/PID/stat after the name, from the state on; empty: no such process
std::string statOf(pid_t pid, std::string_view name = {}) {
  std::ifstream file(procFolder(pid) + "/stat");
  // if a process ends meanwhile, reading fails, which an iterator would report by throwing
  std::ostringstream whole;
  whole << file.rdbuf();
  const std::string text = whole.str();
  // the name is in brackets and may contain anything
  const auto end = text.rfind(')');
  if (end == std::string::npos || text.find(name) == std::string::npos) return {};
  return text.substr(end + 1);
}

// proc(5), /proc/PID/stat: 14 and 15 are its own user and system time, 16 and 17 those of children that ended
std::optional<double> cpuOf(pid_t pid, int last) {
  std::istringstream fields(statOf(pid));
  if (fields.str().empty()) return std::nullopt;
  std::string field;
  double ticks = 0;
  for (int number = 3; number <= last && fields >> field; ++number)
    if (number >= 14) ticks += std::stod(field);
  return ticks / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

// includes children that were waited for; only the owner and root may read it
std::optional<std::uint64_t> writtenBy(pid_t pid) {
  std::ifstream file(procFolder(pid) + "/io");
  std::string key;
  for (std::uint64_t bytes = 0; file >> key >> bytes;)
    if (key == "write_bytes:") return bytes;
  return std::nullopt;
}

// nothing: no such process, or not one of PostgreSQL's
std::optional<pid_t> postgresParentOf(std::int64_t pid) {
  std::istringstream fields(statOf(static_cast<pid_t>(pid), "(postgres)"));
  std::string state;
  pid_t parent = 0;
  return fields >> state >> parent ? std::optional(parent) : std::nullopt;
}

std::optional<std::uint64_t> sumOf(const Scrape& scrape, std::initializer_list<const char*> names) {
  std::uint64_t sum = 0;
  for (const char* name : names) {
    const double value = scrape[name];
    if (!std::isfinite(value) || value < 0) return std::nullopt;
    sum += static_cast<std::uint64_t>(value);
  }
  return sum;
}

}  // namespace

ProcessUse useBetween(const ProcessUse& begin, const ProcessUse& end) {
  return {.name = end.name,
          .cpu_s = difference(begin.cpu_s, end.cpu_s),
          .disk_bytes = difference(begin.disk_bytes, end.disk_bytes),
          .log_bytes = difference(begin.log_bytes, end.log_bytes),
          .sent_bytes = difference(begin.sent_bytes, end.sent_bytes),
          .received_bytes = difference(begin.received_bytes, end.received_bytes),
          .messages_out = difference(begin.messages_out, end.messages_out),
          .messages_in = difference(begin.messages_in, end.messages_in)};
}

ProcessUse useOf(pid_t pid) {
  ProcessUse use;
  use.cpu_s = cpuOf(pid, 15);
  use.disk_bytes = writtenBy(pid);
  return use;
}

ProcessUse useWithChildren(pid_t pid) {
  ProcessUse use;
  use.cpu_s = cpuOf(pid, 17);
  use.disk_bytes = writtenBy(pid);
  std::ifstream children(procFolder(pid) + "/task/" + std::to_string(pid) + "/children");
  for (pid_t child = 0; children >> child;) {
    add(use.cpu_s, cpuOf(child, 17));
    add(use.disk_bytes, writtenBy(child));
  }
  return use;
}

void addScrape(ProcessUse& use, const Scrape& scrape) {
  use.sent_bytes = sumOf(scrape, {"needlelab_sent_bytes_total"});
  use.received_bytes = sumOf(scrape, {"needlelab_received_bytes_total"});
  // a server that is alone has no link
  add(use.sent_bytes, sumOf(scrape, {"needlelab_live_link_bytes_total{direction=\"out\"}"}));
  add(use.received_bytes, sumOf(scrape, {"needlelab_live_link_bytes_total{direction=\"in\"}"}));
  use.messages_out = sumOf(scrape, {"needlelab_acks_total", "needlelab_live_frames_sent_total"});
  use.messages_in = sumOf(scrape, {"needlelab_messages_parsed_total{thread=\"network\"}",
                                   "needlelab_messages_parsed_total{thread=\"parsers\"}",
                                   "needlelab_live_frames_received_total"});
}

void addVarz(ProcessUse& use, std::string_view text) {
  const auto json = nlohmann::json::parse(text, nullptr, false);
  const auto number = [&](const char* key) -> std::optional<std::uint64_t> {
    if (!json.is_object() || !json.contains(key) || !json[key].is_number_integer()) return std::nullopt;
    return json[key].get<std::uint64_t>();
  };
  // from NATS's point of view: incoming messages were published
  use.messages_in = number("in_msgs");
  use.messages_out = number("out_msgs");
  use.received_bytes = number("in_bytes");
  use.sent_bytes = number("out_bytes");
}

Result<PostgresUse> postgresUse(Connection& connection) {
  auto query = connection.prepare(
      "SELECT pg_backend_pid(), CAST(pg_wal_lsn_diff(pg_current_wal_insert_lsn(), '0/0') AS BIGINT),"
      " pg_database_size(current_database()),"
      " (SELECT CAST(coalesce(sum(pg_wal_lsn_diff(sent_lsn, '0/0')), 0) AS BIGINT) FROM "
      "pg_stat_replication)");
  ASSIGN_OR_RETURN(const bool there, query.step());
  if (!there) return Error{ErrorCode::kFailed, "PostgreSQL does not say its process and sizes"};
  PostgresUse found;
  // a connection's process is a child of the postmaster, like all others
  if (const auto first = postgresParentOf(query.integer(0)); first && postgresParentOf(*first))
    found.use = useWithChildren(*first);
  found.use.name = "PostgreSQL";
  found.use.log_bytes = query.natural(1);
  if (const std::uint64_t sent = query.natural(3); sent > 0) found.use.sent_bytes = sent;
  found.database_bytes = query.natural(2);
  return found;
}

Result<ProcessUse> standbyUse(const std::filesystem::path& pid_file) {
  ASSIGN_OR_RETURN(const std::string text, readWholeFile(pid_file));
  const long first = std::strtol(text.c_str(), nullptr, 10);
  if (!postgresParentOf(first))
    return Error{ErrorCode::kInvalidInput,
                 pid_file.string() + ": names no process of PostgreSQL that runs on this computer"};
  ProcessUse use = useWithChildren(static_cast<pid_t>(first));
  use.name = "standby";
  return use;
}

}  // namespace needlelab::test
