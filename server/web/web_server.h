/// The port for browsers: HTTP/1.1 over TLS 1.3, the console's files, the API and the live socket.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/base/result.h"
#include "common/wire/tls.h"
#include "server/base/http_server.h"
#include "server/base/log.h"
#include "server/base/trusted_proxies.h"
#include "server/live/context.h"
#include "server/live/limits/admission.h"
#include "server/live/limits/peer_lines.h"
#include "server/web/live_board.h"
#include "server/web/web_call.h"

namespace needlelab {

struct StaticFile {
  std::string type;  ///< Content-Type
  std::string etag;  ///< including its quotes
  std::shared_ptr<const std::string> body;
};

/// Serves requested paths from the files read at the start; a path from the network never reaches the file
/// system. Thread: any, once constructed.
class StaticFiles {
 public:
  /// Loads all regular files of the folder and its subfolders that have a web page's extension and do not
  /// begin with '.' or '_'. A missing folder gives no files. kInvalidInput: more than 16 MiB or 1000 files,
  /// or a file cannot be read.
  static Result<StaticFiles> load(const std::filesystem::path& folder);

  /// Maps "/" to "/index.html". Null for an unknown file.
  [[nodiscard]] const StaticFile* find(const std::string& path) const;
  [[nodiscard]] std::size_t size() const { return files_.size(); }

 private:
  std::map<std::string, StaticFile> files_;  // by path relative to the folder, with a leading '/'
};

/// HttpLimits contains the limits of size and time.
struct WebSettings : HttpLimits {
  std::string listen;               ///< HOST:PORT; empty or "off": the port is disabled
  std::filesystem::path port_file;  ///< written after listening; empty: no file
  std::filesystem::path root;  ///< folder of the console's files; empty: the build or installation folder

  /// Limit before log-in, and for routes without a body, which then refuse it.
  std::size_t small_body_bytes = 4u << 10;
  /// Connections without a valid session are strangers: only these are counted by address, and they are cut
  /// as on the other port. A request with a session counts as use of a connection.
  Admission::Settings admission = kWebAdmission;
  std::vector<std::string> proxies;              ///< trusted_proxies.h
  std::string proxy_header = "X-Forwarded-For";  ///< or "Forwarded"

  std::chrono::milliseconds live_period{200};
  std::size_t live_sockets = 64;
  std::size_t live_sockets_per_person = 8;
  /// A viewer that does not accept a message within this time is cut.
  std::chrono::milliseconds live_write_timeout{5'000};
  /// A viewer that sends nothing for this long, not even an answer to a ping at half of it, is considered
  /// gone.
  std::chrono::milliseconds live_idle_timeout{30'000};
};

/// Thread: the network's. Ownership: kept alive by its coroutines; the context must outlive them.
class WebServer : public HttpServer {
 public:
  /// Reads the files, listens, writes the port file; serves once the io_context runs. Errors: kInvalidInput
  /// (options), kUnavailable (port taken).
  static Result<std::shared_ptr<WebServer>> start(ServerContext& context, TlsContext tls,
                                                  WebSettings settings);

  void stop() override;
  /// Cuts the remaining connections.
  void cutAll(const std::string& reason);
  [[nodiscard]] bool idle() const { return connections() == 0; }

  /// Writes a log line for this person, or for all strangers if `who` is empty.
  void note(const std::string& who, const PeerLineKind& kind, std::initializer_list<LogField> fields);

  /// Answers a request; in web_request.cpp.
  Task<HttpAnswer> answer(std::shared_ptr<HttpRequest> request) override;
  std::optional<HttpAnswer> unreadable(const boost::system::error_code& error) override;
  [[nodiscard]] std::size_t bodyLimit(std::string_view method, std::string_view target,
                                      const std::string& cookie) const override;
  [[nodiscard]] const HttpHeaders& commonHeaders() const override;
  void handshakeFailed() override;
  /// Counts the request in the metrics and logs it (PeerLines).
  void answered(const HttpExchange& exchange) override;
  void streamFailed(const HttpRequest& request, const Error& error) override;

  [[nodiscard]] ServerContext& context() { return context_; }
  [[nodiscard]] const WebSettings& settings() const { return settings_; }
  [[nodiscard]] const StaticFiles& files() const { return files_; }
  [[nodiscard]] WebSessions& sessions() { return sessions_; }
  [[nodiscard]] LiveBoard& board() { return *board_; }
  /// False: too many viewers, in total or for this person. Each true must be followed by one onViewerLeft.
  bool onViewerJoined(const std::string& who);
  void onViewerLeft(const std::string& who);
  /// A connection has sent a request with a valid session of `who`. False: all places are taken by people
  /// with no more connections than this person.
  [[nodiscard]] bool showedSession(std::uint64_t id, const std::string& who);

 protected:
  bool admit(std::uint64_t id, const Tcp::endpoint& peer) override;
  void left(std::uint64_t id) override;

 private:
  WebServer(ServerContext& context, TlsContext tls, WebSettings settings, TrustedProxies proxies,
            StaticFiles files, Tcp::acceptor acceptor);
  Task<HttpAnswer> answerTo(std::shared_ptr<HttpRequest> request);

  ServerContext& context_;
  const WebSettings settings_;
  const TrustedProxies proxies_;
  const StaticFiles files_;
  WebSessions sessions_;
  Admission admission_;
  const std::shared_ptr<LiveBoard> board_;
  std::unordered_map<std::string, std::size_t> viewers_;  // by name
  std::size_t all_viewers_ = 0;
};

// --- the live page's WebSocket: sends a viewer the board whenever it changes

class HttpTakeover;

/// Sends one message at a time to a viewer and skips changes in between, so that nothing queues up. Cuts a
/// viewer that does not accept a message within live_write_timeout. Ends with the viewer's session. Ignores
/// the contents of the viewer's messages; one of more than 4 KiB ends the connection. Calls onViewerLeft at
/// its end. `token`: of the session. Thread: the network's.
std::shared_ptr<HttpTakeover> makeLiveSocket(std::shared_ptr<WebServer> server, std::string token,
                                             std::string who);

}  // namespace needlelab
