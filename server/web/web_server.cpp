#include "server/web/web_server.h"

#include <utility>

#include "common/base/clock.h"
#include "common/base/files.h"
#include "server/live/listen.h"
#include "server/live/log.h"
#include "server/web/web_connection.h"

namespace needlelab {
namespace {

/// Installed beside the program (PREFIX/bin, PREFIX/share/needlelab/web), else where it was built.
std::filesystem::path defaultWebRoot() {
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (!error) {
    const auto installed = program.parent_path().parent_path() / "share/needlelab/web";
    if (std::filesystem::is_directory(installed, error)) return installed;
  }
  return NEEDLELAB_WEB_ROOT;
}

}  // namespace

Result<std::shared_ptr<WebServer>> WebServer::start(ServerContext& context, TlsContext tls,
                                                    WebSettings settings) {
  const auto endpoint = resolveListen(settings.listen, "--web");
  if (!endpoint.ok()) return endpoint.error();
  const bool chosen = !settings.root.empty();
  if (!chosen) settings.root = defaultWebRoot();
  auto files = StaticFiles::load(settings.root);
  if (!files.ok()) return files.error();
  if (files->size() == 0) {
    const std::string words = settings.root.string() + " has no files of the console";
    if (chosen) return Error{ErrorCode::kInvalidInput, "--web-root: " + words};
    logEvent(LogLevel::kWarning, "web_without_console", {{"text", words}});
  }
  auto acceptor = listenOn(context.io, *endpoint, settings.listen, "--web");
  if (!acceptor.ok()) return acceptor.error();
  std::shared_ptr<WebServer> server(
      new WebServer(context, std::move(tls), std::move(settings), std::move(*files), std::move(*acceptor)));
  if (const auto& file = server->settings_.port_file; !file.empty()) {
    const std::string text = std::to_string(server->port_) + "\n";
    if (const Status written = writeFileAtomically(file, viewOf(text)); !written.ok()) return written.error();
  }
  logEvent(LogLevel::kInfo, "web",
           {{"address", endpoint->address().to_string()},
            {"port", server->port_},
            {"root", server->settings_.root.string()},
            {"files", server->files_.size()}});
  asio::co_spawn(context.io, acceptLoop(server), rethrow);
  return server;
}

WebServer::WebServer(ServerContext& context, TlsContext tls, WebSettings settings, StaticFiles files,
                     Tcp::acceptor acceptor)
    : context_(context),
      tls_(std::move(tls)),
      settings_(std::move(settings)),
      files_(std::move(files)),
      sessions_(context.tokens),
      acceptor_(std::move(acceptor)),
      port_(acceptor_.local_endpoint().port()),
      door_(settings_.door),
      board_(std::make_shared<LiveBoard>(context, settings_.live_period)) {}

WebServer::~WebServer() = default;

Task<> WebServer::acceptLoop(std::shared_ptr<WebServer> self) {
  while (!self->stopping_) {
    auto [error, socket] = co_await self->acceptor_.async_accept(kUseTuple);
    if (self->stopping_) co_return;
    if (!error) {
      self->accepted(std::move(socket));
      continue;
    }
    // no file descriptors or the like: it passes
    logEvent(LogLevel::kError, "web_accept_failed", {{"text", error.message()}});
    asio::steady_timer pause(self->context_.io, std::chrono::milliseconds(100));
    co_await pause.async_wait(kUseTuple);
  }
}

void WebServer::accepted(Tcp::socket socket) {
  boost::system::error_code gone;
  const auto peer = socket.remote_endpoint(gone);
  if (gone) return;
  const std::uint64_t id = next_id_++;
  const std::string host = peer.address().to_string(), key = Door::keyOf(host);
  const auto here = by_address_.find(key);
  if (here != by_address_.end() && here->second >= settings_.connections_per_address) {
    ++context_.web.connections_refused;
    return;  // closes it
  }
  const auto arrival = door_.arrive(id, host, steadyNowNs());
  if (arrival.answer != Door::Answer::kWelcome) {
    ++context_.web.connections_refused;
    return;
  }
  if (arrival.gives_way) {
    const auto found = connections_.find(*arrival.gives_way);
    const auto connection = found == connections_.end() ? nullptr : found->second.lock();
    if (connection) connection->cut();
  }
  ++context_.web.connections;
  ++context_.web.connections_open;
  ++by_address_[key];
  const std::string address =
      (peer.address().is_v6() ? "[" + host + "]" : host) + ":" + std::to_string(peer.port());
  auto connection = WebConnection::make(shared_from_this(), id, std::move(socket), address, key);
  connections_.emplace(id, connection);
  asio::co_spawn(context_.io, WebConnection::run(connection), rethrow);
}

void WebServer::left(std::uint64_t id, const std::string& host_key) {
  if (connections_.erase(id) == 0) return;
  door_.left(id);
  forgetPerson(id);
  --context_.web.connections_open;
  if (const auto here = by_address_.find(host_key); --here->second == 0) by_address_.erase(here);
}

void WebServer::loggedIn(std::uint64_t id, const std::string& who) {
  door_.loggedIn(id, steadyNowNs());
  forgetPerson(id);
  person_of_.emplace(id, who);
  std::vector<std::uint64_t>& theirs = by_person_[who];
  theirs.push_back(id);
  if (theirs.size() <= settings_.connections_per_person) return;
  const std::uint64_t idlest = theirs.front();
  forgetPerson(idlest);
  const auto found = connections_.find(idlest);
  if (const auto connection = found == connections_.end() ? nullptr : found->second.lock()) connection->cut();
}

void WebServer::forgetPerson(std::uint64_t id) {
  const auto person = person_of_.find(id);
  if (person == person_of_.end()) return;
  const auto theirs = by_person_.find(person->second);
  std::erase(theirs->second, id);
  if (theirs->second.empty()) by_person_.erase(theirs);
  person_of_.erase(person);
}

bool WebServer::viewerCame(const std::string& who) {
  std::size_t& here = viewers_[who];
  if (all_viewers_ >= settings_.live_sockets || here >= settings_.live_sockets_per_person) {
    if (here == 0) viewers_.erase(who);
    return false;
  }
  ++here;
  ++all_viewers_;
  return true;
}

void WebServer::viewerLeft(const std::string& who) {
  --all_viewers_;
  if (const auto here = viewers_.find(who); --here->second == 0) viewers_.erase(here);
}

void WebServer::stop() {
  if (std::exchange(stopping_, true)) return;
  boost::system::error_code ignored;
  acceptor_.close(ignored);
  const auto all = connections_;
  for (const auto& [id, weak] : all) {
    if (const auto connection = weak.lock()) connection->stop();
  }
  board_->stop();
}

void WebServer::cut(const std::string& reason) {
  const auto all = connections_;
  if (!all.empty()) logEvent(LogLevel::kWarning, "web_cut", {{"connections", all.size()}, {"text", reason}});
  for (const auto& [id, weak] : all) {
    if (const auto connection = weak.lock()) connection->cut();
  }
}

}  // namespace needlelab
