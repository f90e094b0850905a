/// A strict reader of Prometheus' text format, written from its description alone, and a client for HTTP.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace needlelab::test {

/// All samples of a scrape, each under its full name: `name{label="value",…}` with the labels in their order.
struct Scrape {
  std::map<std::string, double> samples;
  std::map<std::string, std::string> types;  ///< by metric
  std::vector<std::string> faults;           ///< violations of the format, by line; empty if well-formed

  /// Returns NaN if the sample is missing.
  [[nodiscard]] double operator[](const std::string& name) const;
};
Scrape parsePrometheus(const std::string& text);

struct HttpReply {
  int status = 0;  ///< 0: the connection ended without an answer
  std::string head, body;
  bool ended = false;  ///< by the server, within the limit
};
/// Sends the bytes to 127.0.0.1 and reads until the server closes, at most `limit`.
HttpReply httpSend(std::uint16_t port, const std::string& bytes,
                   std::chrono::milliseconds limit = std::chrono::seconds(60));
HttpReply httpGet(std::uint16_t port, const std::string& path);

}  // namespace needlelab::test
