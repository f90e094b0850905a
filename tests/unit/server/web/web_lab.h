/// A running server with its port for browsers, and users with every role.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <regex>
#include <string>

#include "server/web/routes.h"
#include "tests/unit/server/live/running_server.h"
#include "tests/unit/server/web/browser.h"
#include "tests/unit/server/web/json_schema.h"

namespace needlelab::test {

inline constexpr const char* kWebPassword = "correct horse battery";

class WebLab {
 public:
  explicit WebLab(std::function<void(ServerOptions&)> tweak = {})
      : server_([this, tweak = std::move(tweak)](ServerOptions& options) {
          std::filesystem::create_directories(files_.path() / "app");
          std::ofstream(files_.path() / "index.html") << "<!doctype html><title>needlelab</title>";
          std::ofstream(files_.path() / "app" / "main.js") << "export const one = 1;\n";
          options.web.listen = "127.0.0.1:0";
          options.web.root = files_.path();
          // other timeouts must not end it first
          options.web.handshake_timeout = options.web.header_timeout = options.web.idle_timeout =
              options.web.body_timeout = std::chrono::hours(1);
          if (tweak) tweak(options);
        }) {
    server_.addUser("tina", pb::TRAINEE, kWebPassword);
    server_.addUser("ines", pb::INSTRUCTOR, kWebPassword);
    server_.addUser("mara", pb::CURRICULUM_MANAGER, kWebPassword);
    server_.addUser("rhea", pb::RESEARCHER, kWebPassword);
    server_.addUser("ada", pb::ADMINISTRATOR, kWebPassword);
  }

  RunningServer& server() { return server_; }
  [[nodiscard]] std::uint16_t port() { return server_.server().webPort(); }
  Browser browser() { return Browser(port()); }
  Browser browserOf(const std::string& name) {
    Browser browser(port());
    const WebReply reply = browser.logIn(name, kWebPassword);
    EXPECT_EQ(reply.status, 200) << reply.body;
    return browser;
  }

  /// Adds a session of tina's that a station recorded and closed. Returns its id as text.
  std::string recorded(std::uint64_t chunks, const std::string& profile_json = "{}") {
    if (station_key_.empty()) station_key_ = server_.addStation("bench");
    pb::Login login;
    login.mutable_station()->set_station("bench");
    login.mutable_station()->set_key(station_key_);
    auto station = server_.connect(login);
    if (!station.ok()) throw std::runtime_error(station.error().message);
    const FakeSession session("bench");
    (void)station->send(session.open(profile_json));
    (void)waitFor(*station, [](const pb::Envelope& e) { return e.has_session_opened(); });
    for (std::uint64_t seq = 0; seq < chunks; ++seq) {
      (void)station->send(session.chunk(seq));
      if (seq % 50 == 49 || seq + 1 == chunks) session.waitForAck(*station, seq + 1);
    }
    (void)station->send(session.close(chunks));
    (void)waitFor(*station, [](const pb::Envelope& e) { return e.has_session_closed(); });
    Uuid id;
    std::copy(session.id().begin(), session.id().end(), id.begin());
    return uuidText(id);
  }
  std::string stationKey() {
    if (station_key_.empty()) station_key_ = server_.addStation("bench");
    return station_key_;
  }

 private:
  TempFolder files_;
  RunningServer server_;
  std::string station_key_;
};

/// Checks that a JSON reply of the API fits its description, and returns the reply.
inline WebReply fits(const std::string& method, const std::string& path, WebReply reply) {
  static const nlohmann::json api = nlohmann::json::parse(openApiText());
  if (!path.starts_with(kApiBase)) return reply;
  std::vector<std::string> parts;
  std::string below = path.substr(kApiBase.size(), path.find('?') - kApiBase.size());
  for (std::size_t at = 0; at < below.size();) {
    const std::size_t end = std::min(below.find('/', at + 1), below.size());
    parts.push_back(below.substr(at + 1, end - at - 1));
    at = end;
  }
  const WebMatch match = matchRoute(method, parts);
  const nlohmann::json schema = match.route == nullptr
                                    ? api["components"]["schemas"]["Refused"]
                                    : replySchema(api, std::string(match.route->method),
                                                  std::string(match.route->pattern), reply.status);
  const bool is_json = reply.header("content-type") == "application/json";
  if (!is_json || method == "HEAD") return reply;
  EXPECT_FALSE(schema.is_null()) << method << " " << path << ": " << reply.status << " is not described";
  if (!schema.is_null()) {
    EXPECT_EQ(schemaFault(schema, reply.json(), api), "")
        << method << " " << path << ": " << reply.body.substr(0, 300);
  }
  return reply;
}
/// Whether a message has no id, enumerator or long number: each message of a handler that a test provokes is
/// shown to a person (common/base/text/plain_words.h). Names of fields are the console's to translate.
inline void expectPlain(const std::string& asked, const WebReply& reply) {
  if (reply.status < 400 || !reply.json().contains("error")) return;
  const std::string message = reply.json()["error"].value("message", "");
  static const std::regex kRaw("[0-9a-f]{8}-[0-9a-f]{4}-|[A-Z]{2,}_[A-Z]|\\d\\.\\d{7}|\\d{10}");
  EXPECT_FALSE(std::regex_search(message, kRaw)) << asked << ": " << message;
}

inline WebReply askChecked(Browser& browser, const std::string& method, const std::string& path,
                           const std::string& body = {}, WebHeaders headers = {}) {
  WebReply reply = fits(method, path, browser.ask(method, path, body, std::move(headers)));
  expectPlain(method + " " + path, reply);
  return reply;
}

}  // namespace needlelab::test
