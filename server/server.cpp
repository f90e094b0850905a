#include "server/server.h"

#include <fmt/core.h>

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <boost/asio/ip/host_name.hpp>
#include <boost/asio/post.hpp>
#include <csignal>
#include <optional>
#include <utility>

#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "common/base/text/uuid.h"
#include "common/base/time/clock.h"
#include "db/store/schema.h"
#include "server/base/listen.h"
#include "server/base/log.h"
#include "server/live/limits/startup.h"
#include "server/live/port/connection.h"
#include "server/live/port/remote_access.h"
#include "server/live/port/request_effects.h"
#include "server/server_parts.h"
#include "server/service_manager.h"
#include "server/together/logins_in_store.h"

namespace needlelab {
namespace {

constexpr std::chrono::milliseconds kKeepaliveTogether{1'000};

void logThrown(const std::string& text) {
  logEvent(LogLevel::kError, "store_work_failed", {{"text", text}});
}

void logDurability(Durability durability, const std::string& reason) {
  const bool weak = durability < Durability::kPowerCut;
  logEvent(weak ? LogLevel::kWarning : LogLevel::kInfo, "durability",
           {{"text", fmt::format("an ack survives {} ({})", durabilityText(durability), reason)}});
}

}  // namespace

Result<std::unique_ptr<Server>> Server::start(ServerOptions options) {
  ASSIGN_OR_RETURN(auto endpoint, resolveListen(options.listen));
  auto parts = std::make_unique<ServerParts>(std::move(options));
  ServerParts& p = *parts;
  if (LiveServersOptions& live = p.options.live; !live.nats.address.empty()) {
    if (live.name.empty() && p.options.together) {
      ASSIGN_OR_RETURN(live.name, serverNameOf(p.options.data));
    }
    if (live.name.empty()) live.name = asio::ip::host_name();
    RETURN_IF_ERROR(checkNewName("--live-name", live.name));
    ASSIGN_OR_RETURN(p.carrier, NatsCarrier::make(p.io.get_executor(), live.nats));
    p.options.hub.server_name = live.name;
  }

  // a peer that knows another server leaves one that is silent for three times this long
  if (p.options.together)
    p.options.limits.keepalive = std::min(p.options.limits.keepalive, kKeepaliveTogether);

  // the port first: if it is taken, nothing on disk has changed
  ASSIGN_OR_RETURN(auto acceptor, p.options.listen_fd >= 0 ? listenOnHandedOver(p.io, p.options.listen_fd)
                                                           : listenOn(p.io, endpoint, p.options.listen));
  RETURN_IF_ERROR(checkClock(wallNowNs() / 1'000'000'000));
  RETURN_IF_ERROR(checkFolderRights(p.options.data));
  std::error_code ignored;
  const bool is_new = !std::filesystem::exists(p.options.data / "needlelab.db", ignored);
  if (is_new) RETURN_IF_ERROR(checkRoom(p.options.data, p.options.min_free_bytes));
  if (const std::string few = tooFewFiles(p.options.max_connections); !few.empty())
    logEvent(LogLevel::kWarning, "few_files", {{"text", few}});
  p.acceptor.emplace(std::move(acceptor));
  p.port = p.acceptor->local_endpoint().port();

  Store::Options store_options;
  store_options.store_url = p.options.store_url;
  store_options.together = p.options.together;
  store_options.min_durability = p.options.min_durability;
  store_options.writer = p.options.writer;
  store_options.writer.on_thrown = logThrown;
  store_options.writer.on_durability = logDurability;
  store_options.writer.on_lack = [raw = parts.get()](const std::string& text) {
    logEvent(LogLevel::kError, "acknowledged_missing", {{"text", text}});
    // on a new connection, a station asks what the server has and sends the rest
    asio::post(raw->io, [raw] {
      const auto all = raw->context->connections;
      for (const auto& [id, connection] : all) connection->cut("the database lacks what was acknowledged");
    });
  };
  store_options.backup_key = p.options.backup_key;
  store_options.on_fatal = [raw = parts.get()](const Error& error) {
    logEvent(LogLevel::kError, "store_failed", {{"text", error.message}});
    asio::post(raw->io, [raw] {
      raw->exit_code = kExitFailed;
      raw->beginStop("the server's database failed");
    });
  };
  store_options.read_only_because = [&p, is_new] {
    const auto free_bytes = p.options.free_bytes(p.options.data);
    p.free_at_start = free_bytes.value_or(0);
    return is_new ? std::string() : readOnlyBecause(p.options.data, free_bytes, p.options.min_free_bytes);
  };
  ASSIGN_OR_RETURN(auto store, Store::open(p.options.data, store_options));
  p.store = std::move(store);
  if (const auto& why = p.store->readOnly())
    logEvent(LogLevel::kError, "read_only",
             {{"text", "the disk is too full to write: recordings can be read and exported, stations wait: " +
                           why->message}});
  for (const auto& path : p.store->leftoversRemoved())
    logEvent(LogLevel::kWarning, "leftover_removed",
             {{"path", path.string()}, {"text", "a program that was killed left it"}});
  if (const std::size_t repeated = p.store->erasuresRepeated(); repeated > 0)
    logEvent(LogLevel::kWarning, "erasures_repeated", {{"people", repeated}});
  if (const std::string text = p.store->acknowledgedMissing(); !text.empty())
    logEvent(LogLevel::kError, "acknowledged_missing", {{"text", text}});
  if (const std::string& text = p.store->clockBehind(); !text.empty())
    logEvent(LogLevel::kWarning, "clock_behind", {{"text", text}});
  if (const std::string& text = p.store->clockAhead(); !text.empty())
    logEvent(LogLevel::kWarning, "clock_ahead", {{"text", text}});

  p.files = tlsFilesIn(p.options.data / "tls");
  const auto leftovers = removeTlsLeftovers(p.files);
  if (!leftovers)
    logEvent(LogLevel::kWarning, "tls_leftovers_not_removed", {{"text", leftovers.error().message}});
  if (leftovers)
    for (const std::string& path : *leftovers)
      logEvent(LogLevel::kWarning, "tls_leftover_removed",
               {{"path", path}, {"text", "a program that was killed left it; it may hold a private key"}});
  p.names = certificateNames(p.options.listen, p.options.host_names, p.options.ca_domains);
  ASSIGN_OR_RETURN(const auto certificate, currentCertificate(p.files, p.names));
  if (!certificate.clock_fault.empty())
    logEvent(LogLevel::kWarning, "authority_not_valid", {{"text", certificate.clock_fault}});
  p.tls = certificate.tls;
  p.certificate_sha256 = certificate.sha256;

  p.options.admission.max_connections = p.options.max_connections;
  p.state.reset(new ServerState{.store = *p.store,
                                .work = {.io = p.io,
                                         .passwords = p.passwords,
                                         .logins = p.logins,
                                         .parsers = p.parsers,
                                         .workers = p.workers,
                                         .closers = p.closers,
                                         .views = p.views,
                                         .slow_workers = p.slow_workers,
                                         .retention_workers = p.retention_workers},
                                .limits = {.io = p.io,
                                           .bounds = p.options.bounds,
                                           .admission = Admission(p.options.admission),
                                           .disk_room = DiskRoom(p.options.min_free_bytes),
                                           .quotas = StationQuotas(p.options.quotas),
                                           .shares = PeopleShares(p.options.shares),
                                           .handshakes = HandshakeTurns(p.options.handshakes)},
                                .hub = Hub(p.options.hub),
                                .together = {.claims_as = p.store->sharedServerName()},
                                .acks_are_safe = p.options.min_durability >= Durability::kDiskLoss});
  p.context = &p.state->context;
  p.beginLogins();
  p.noteRoom(p.measureRoom());
  if (p.carrier) RETURN_IF_ERROR(p.startRemote());
  RETURN_IF_ERROR(p.startMonitor());
  if (const std::string& web = p.options.web.listen; !web.empty() && web != "off") {
    auto started = WebServer::start(*p.context, p.tls, p.options.web);
    if (started.ok()) {
      p.web = std::move(*started);
      p.context->web_port = p.web->port();
    } else {
      if (!p.options.web_optional || started.error().code != ErrorCode::kUnavailable) return started.error();
      logEvent(LogLevel::kWarning, "no_web", {{"text", started.error().message}});
    }
  }
  // before the server is visible; run() handles a signal that arrives before it is called
  if (p.options.handle_signals) {
    p.signals.add(SIGTERM);
    p.signals.add(SIGINT);
    p.signals.add(SIGHUP);  // the terminal was closed
  }
  if (!p.options.port_file.empty()) {
    const std::string text = fmt::format("{}\n", p.port);
    RETURN_IF_ERROR(writeFileAtomically(p.options.port_file, viewOf(text), 0644));
  }
  logEvent(LogLevel::kInfo, "listening",
           {{"address", p.acceptor->local_endpoint().address().to_string()},
            {"port", p.port},
            {"data", p.options.data.string()},
            {"ca", p.files.ca_certificate.string()},
            {"new_certificate", certificate.made ? "yes" : "no"}});
  return std::unique_ptr<Server>(new Server(std::move(parts)));
}

void ServerParts::beginLogins() {
  SharedLogins* const shared = store->logins();
  if (shared == nullptr) {
    const auto holds = [&service = store->service()](const Principal& who) {
      return service.logins().stillAllowed(who);
    };
    context->logins.state = std::make_unique<LoginsInMemory>(
        holds, LoginGuard(options.guard), Tokens({.lifetime = options.token_lifetime}), *options.token_time);
    return;
  }
  context->logins.state = std::make_unique<LoginsInStore>(
      LoginsInStore::Uses{io, *context->work.login_pool, store->readers(), *shared},
      LoginsInStore::Settings{.guard = options.guard, .lifetime = options.token_lifetime},
      *options.token_time);
  AccessListener::Tell tell;
  tell.changes = [this](std::vector<AccessChange> changes) {
    asio::post(io, [this, changes = std::move(changes)] { onRemoteAccessChanges(*context, changes); });
  };
  tell.look_at_all = [this] { asio::post(io, [this] { recheckAllAccess(*context); }); };
  tell.fault = [](const std::string& fault) {
    if (fault.empty())
      logEvent(LogLevel::kInfo, "access_heard", {{"text", "changes of access at other servers are heard"}});
    else
      logEvent(LogLevel::kWarning, "access_not_heard", {{"text", fault}});
  };
  context->together.access_listener = std::make_unique<AccessListener>(store->accessFeed(), shared->server(),
                                                                       options.access, std::move(tell));
  context->together.access_listener->start();
}

Status ServerParts::startRemote() {
  const LiveServersOptions& live = options.live;
  std::string id;
  {
    ASSIGN_OR_RETURN(auto reader, store->readers().borrow());
    // several servers work on one database only with PostgreSQL
    if (reader->sqlite() == nullptr) {
      ASSIGN_OR_RETURN(auto found, MetaStore(*reader).get(kLabKey));
      id = std::move(found).value_or("");
    }
  }
  const std::string lab = live.lab.empty() ? id : live.lab;
  if (lab.empty())
    return Error{ErrorCode::kInvalidInput,
                 "--live: a database on SQLite is one server's: give the lab's servers one name, "
                 "--live-lab NAME"};
  RETURN_IF_ERROR(checkNewName("--live-lab", lab));
  RemoteLiveSettings settings;
  settings.lab = id.empty() ? lab : id;
  settings.server = live.name;
  const Uuid drawn = makeUuidV7();
  for (std::size_t i = 0; i < sizeof settings.instance; ++i)
    settings.instance = settings.instance << 8 | drawn[drawn.size() - 1 - i];
  remote = std::make_unique<RemoteLive>(context->hub, *carrier, std::move(settings));
  remote->deliverBy(remoteDelivery(*context));
  context->together.remote = remote.get();
  carrier->start(*remote, lab, live.name);
  logEvent(LogLevel::kInfo, "live", {{"nats", live.nats.address}, {"lab", lab}, {"name", live.name}});
  return {};
}

Status ServerParts::startMonitor() {
  if (options.metrics.empty()) return {};
  // a port without a host means localhost, because the metrics are not public
  std::string where = options.metrics;
  if (where.find_first_not_of("0123456789") == std::string::npos) where = "127.0.0.1:" + where;
  ASSIGN_OR_RETURN(const auto endpoint, resolveListen(where, "--metrics"));
  ASSIGN_OR_RETURN(auto listening, listenOn(io, endpoint, where, "--metrics"));
  if (!endpoint.address().is_loopback())
    logEvent(LogLevel::kWarning, "metrics_open_to_the_network",
             {{"address", where},
              {"text", "the metrics have neither TLS nor log-in: let a firewall decide who may read them"}});
  monitor = std::make_unique<Monitor>(*context, files.certificate, options.monitor);
  monitor_port = std::make_shared<MonitorPort>(io, std::move(listening), *monitor);
  if (!options.metrics_port_file.empty()) {
    const std::string text = fmt::format("{}\n", monitor_port->port());
    RETURN_IF_ERROR(writeFileAtomically(options.metrics_port_file, viewOf(text), 0644));
  }
  logEvent(LogLevel::kInfo, "metrics",
           {{"address", endpoint.address().to_string()}, {"port", monitor_port->port()}});
  monitor_port->beginAccepting();
  return {};
}

Server::Server(std::unique_ptr<ServerParts> parts) : parts_(std::move(parts)) {}

Server::~Server() {
  ServerParts& p = *parts_;
  if (p.context && p.context->together.access_listener) p.context->together.access_listener->stop();
  if (p.carrier) p.carrier->stop();
  // running work posts its results to io, which no longer runs
  for (asio::thread_pool* pool : {&p.passwords, &p.logins, &p.parsers, &p.workers, &p.closers, &p.views,
                                  &p.slow_workers, &p.retention_workers, &p.room_worker})
    pool->join();
  if (p.monitor) p.monitor->join();
  p.store->writer().stop();
}

int Server::run() {
  ServerParts& p = *parts_;
  asio::co_spawn(
      p.io,
      acceptLoop(*p.acceptor, "accept_failed", [&p](Tcp::socket socket) { p.accepted(std::move(socket)); }),
      rethrow);
  if (p.options.handle_signals) asio::co_spawn(p.io, p.signalLoop(), rethrow);
  if (const auto period = watchdogPeriod(); period && p.options.handle_signals)
    asio::co_spawn(p.io, p.watchdogLoop(*period), rethrow);
  if (p.options.handle_signals) notifyManager("READY=1\nSTATUS=serving");
  if (p.options.retention_every.count() > 0) asio::co_spawn(p.io, p.retentionLoop(), rethrow);
  asio::co_spawn(p.io, p.heapLoop(), rethrow);
  if (p.options.certificate_every.count() > 0) asio::co_spawn(p.io, p.certificateLoop(), rethrow);
  asio::co_spawn(p.io, p.roomLoop(), rethrow);
  asio::co_spawn(p.io, p.hangUpLoop(), rethrow);
  asio::co_spawn(p.io, p.linesLoop(), rethrow);
  if (p.options.together) asio::co_spawn(p.io, p.erasuresLoop(), rethrow);
  if (p.context->together.access_listener) asio::co_spawn(p.io, p.accessLoop(), rethrow);
  if (p.remote) asio::co_spawn(p.io, p.remoteLoop(), rethrow);
  p.io.run();
  if (p.carrier) p.carrier->stop();
  p.context->limits.lines.reportOmitted(INT64_MAX);
  p.context->clock_offsets.reportOmitted(INT64_MAX);
  // all connections have ended; the writer commits its queue before it ends
  p.store->stopWriting();
  if (const auto failed = p.store->writer().failed(); failed && !p.store->readOnly()) {
    p.exit_code = kExitFailed;
    logEvent(LogLevel::kError, "stopped", {{"exit", p.exit_code}, {"text", failed->message}});
  } else {
    logEvent(LogLevel::kInfo, "stopped", {{"exit", p.exit_code}});
  }
  return p.exit_code;
}

void Server::stop() {
  asio::post(parts_->io, [raw = parts_.get()] { raw->beginStop("the server is shutting down"); });
}

void ServerParts::accepted(Tcp::socket socket) {
  boost::system::error_code gone;
  const auto peer = socket.remote_endpoint(gone);
  if (gone) return;
  const std::uint64_t id = next_id++;
  const auto arrival = context->limits.admission.arrive(id, peer.address().to_string(), steadyNowNs());
  if (arrival.answer != Admission::Answer::kWelcome) {
    refuseConnection(peer.address().to_string());
    return;  // closes the socket
  }
  if (arrival.displaced) {
    const auto found = context->connections.find(*arrival.displaced);
    if (found != context->connections.end()) found->second->cut("too many wait for their log-in");
  }
  auto channel = Channel::make(TlsStream(std::move(socket), *tls), options.limits);
  auto connection = std::make_shared<PeerConnection>(*context, id, std::move(channel));
  asio::co_spawn(io, PeerConnection::run(connection), PeerConnection::endOnException(connection));
}

void ServerParts::refuseConnection(const std::string& host) {
  ++context->counters.connections_refused;
  // a flood must not fill the disk with log lines: one line a second, with the number of refused connections
  ++refused_unlogged;
  if (const std::int64_t now = steadyNowNs(); now - refused_logged_ns > 1'000'000'000) {
    refused_logged_ns = now;
    logEvent(LogLevel::kWarning, "connections_turned_away",
             {{"newest", host}, {"count", std::exchange(refused_unlogged, 0)}});
  }
}

Task<> ServerParts::signalLoop() {
  if (stopping) co_return;  // stop() came before run(), so its cancellation had no effect here
  auto [error, signal] = co_await signals.async_wait(kUseTuple);
  if (error) co_return;
  logEvent(LogLevel::kInfo, "signal", {{"number", signal}});
  beginStop("the server is shutting down");
}

void ServerParts::beginStop(const std::string& reason) {
  if (std::exchange(stopping, true)) return;
  logEvent(LogLevel::kInfo, "stopping", {{"reason", reason}, {"connections", context->connections.size()}});
  context->stopping = true;
  if (options.handle_signals) notifyManager("STOPPING=1\nSTATUS=draining");
  // cancel a running backup; the next one covers its data
  store->service().cancelLongWork();
  boost::system::error_code ignored;
  acceptor->close(ignored);
  if (monitor_port) monitor_port->stop();
  if (web) web->stop();
  watchdog_timer.cancel();
  signals.cancel(ignored);
  retention_timer.cancel();
  heap_timer.cancel();
  certificate_timer.cancel();
  room_timer.cancel();
  hang_up_timer.cancel();
  lines_timer.cancel();
  erasures_timer.cancel();
  access_timer.cancel();
  remote_timer.cancel();
  if (remote) remote->leave();
  store->service().stopRetention();
  const auto all = context->connections;
  for (const auto& [id, connection] : all) connection->shutDown(reason);
  asio::co_spawn(io, drainLoop(), rethrow);
}

Task<> ServerParts::drainLoop() {
  const auto end = std::chrono::steady_clock::now() + options.drain;
  const auto all_closed = [this] { return context->connections.empty() && (!web || web->idle()); };
  while (!all_closed() && std::chrono::steady_clock::now() < end) {
    drain_timer.expires_after(std::chrono::milliseconds(20));
    co_await drain_timer.async_wait(kUseTuple);
  }
  const auto left = context->connections;
  for (const auto& [id, connection] : left) connection->cut("the server's time to drain has passed");
  if (web) web->cutAll("the server's time to drain has passed");
}

std::uint16_t Server::metricsPort() const {
  return parts_->monitor_port ? parts_->monitor_port->port() : 0;
}
std::uint16_t Server::webPort() const {
  return parts_->web ? parts_->web->port() : 0;
}
std::uint16_t Server::port() const {
  return parts_->port;
}
std::filesystem::path Server::caFile() const {
  return parts_->files.ca_certificate;
}
Store& Server::store() {
  return *parts_->store;
}
const ServerCounters& Server::counters() const {
  ServerContext& context = *parts_->context;
  context.counters.max_reply_bytes = context.in_flight.replies.mostTaken();
  return context.counters;
}
const WebCounters& Server::webCounters() const {
  return parts_->context->web;
}

}  // namespace needlelab
