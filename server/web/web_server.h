/// The port for browsers: HTTP/1.1 over TLS 1.3, the console's files, the API and the live socket.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/base/result.h"
#include "common/wire/tls.h"
#include "server/base/http_server.h"
#include "server/live/admission.h"
#include "server/live/context.h"
#include "server/web/live_board.h"
#include "server/web/static_files.h"
#include "server/web/web_call.h"

namespace needlelab {

/// The sizes and times of its HTTP are those of HttpLimits.
struct WebSettings : HttpLimits {
  std::string listen;               ///< HOST:PORT; empty or "off": no such port
  std::filesystem::path port_file;  ///< written after listening; empty: none
  std::filesystem::path root;       ///< of the console's files; empty: where they were built or installed

  std::size_t stranger_body_bytes = 4u << 10;  ///< before log-in
  std::size_t connections_per_address = 256;
  /// of somebody who is logged in; then the one gives way that asked for something the longest time ago
  std::size_t connections_per_person = 64;
  /// connections that have not shown a session yet give way as on the other port
  Admission::Settings admission{.max_connections = 512, .max_strangers = 256, .charges_at_once = 512};

  std::chrono::milliseconds live_period{200};
  std::size_t live_sockets = 64;
  std::size_t live_sockets_per_person = 8;
  std::chrono::milliseconds live_write_timeout{5'000};  ///< who has not taken a message by then is cut
};

/// Thread: the network's. Ownership: kept alive by its coroutines; the context must outlive them.
class WebServer : public HttpServer {
 public:
  /// Reads the files, listens, writes the port file; serves once the io_context runs. Errors: kInvalidInput
  /// (options), kUnavailable (port taken).
  static Result<std::shared_ptr<WebServer>> start(ServerContext& context, TlsContext tls,
                                                  WebSettings settings);

  void stop() override;
  /// Cuts the connections that are left.
  void cutAll(const std::string& reason);
  [[nodiscard]] bool idle() const { return connections() == 0; }

  /// web_request.cpp: a request to its answer.
  Task<HttpAnswer> answer(std::shared_ptr<HttpRequest> request) override;
  std::optional<HttpAnswer> unreadable(const boost::system::error_code& error) override;
  [[nodiscard]] std::size_t bodyLimit(const std::string& cookie) const override;
  [[nodiscard]] const HttpHeaders& commonHeaders() const override;
  void handshakeFailed() override;
  /// Counts it for the metrics, and logs it.
  void answered(const HttpExchange& exchange) override;

  [[nodiscard]] ServerContext& context() { return context_; }
  [[nodiscard]] const WebSettings& settings() const { return settings_; }
  [[nodiscard]] const StaticFiles& files() const { return files_; }
  [[nodiscard]] WebSessions& sessions() { return sessions_; }
  [[nodiscard]] LiveBoard& board() { return *board_; }
  /// False: there are too many viewers, of all or of this person. Each true is followed by one viewerLeft.
  bool viewerCame(const std::string& who);
  void viewerLeft(const std::string& who);
  /// A connection has sent a request with a session of `who`.
  void showedSession(std::uint64_t id, const std::string& who);

 protected:
  bool admit(std::uint64_t id, const Tcp::endpoint& peer) override;
  void left(std::uint64_t id) override;

 private:
  WebServer(ServerContext& context, TlsContext tls, WebSettings settings, StaticFiles files,
            Tcp::acceptor acceptor);
  void forgetPerson(std::uint64_t id);

  ServerContext& context_;
  const WebSettings settings_;
  const StaticFiles files_;
  WebSessions sessions_;
  Admission admission_;
  const std::shared_ptr<LiveBoard> board_;
  std::unordered_map<std::string, std::size_t> viewers_;  // by name
  std::size_t all_viewers_ = 0;
  std::unordered_map<std::uint64_t, std::string> address_of_;  // by connection: what admission.h counts it as
  std::unordered_map<std::string, std::size_t> by_address_;
  std::unordered_map<std::uint64_t, std::string> person_of_;  // by connection
  std::unordered_map<std::string, std::vector<std::uint64_t>>
      by_person_;  // the one that asked last at the end
};

}  // namespace needlelab
