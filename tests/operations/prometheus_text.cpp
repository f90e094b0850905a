#include "tests/operations/prometheus_text.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <regex.h>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <set>
#include <sstream>

namespace needlelab::test {
namespace {

/// Matches a whole line. Returns the groups from 1 on, or nothing if the line does not match.
std::vector<std::string> match(const char* pattern, const std::string& line) {
  regex_t compiled;
  if (::regcomp(&compiled, pattern, REG_EXTENDED) != 0) return {};
  std::vector<regmatch_t> found(compiled.re_nsub + 1);
  std::vector<std::string> groups;
  if (::regexec(&compiled, line.c_str(), found.size(), found.data(), 0) == 0) {
    for (const regmatch_t& at : found)
      groups.push_back(at.rm_so < 0 ? std::string()
                                    : line.substr(static_cast<std::size_t>(at.rm_so),
                                                  static_cast<std::size_t>(at.rm_eo - at.rm_so)));
  }
  ::regfree(&compiled);
  return groups;
}

/// Returns the metric of a sample: a histogram's samples have name suffixes.
std::string metricOf(const std::string& sample, const std::map<std::string, std::string>& types) {
  for (const char* ending : {"_bucket", "_sum", "_count"}) {
    if (!sample.ends_with(ending)) continue;
    const std::string stem = sample.substr(0, sample.size() - std::string(ending).size());
    const auto found = types.find(stem);
    if (found != types.end() && found->second == "histogram") return stem;
  }
  return sample;
}

}  // namespace

double Scrape::operator[](const std::string& name) const {
  const auto found = samples.find(name);
  return found == samples.end() ? std::numeric_limits<double>::quiet_NaN() : found->second;
}

Scrape parsePrometheus(const std::string& text) {
  Scrape scrape;
  const auto fault = [&](const std::string& line, const char* why) {
    scrape.faults.push_back(why + (": " + line));
  };
  if (text.empty() || text.back() != '\n') scrape.faults.emplace_back("the last line has no end");
  std::istringstream lines(text);
  std::string helped, current;
  std::set<std::string> ended;  // the lines of a metric must be consecutive
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("# HELP ")) {
      const auto parts = match("^# HELP ([a-zA-Z_:][a-zA-Z0-9_:]*) .+$", line);
      if (parts.empty()) {
        fault(line, "no HELP line");
      } else {
        helped = parts[1];
      }
    } else if (line.starts_with("# TYPE ")) {
      const auto parts =
          match("^# TYPE ([a-zA-Z_:][a-zA-Z0-9_:]*) (counter|gauge|histogram|summary|untyped)$", line);
      if (parts.empty()) {
        fault(line, "no TYPE line");
        continue;
      }
      if (parts[1] != helped) fault(line, "TYPE without its HELP before it");
      if (!current.empty()) ended.insert(current);
      current = parts[1];
      if (ended.count(current) != 0 || scrape.types.count(current) != 0) fault(line, "a metric begun twice");
      scrape.types[current] = parts[2];
      if (parts[2] == "counter" && !current.ends_with("_total")) fault(line, "a counter without _total");
    } else {
      const auto parts = match(
          "^([a-zA-Z_:][a-zA-Z0-9_:]*)(\\{([a-zA-Z_][a-zA-Z0-9_]*=\"([^\"\\\\]|\\\\[\\\\n\"])*\",?)+\\})? "
          "([+-]?(Inf|[0-9]+(\\.[0-9]+)?([eE][+-]?[0-9]+)?)|NaN)$",
          line);
      if (parts.empty()) {
        fault(line, "no sample");
        continue;
      }
      if (metricOf(parts[1], scrape.types) != current) fault(line, "a sample outside its metric");
      const std::string name = parts[1] + parts[2];
      if (scrape.samples.count(name) != 0) fault(line, "a sample twice");
      scrape.samples[name] = std::strtod(parts[5].c_str(), nullptr);
    }
  }
  // A histogram's buckets never decrease, and the last one equals the count.
  for (const auto& [name, type] : scrape.types) {
    if (type != "histogram") continue;
    std::map<double, double> buckets;
    for (const auto& [sample, value] : scrape.samples) {
      const auto parts = match("\\{le=\"([^\"]*)\"\\}$", sample);
      if (sample.starts_with(name + "_bucket{") && !parts.empty())
        buckets[parts[1] == "+Inf" ? HUGE_VAL : std::strtod(parts[1].c_str(), nullptr)] = value;
    }
    double before = 0;
    for (const auto& [bound, value] : buckets) {
      if (value < before) fault(name, "a histogram's buckets fall");
      before = value;
    }
    if (buckets.empty() || !std::isinf(buckets.rbegin()->first) || before != scrape[name + "_count"] ||
        std::isnan(scrape[name + "_sum"]))
      fault(name, "a histogram that is not whole");
  }
  return scrape;
}

HttpReply httpSend(std::uint16_t port, const std::string& bytes, std::chrono::milliseconds limit) {
  HttpReply reply;
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::string answer;
  const bool connected =
      fd >= 0 && ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  const bool sent = connected && ::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL) >= 0;
  reply.ended = connected && !sent;
  if (sent) {
    const auto end = std::chrono::steady_clock::now() + limit;
    for (;;) {
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
      pollfd readable{fd, POLLIN, 0};
      if (left.count() <= 0 || ::poll(&readable, 1, static_cast<int>(left.count())) <= 0) break;
      char buffer[4096];
      const ssize_t got = ::recv(fd, buffer, sizeof buffer, 0);
      reply.ended = got <= 0;
      if (reply.ended) break;
      answer.append(buffer, static_cast<std::size_t>(got));
    }
  }
  if (fd >= 0) ::close(fd);
  const auto split = answer.find("\r\n\r\n");
  if (split != std::string::npos && answer.starts_with("HTTP/1.1 ")) {
    reply.status = std::atoi(answer.c_str() + 9);
    reply.head = answer.substr(0, split);
    reply.body = answer.substr(split + 4);
  }
  return reply;
}

HttpReply httpGet(std::uint16_t port, const std::string& path) {
  return httpSend(port, "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
}

}  // namespace needlelab::test
