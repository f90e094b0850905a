#include "tests/load/postgres_cost.h"

#include <sys/types.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

namespace needlelab::test {
namespace {

// proc(5), /proc/PID/stat: the fields from "state" on, the 3rd one; empty when there is no such process, or
// it is none of PostgreSQL
std::vector<std::string> statOf(std::int64_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  const auto end = text.rfind(')');
  if (end == std::string::npos || text.find("(postgres)") == std::string::npos) return {};
  std::istringstream fields(text.substr(end + 1));
  return {std::istream_iterator<std::string>(fields), {}};
}

double seconds(const std::vector<std::string>& stat, int first, int last) {
  double ticks = 0;
  for (int field = first; field <= last; ++field)
    if (const auto at = static_cast<std::size_t>(field - 3); at < stat.size()) ticks += std::stod(stat[at]);
  return ticks / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

// a connection's process is a child of the server's first one, as are all others
std::optional<double> cpuOf(std::int64_t backend) {
  constexpr int kParent = 4, kUser = 14, kSystem = 15, kSystemOfEnded = 17;
  const auto stat = statOf(backend);
  if (stat.size() < 15) return std::nullopt;
  const std::string parent = stat[kParent - 3];
  const auto first = statOf(std::stoll(parent));
  if (first.empty()) return std::nullopt;
  double cpu_s = seconds(first, kUser, kSystemOfEnded);
  std::ifstream children("/proc/" + parent + "/task/" + parent + "/children");
  for (std::int64_t child = 0; children >> child;) cpu_s += seconds(statOf(child), kUser, kSystem);
  return cpu_s;
}

}  // namespace

Result<PostgresCost> postgresCost(Connection& connection) {
  auto query = connection.prepare(
      "SELECT pg_backend_pid(), CAST(pg_wal_lsn_diff(pg_current_wal_insert_lsn(), '0/0') AS BIGINT),"
      " pg_database_size(current_database())");
  ASSIGN_OR_RETURN(const bool there, query.step());
  if (!there) return Error{ErrorCode::kFailed, "PostgreSQL does not say its process and sizes"};
  return PostgresCost{cpuOf(query.integer(0)), query.natural(1), query.natural(2)};
}

}  // namespace needlelab::test
