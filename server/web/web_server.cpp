#include "server/web/web_server.h"

#include <fmt/core.h>
#include <sodium.h>

#include <array>
#include <fstream>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>

#include "common/base/files/files.h"
#include "common/base/time/clock.h"
#include "server/base/listen.h"
#include "server/base/log.h"
#include "server/live/counters.h"
#include "server/live/limits/server_limits.h"
#include "server/live/login/login_state.h"
#include "server/live/work/turn_queue.h"
#include "server/web/routes.h"

namespace needlelab {
namespace {

/// PREFIX/share/needlelab/web for an installed program (in PREFIX/bin), otherwise in the source tree (of
/// build/PRESET/bin).
std::filesystem::path defaultWebRoot() {
  std::error_code error;
  const auto folder = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
  const auto installed = folder.parent_path() / "share/needlelab/web";
  if (std::filesystem::is_directory(installed, error)) return installed;
  return folder.parent_path().parent_path().parent_path() / "client/web";
}

/// Whether a route at this address accepts a body.
bool mayHaveBody(std::string_view method, std::string_view target) {
  const auto parsed = parseTarget(target);
  if (!parsed || parsed->segments.size() < 2 || parsed->segments[0] != "api" || parsed->segments[1] != "v1")
    return false;
  const WebMatch match = matchRoute(method, std::span(parsed->segments).subspan(2));
  // log-in bodies are short, even if the browser already has a session
  return match.route != nullptr && acceptsBody(*match.route) && match.route->how.action != WebAction::kLogIn;
}

/// Separate kinds, so that successful requests do not hide refused or failed ones.
PeerLineKind lineOf(const HttpRequest& request, unsigned status) {
  if (request.route == "file") return PeerLine::kWebFile;
  if (request.who.empty()) return PeerLine::kWebRequestOfStranger;
  if (status < 400) return PeerLine::kWebRequestDone;
  if (status == 403) return PeerLine::kWebRequestForbidden;
  return status < 500 ? PeerLine::kWebRequestRefused : PeerLine::kWebRequestFailed;
}

}  // namespace

Result<std::shared_ptr<WebServer>> WebServer::start(ServerContext& context, TlsContext tls,
                                                    WebSettings settings) {
  ASSIGN_OR_RETURN(const auto endpoint, resolveListen(settings.listen, "--web"));
  const bool chosen = !settings.root.empty();
  if (!chosen) settings.root = defaultWebRoot();
  ASSIGN_OR_RETURN(auto proxies, TrustedProxies::parse(settings.proxies, settings.proxy_header));
  auto files = StaticFiles::load(settings.root);
  if (!files.ok()) return files.error();
  if (files->size() == 0) {
    const std::string fault = settings.root.string() + " has no files of the console";
    if (chosen) return Error{ErrorCode::kInvalidInput, "--web-root: " + fault};
    logEvent(LogLevel::kWarning, "web_without_console", {{"text", fault}});
  }
  ASSIGN_OR_RETURN(auto acceptor, listenOn(context.io, endpoint, settings.listen, "--web"));
  std::shared_ptr<WebServer> server(new WebServer(context, std::move(tls), std::move(settings),
                                                  std::move(proxies), std::move(*files),
                                                  std::move(acceptor)));
  if (const auto& file = server->settings_.port_file; !file.empty()) {
    const std::string text = fmt::format("{}\n", server->port());
    RETURN_IF_ERROR(writeFileAtomically(file, viewOf(text), 0644));
  }
  logEvent(LogLevel::kInfo, "web",
           {{"address", endpoint.address().to_string()},
            {"port", server->port()},
            {"root", server->settings_.root.string()},
            {"files", server->files_.size()}});
  server->beginAccepting();
  return server;
}

WebServer::WebServer(ServerContext& context, TlsContext tls, WebSettings settings, TrustedProxies proxies,
                     StaticFiles files, Tcp::acceptor acceptor)
    : HttpServer(context.io, std::move(acceptor), std::move(tls), settings),
      context_(context),
      settings_(std::move(settings)),
      proxies_(std::move(proxies)),
      files_(std::move(files)),
      sessions_(*context.logins.state),
      admission_(settings_.admission),
      board_(std::make_shared<LiveBoard>(context, settings_.live_period)) {}

bool WebServer::admit(std::uint64_t id, const Tcp::endpoint& peer) {
  const std::string host = peer.address().to_string();
  const bool from_proxy = proxies_.trusts(host);
  const auto arrival =
      from_proxy ? admission_.arriveFromProxy(id) : admission_.arrive(id, host, steadyNowNs());
  if (arrival.answer != Admission::Answer::kWelcome) {
    ++context_.web.connections_refused;
    return false;
  }
  if (arrival.displaced) cut(*arrival.displaced);
  ++context_.web.connections;
  ++context_.web.connections_open;
  return true;
}

void WebServer::left(std::uint64_t id) {
  admission_.left(id);
  --context_.web.connections_open;
}

void WebServer::handshakeFailed() {
  ++context_.web.handshakes_failed;
}

std::optional<HttpAnswer> WebServer::unreadable(const boost::system::error_code& error) {
  return unreadableAnswer(error);
}

std::size_t WebServer::bodyLimit(std::string_view method, std::string_view target,
                                 const std::string& cookie) const {
  const bool wanted = mayHaveBody(method, target) && sessions_.mayBeSession(cookie);
  return wanted ? settings_.body_bytes : settings_.small_body_bytes;
}

const HttpHeaders& WebServer::commonHeaders() const {
  // permit only this server's own files and data; no other page may frame it or get its address
  static const HttpHeaders headers = {
      {"Content-Security-Policy",
       "default-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'; object-src 'none'"},
      {"X-Content-Type-Options", "nosniff"},
      {"Referrer-Policy", "no-referrer"},
      {"Cross-Origin-Resource-Policy", "same-origin"},
      {"Cross-Origin-Opener-Policy", "same-origin"},
  };
  return headers;
}

void WebServer::answered(const HttpExchange& exchange) {
  const HttpRequest& request = exchange.request;
  WebCounters& web = context_.web;
  ++web.requests[request.route][exchange.status];
  web.latency_sum_s += exchange.seconds;
  std::size_t bucket = 0;
  while (bucket < WebCounters::kLatency_s.size() && exchange.seconds > WebCounters::kLatency_s[bucket])
    ++bucket;
  ++web.latency[bucket];
  // logs neither query nor headers, which may contain searched names, cookies and tokens
  const std::string path = request.method == "?" ? "?" : pathForLog(request.target, request.route);
  note(request.who, lineOf(request, exchange.status),
       {{"conn", request.connection},
        {"peer", request.address},
        {"who", request.who},
        {"method", request.method},
        {"path", path},
        {"status", exchange.status},
        {"ms", static_cast<std::int64_t>(exchange.seconds * 1000)},
        {"sent", exchange.sent ? "yes" : "no"}});
  if (!request.refused_for.empty())
    note(request.who, PeerLine::kWebRequestForbidden,
         {{"conn", request.connection}, {"status", exchange.status}, {"text", request.refused_for}});
}

void WebServer::streamFailed(const HttpRequest& request, const Error& error) {
  note(request.who, PeerLine::kWebStreamFailed,
       {{"conn", request.connection}, {"who", request.who}, {"text", error.message}});
}

void WebServer::note(const std::string& who, const PeerLineKind& kind,
                     std::initializer_list<LogField> fields) {
  // `who` is always a person: stations do not use this port
  const std::string owner = who.empty() ? PeerLines::kStrangers : turnNameOf({.name = who});
  context_.limits.lines.write(owner, kind, steadyNowNs(), fields);
}

bool WebServer::showedSession(std::uint64_t id, const std::string& who) {
  const auto arrival = admission_.loggedIn(id, {.name = who, .station = false}, steadyNowNs());
  if (arrival.answer != Admission::Answer::kWelcome) {
    ++context_.web.connections_refused;
    return false;
  }
  if (arrival.displaced) {
    note(who, PeerLine::kConnectionDisplaced, {{"port", "web"}, {"conn", *arrival.displaced}, {"to", who}});
    cut(*arrival.displaced);
  }
  return true;
}

bool WebServer::onViewerJoined(const std::string& who) {
  std::size_t& here = viewers_[who];
  if (all_viewers_ >= settings_.live_sockets || here >= settings_.live_sockets_per_person) {
    if (here == 0) viewers_.erase(who);
    return false;
  }
  ++here;
  ++all_viewers_;
  return true;
}

void WebServer::onViewerLeft(const std::string& who) {
  --all_viewers_;
  if (const auto here = viewers_.find(who); --here->second == 0) viewers_.erase(here);
}

void WebServer::stop() {
  HttpServer::stop();
  board_->stop();
}

void WebServer::cutAll(const std::string& reason) {
  if (!idle()) logEvent(LogLevel::kWarning, "web_cut", {{"connections", connections()}, {"text", reason}});
  cut();
}

namespace {

constexpr std::size_t kMaxFiles = 1000;
constexpr std::uintmax_t kMostBytes = 16u << 20;

constexpr std::array<std::pair<std::string_view, std::string_view>, 10> kWebTypes = {{
    {".html", "text/html; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".mjs", "text/javascript; charset=utf-8"},
    {".json", "application/json"},
    {".svg", "image/svg+xml"},
    {".png", "image/png"},
    {".ico", "image/x-icon"},
    {".woff2", "font/woff2"},
    {".txt", "text/plain; charset=utf-8"},
}};

std::string_view typeOfFile(const std::filesystem::path& path) {
  const std::string ending = path.extension().string();
  for (const auto& [known, type] : kWebTypes) {
    if (ending == known) return type;
  }
  return {};
}

bool isHidden(const std::filesystem::path& relative) {
  for (const auto& part : relative) {
    const std::string name = part.string();
    if (name.empty() || name.front() == '.' || name.front() == '_') return true;
  }
  return false;
}

std::string etagOf(const std::string& body) {
  std::array<unsigned char, 16> hash{};
  crypto_generichash(hash.data(), hash.size(), reinterpret_cast<const unsigned char*>(body.data()),
                     body.size(), nullptr, 0);
  std::array<char, 2 * hash.size() + 1> hex{};
  sodium_bin2hex(hex.data(), hex.size(), hash.data(), hash.size());
  return "\"" + std::string(hex.data()) + "\"";
}

Error fileFault(const std::filesystem::path& folder, const std::string& text) {
  return {ErrorCode::kInvalidInput, "--web-root " + folder.string() + ": " + text};
}

}  // namespace

Result<StaticFiles> StaticFiles::load(const std::filesystem::path& folder) {
  StaticFiles all;
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error)) return all;
  std::uintmax_t bytes = 0;
  std::filesystem::recursive_directory_iterator walk(folder, error), end;
  if (error) return fileFault(folder, error.message());
  for (; walk != end; walk.increment(error)) {
    if (error) return fileFault(folder, error.message());
    const auto relative = walk->path().lexically_relative(folder);
    // a link could lead out of the folder
    if (walk->is_symlink(error) || !walk->is_regular_file(error) || isHidden(relative)) continue;
    const std::string_view type = typeOfFile(relative);
    if (type.empty()) continue;
    bytes += walk->file_size(error);
    if (bytes > kMostBytes || all.files_.size() >= kMaxFiles)
      return fileFault(folder, "has more than 1000 files or 16 MiB: is this the console's folder?");
    std::ifstream file(walk->path(), std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    if (!file) return fileFault(folder, "cannot read " + walk->path().string());
    auto body = std::make_shared<const std::string>(std::move(text).str());
    std::string etag = etagOf(*body);
    all.files_["/" + relative.generic_string()] = {std::string(type), std::move(etag), std::move(body)};
  }
  return all;
}

const StaticFile* StaticFiles::find(const std::string& path) const {
  const auto found = files_.find(path == "/" ? "/index.html" : path);
  return found == files_.end() ? nullptr : &found->second;
}

}  // namespace needlelab
