/// The port for browsers: HTTP/1.1 over TLS 1.3, the console's files, the API and the live socket.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <unordered_map>

#include "common/base/result.h"
#include "common/wire/tls.h"
#include "server/live/context.h"
#include "server/live/door.h"
#include "server/web/live_board.h"
#include "server/web/static_files.h"
#include "server/web/web_session.h"

namespace needlelab {

struct WebSettings {
  std::string listen;               ///< HOST:PORT; empty or "off": no such port
  std::filesystem::path port_file;  ///< written after listening; empty: none
  std::filesystem::path root;       ///< of the console's files; empty: where they were built or installed

  std::size_t header_bytes = 8u << 10;
  std::size_t body_bytes = 1u << 20;
  std::size_t stranger_body_bytes = 4u << 10;  ///< before log-in
  std::size_t requests_per_connection = 1000;
  std::chrono::milliseconds handshake_timeout{10'000};
  std::chrono::milliseconds idle_timeout{60'000};    ///< between two requests
  std::chrono::milliseconds header_timeout{10'000};  ///< from its first byte to its last, however it drips
  std::chrono::milliseconds body_timeout{30'000};
  std::chrono::milliseconds write_timeout{30'000};  ///< for a reply; of a stream, for a piece
  std::size_t connections_per_address = 256;
  /// of somebody who is logged in; then the one gives way that asked for something the longest time ago
  std::size_t connections_per_person = 64;
  /// connections that have not shown a session yet give way as on the other port
  Door::Settings door{.max_connections = 512, .max_strangers = 256, .charges_at_once = 512};

  std::chrono::milliseconds live_period{200};
  std::size_t live_sockets = 64;
  std::size_t live_sockets_per_person = 8;
  std::chrono::milliseconds live_write_timeout{5'000};  ///< who has not taken a message by then is cut
};

class WebConnection;

/// What its connections share. Thread: the network's. Ownership: kept alive by its coroutines; the context
/// must outlive them.
class WebServer : public std::enable_shared_from_this<WebServer> {
 public:
  /// Reads the files, listens, writes the port file; serves once the io_context runs. Errors: kInvalidInput
  /// (options), kUnavailable (port taken).
  static Result<std::shared_ptr<WebServer>> start(ServerContext& context, TlsContext tls,
                                                  WebSettings settings);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  /// Takes no more connections or requests; what is at work ends. May be repeated.
  void stop();
  /// Cuts what is left.
  void cut(const std::string& reason);
  [[nodiscard]] bool idle() const { return connections_.empty(); }
  [[nodiscard]] std::uint16_t port() const { return port_; }

  // --- for its connections
  [[nodiscard]] ServerContext& context() { return context_; }
  [[nodiscard]] const WebSettings& settings() const { return settings_; }
  [[nodiscard]] const StaticFiles& files() const { return files_; }
  [[nodiscard]] WebSessions& sessions() { return sessions_; }
  [[nodiscard]] const TlsContext& tls() const { return tls_; }
  [[nodiscard]] bool stopping() const { return stopping_; }
  [[nodiscard]] LiveBoard& board() { return *board_; }
  /// False: there are too many viewers, of all or of this person. Each true is followed by one viewerLeft.
  bool viewerCame(const std::string& who);
  void viewerLeft(const std::string& who);
  void left(std::uint64_t id, const std::string& host_key);
  void loggedIn(std::uint64_t id, const std::string& who);

 private:
  WebServer(ServerContext& context, TlsContext tls, WebSettings settings, StaticFiles files,
            Tcp::acceptor acceptor);
  static Task<> acceptLoop(std::shared_ptr<WebServer> self);
  void accepted(Tcp::socket socket);
  void forgetPerson(std::uint64_t id);

  ServerContext& context_;
  const TlsContext tls_;
  const WebSettings settings_;
  const StaticFiles files_;
  WebSessions sessions_;
  Tcp::acceptor acceptor_;
  std::uint16_t port_ = 0;
  Door door_;
  const std::shared_ptr<LiveBoard> board_;
  std::unordered_map<std::string, std::size_t> viewers_;  // by name
  std::size_t all_viewers_ = 0;
  std::unordered_map<std::uint64_t, std::weak_ptr<WebConnection>> connections_;
  std::unordered_map<std::string, std::size_t> by_address_;
  std::unordered_map<std::uint64_t, std::string> person_of_;  // by connection
  std::unordered_map<std::string, std::vector<std::uint64_t>>
      by_person_;  // the one that asked last at the end
  std::uint64_t next_id_ = 1;
  bool stopping_ = false;
};

}  // namespace needlelab
