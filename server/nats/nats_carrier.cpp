#include "server/nats/nats_carrier.h"

#include <fmt/core.h>
#include <nats/nats.h>

#include <boost/asio/post.hpp>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "server/base/log.h"
#include "server/nats/drop_queue.h"
#include "server/nats/nats_address.h"

namespace needlelab {
namespace {

using std::chrono::milliseconds;

constexpr std::int64_t kConnect_ms = 2'000;  // for connecting, TLS, and each answer meanwhile
constexpr std::int64_t kWrite_ms = 2'000;
constexpr std::int64_t kPing_ms = 1'000;  // two unanswered pings end the connection
constexpr int kMaxPingsOut = 2;
constexpr std::int64_t kLastFlush_ms = 500;
constexpr milliseconds kStops{3'000};
constexpr milliseconds kLasted{10'000};  // only a connection that lasted this long resets the waiting time
/// Queue of libnats per subscription; the callback empties it at once.
constexpr int kPendingItems = 16'384, kPendingBytes = 16 << 20;
constexpr std::size_t kPublishedAtOnce = 64, kTakenAtOnce = 256, kTakenBytes = 1u << 20;
constexpr std::uint64_t kRefusedLinesAMinute = 5;

struct Outgoing {
  std::string subject, message;
  [[nodiscard]] std::size_t bytes() const { return subject.size() + message.size(); }
};
struct Incoming {
  LivePlane plane = LivePlane::kPresence;
  std::string name, message;
  [[nodiscard]] std::size_t bytes() const { return name.size() + message.size(); }
};
struct LinkNews {
  bool up = false;
  std::string why;
};

/// Shared by the network's thread, the carrier's own and those of libnats. libnats may call back even after a
/// connection has ended, so an exchange lives as long as the program.
struct Exchange {
  explicit Exchange(const NatsSettings& settings)
      : frames_out(settings.queued_items, settings.queued_bytes),
        rest_out(settings.queued_items, settings.queued_bytes),
        frames_in(settings.queued_items, settings.queued_bytes),
        rest_in(settings.queued_items, settings.queued_bytes) {}

  std::mutex mutex;
  std::condition_variable changed;
  std::string lab;                            // set before the threads start
  LiveCarrier::Listener* listener = nullptr;  // used on the network's thread
  // guarded by mutex
  std::optional<asio::any_io_executor> network;  // nothing: no listener any more
  bool stopping = false, ended = false;
  bool up = false;
  natsConnection* current = nullptr;
  bool closed = false;  // the current connection
  std::string closed_why;
  std::set<std::string> wanted;  // stations whose frames are wanted
  bool wanted_changed = false;
  DropQueue<Outgoing> frames_out, rest_out;
  DropQueue<Incoming> frames_in, rest_in;
  std::deque<LinkNews> news;
  bool posted = false;
  LiveCarrier::Counters counters;
  LogBound refused_lines{kRefusedLinesAMinute};
};

Exchange& keptExchange(const NatsSettings& settings) {
  static auto* const kept = new std::deque<Exchange>();  // NOLINT: never destroyed
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  return kept->emplace_back(settings);
}

/// On the network's thread: takes some of the received messages at a time.
void drainInbox(Exchange& exchange) {
  std::vector<Incoming> items;
  std::deque<LinkNews> news;
  {
    const std::lock_guard lock(exchange.mutex);
    news.swap(exchange.news);
    std::size_t bytes = 0;
    while (items.size() < kTakenAtOnce && bytes < kTakenBytes) {
      auto item = exchange.rest_in.pop();
      if (!item) item = exchange.frames_in.pop();
      if (!item) break;
      bytes += item->message.size();
      items.push_back(*std::move(item));
    }
    exchange.posted = !(exchange.rest_in.empty() && exchange.frames_in.empty());
    if (exchange.posted && exchange.network)
      asio::post(*exchange.network, [&exchange] { drainInbox(exchange); });
  }
  for (const LinkNews& each : news)
    if (exchange.listener != nullptr) exchange.listener->onLink(each.up, each.why);
  for (const Incoming& item : items)
    if (exchange.listener != nullptr) exchange.listener->onMessage(item.plane, item.name, item.message);
}

/// Call with the mutex held.
void wakeNetwork(Exchange& exchange) {
  if (!exchange.network || std::exchange(exchange.posted, true)) return;
  asio::post(*exchange.network, [&exchange] { drainInbox(exchange); });
}

void reportLink(Exchange& exchange, bool up, const std::string& why) {
  const std::lock_guard lock(exchange.mutex);
  exchange.up = exchange.counters.connected = up;
  if (up) ++exchange.counters.connections;
  // unsent messages are outdated by the time of the next connection
  if (!up) exchange.counters.dropped_out += exchange.frames_out.clear() + exchange.rest_out.clear();
  exchange.news.push_back({up, why});
  wakeNetwork(exchange);
}

void arrived(Exchange& exchange, std::string_view subject, std::string_view message) {
  std::optional<SubjectParts> parts;
  if (message.size() <= LiveCarrier::kMostBytes) parts = partsOfSubject(exchange.lab, subject);
  const std::lock_guard lock(exchange.mutex);
  LiveCarrier::Counters& counters = exchange.counters;
  ++counters.messages_in;
  counters.bytes_in += message.size();
  if (!parts) {
    ++counters.malformed;
    return;
  }
  auto& queue = parts->plane == LivePlane::kLive ? exchange.frames_in : exchange.rest_in;
  counters.dropped_in += queue.push({parts->plane, std::move(parts->name), std::string(message)});
  wakeNetwork(exchange);
}

// --- on libnats's threads; no exception may pass through it

void onNatsMessage(natsConnection* /*nc*/, natsSubscription* /*sub*/, natsMsg* message, void* closure) {
  auto& exchange = *static_cast<Exchange*>(closure);
  try {
    arrived(exchange, natsMsg_GetSubject(message),
            {natsMsg_GetData(message), static_cast<std::size_t>(natsMsg_GetDataLength(message))});
  } catch (...) {  // out of memory
    const std::lock_guard lock(exchange.mutex);
    ++exchange.counters.dropped_in;
  }
  natsMsg_Destroy(message);
}

std::string lastErrorOf(natsConnection* connection, natsStatus status) {
  const char* text = nullptr;
  (void)natsConnection_GetLastError(connection, &text);
  return printable(text != nullptr && *text != '\0' ? text : natsStatus_GetText(status));
}

void onNatsClosed(natsConnection* connection, void* closure) {
  auto& exchange = *static_cast<Exchange*>(closure);
  try {
    const std::string why = lastErrorOf(connection, NATS_CONNECTION_CLOSED);
    const std::lock_guard lock(exchange.mutex);
    if (exchange.current != connection) return;
    exchange.closed = true;
    exchange.closed_why = why;
    exchange.changed.notify_all();
  } catch (...) {  // out of memory for the reason
    const std::lock_guard lock(exchange.mutex);
    exchange.closed = exchange.current == connection;
    exchange.changed.notify_all();
  }
}

/// A subject that the NATS server does not permit, or messages dropped by libnats.
void onNatsError(natsConnection* connection, natsSubscription* /*sub*/, natsStatus status, void* closure) {
  auto& exchange = *static_cast<Exchange*>(closure);
  try {
    const std::lock_guard lock(exchange.mutex);
    ++exchange.counters.refused;
    if (exchange.refused_lines.take(steadyNowNs()))
      logEvent(LogLevel::kWarning, "live_refused",
               {{"text", lastErrorOf(connection, status)},
                {"advice",
                 "the NATS server's permissions must name this lab's subjects "
                 "(nats-server.conf of the faculty's files: FACULTY.md)"}});
  } catch (...) {
  }
}

// --- the carrier's own thread

struct OptionsEnd {
  void operator()(natsOptions* options) const { natsOptions_Destroy(options); }
};
struct SubscriptionEnd {
  void operator()(natsSubscription* subscription) const { natsSubscription_Destroy(subscription); }
};
struct ConnectionEnd {
  void operator()(natsConnection* connection) const {
    natsConnection_Close(connection);
    natsConnection_Destroy(connection);
  }
};
using Options = std::unique_ptr<natsOptions, OptionsEnd>;
using Subscription = std::unique_ptr<natsSubscription, SubscriptionEnd>;
using Connection = std::unique_ptr<natsConnection, ConnectionEnd>;

class Carrier final : public NatsCarrier {
 public:
  Carrier(asio::any_io_executor network, NatsSettings settings, NatsAddress address, NatsUser user)
      : settings_(std::move(settings)),
        address_(std::move(address)),
        user_(std::move(user)),
        exchange_(keptExchange(settings_)) {
    exchange_.network = std::move(network);
  }
  ~Carrier() override { stop(); }
  Carrier(const Carrier&) = delete;
  Carrier& operator=(const Carrier&) = delete;

  void start(Listener& listener, const std::string& lab, const std::string& server) override {
    exchange_.listener = &listener;
    exchange_.lab = lab;
    server_ = server;
    thread_ = std::thread([this] { run(); });
  }

  void stop() override {
    exchange_.listener = nullptr;
    std::unique_lock lock(exchange_.mutex);
    exchange_.network.reset();
    exchange_.stopping = true;
    if (!thread_.joinable()) return;
    exchange_.changed.notify_all();
    exchange_.changed.wait_for(lock, kStops, [this] { return exchange_.ended; });
    lock.unlock();
    thread_.join();
  }

  void publish(LivePlane plane, const std::string& name, std::string message) override {
    Outgoing item{subjectOf(exchange_.lab, plane, name), std::move(message)};
    const std::lock_guard lock(exchange_.mutex);
    if (!exchange_.up || item.message.size() > kMostBytes) {
      ++exchange_.counters.dropped_out;
      return;
    }
    auto& queue = plane == LivePlane::kLive ? exchange_.frames_out : exchange_.rest_out;
    exchange_.counters.dropped_out += queue.push(std::move(item));
    exchange_.changed.notify_all();
  }

  void listenTo(const std::string& station, bool wanted) override {
    const std::lock_guard lock(exchange_.mutex);
    if (wanted)
      exchange_.wanted.insert(station);
    else
      exchange_.wanted.erase(station);
    exchange_.wanted_changed = true;
    exchange_.changed.notify_all();
  }

  [[nodiscard]] Counters counters() const override {
    const std::lock_guard lock(exchange_.mutex);
    return exchange_.counters;
  }

 private:
  /// A connection and its subscriptions, which are destroyed first.
  struct Link {
    Connection connection;
    std::vector<Subscription> planes;
    std::map<std::string, Subscription> stations;
  };

  void run() {
    std::mt19937_64 random{std::random_device{}()};
    std::uniform_real_distribution<double> unit(0, 1);
    BackOff back_off;
    // servers that start together begin at different places of the list
    std::size_t next = random() % address_.servers.size();
    for (std::string said; !stopping(); next = (next + 1) % address_.servers.size()) {
      const NatsServer& server = address_.servers[next];
      const std::int64_t began_ns = steadyNowNs();
      std::string why;
      if (auto link = connect(server, why)) {
        logEvent(LogLevel::kInfo, "live_link", {{"state", "up"}, {"nats", server.url()}});
        reportLink(exchange_, true, "");
        why = serve(*link);
        reportLink(exchange_, false, why);
        if (steadyNowNs() - began_ns > std::chrono::nanoseconds(kLasted).count()) back_off.reset();
        said.clear();
      }
      // log each reason only once in a row
      if (!stopping() && std::exchange(said, why) != why) {
        logEvent(LogLevel::kWarning, "live_link", {{"state", "down"}, {"nats", server.url()}, {"text", why}});
        reportLink(exchange_, false, why);
      }
      std::unique_lock lock(exchange_.mutex);
      exchange_.changed.wait_for(lock, back_off.next(unit(random)), [this] { return exchange_.stopping; });
    }
    const std::lock_guard lock(exchange_.mutex);
    exchange_.ended = true;
    exchange_.changed.notify_all();
  }

  bool stopping() {
    const std::lock_guard lock(exchange_.mutex);
    return exchange_.stopping;
  }

  natsStatus setOptions(natsOptions* options, const NatsServer& server) {
    natsStatus status = natsOptions_SetURL(options, server.url().c_str());
    const auto set = [&status](natsStatus next) {
      if (status == NATS_OK) status = next;
    };
    const std::string name = "needlelab-server " + server_;
    set(natsOptions_SetName(options, name.c_str()));
    set(natsOptions_SetTimeout(options, kConnect_ms));
    set(natsOptions_SetWriteDeadline(options, kWrite_ms));
    set(natsOptions_SetPingInterval(options, kPing_ms));
    set(natsOptions_SetMaxPingsOut(options, kMaxPingsOut));
    set(natsOptions_SetAllowReconnect(options, false));
    set(natsOptions_SetIgnoreDiscoveredServers(options, true));
    set(natsOptions_SetNoEcho(options, true));
    // one thread of the library delivers for all subscriptions
    set(natsOptions_UseGlobalMessageDelivery(options, true));
    set(natsOptions_SetClosedCB(options, onNatsClosed, &exchange_));
    set(natsOptions_SetErrorHandler(options, onNatsError, &exchange_));
    if (address_.tls) {
      set(natsOptions_SetSecure(options, true));
      if (!settings_.ca.empty()) set(natsOptions_LoadCATrustedCertificates(options, settings_.ca.c_str()));
      set(natsOptions_SetExpectedHostname(options, server.host.c_str()));
    }
    if (!user_.creds.empty())
      set(natsOptions_SetUserCredentialsFromFiles(options, user_.creds.c_str(), nullptr));
    else if (!user_.user.empty())
      set(natsOptions_SetUserInfo(options, user_.user.c_str(), user_.password.c_str()));
    return status;
  }

  /// Null: `why` has the reason.
  std::unique_ptr<Link> connect(const NatsServer& server, std::string& why) {
    natsOptions* made = nullptr;
    natsStatus status = natsOptions_Create(&made);
    const Options options(made);
    if (status == NATS_OK) status = setOptions(made, server);
    natsConnection* connected = nullptr;
    if (status == NATS_OK) status = natsConnection_Connect(&connected, made);
    auto link = std::make_unique<Link>();
    link->connection.reset(connected);
    for (const LivePlane plane : {LivePlane::kPresence, LivePlane::kWatch, LivePlane::kAsk})
      if (status == NATS_OK)
        status = subscribe(*link, subjectOf(exchange_.lab, plane, std::nullopt), link->planes);
    if (status == NATS_OK)
      status = subscribe(*link, subjectOf(exchange_.lab, LivePlane::kAnswer, server_), link->planes);
    if (status == NATS_OK) {
      {
        const std::lock_guard lock(exchange_.mutex);
        exchange_.current = connected;
        exchange_.closed = natsConnection_IsClosed(connected);
        exchange_.closed_why.clear();
      }
      subscribeToWanted(*link);
      // the subscriptions are active once it has answered
      status = natsConnection_FlushTimeout(connected, kConnect_ms);
    }
    if (status == NATS_OK) return link;
    natsStatus unused = NATS_OK;
    const char* const detail = nats_GetLastError(&unused);
    why = fmt::format("{}: {}", server.url(), natsStatus_GetText(status));
    if (status == NATS_SSL_ERROR && detail != nullptr) why += fmt::format(" ({})", printable(detail));
    forget();
    return nullptr;
  }

  natsStatus subscribe(Link& link, const std::string& subject, std::vector<Subscription>& into) {
    natsSubscription* made = nullptr;
    natsStatus status =
        natsConnection_Subscribe(&made, link.connection.get(), subject.c_str(), onNatsMessage, &exchange_);
    if (status != NATS_OK) return status;
    into.emplace_back(made);
    return natsSubscription_SetPendingLimits(made, kPendingItems, kPendingBytes);
  }

  void subscribeToWanted(Link& link) {
    std::set<std::string> wanted;
    {
      const std::lock_guard lock(exchange_.mutex);
      wanted = exchange_.wanted;
      exchange_.wanted_changed = false;
    }
    std::erase_if(link.stations, [&](const auto& each) { return !wanted.contains(each.first); });
    for (const std::string& station : wanted) {
      if (link.stations.contains(station)) continue;
      std::vector<Subscription> one;
      if (subscribe(link, subjectOf(exchange_.lab, LivePlane::kLive, station), one) == NATS_OK)
        link.stations.emplace(station, std::move(one.front()));
    }
  }

  /// Publishes until the connection ends; returns the reason.
  std::string serve(Link& link) {
    std::unique_lock lock(exchange_.mutex);
    for (;;) {
      exchange_.changed.wait(lock, [this] {
        return exchange_.stopping || exchange_.closed || exchange_.wanted_changed ||
               !exchange_.frames_out.empty() || !exchange_.rest_out.empty();
      });
      if (exchange_.closed) break;
      if (exchange_.wanted_changed) {
        lock.unlock();
        subscribeToWanted(link);
        lock.lock();
        continue;
      }
      std::vector<Outgoing> items;
      while (items.size() < kPublishedAtOnce) {
        auto item = exchange_.rest_out.pop();
        if (!item) item = exchange_.frames_out.pop();
        if (!item) break;
        items.push_back(*std::move(item));
      }
      if (items.empty()) break;  // stopping
      lock.unlock();
      std::uint64_t sent = 0, bytes = 0;
      for (const Outgoing& item : items) {
        if (natsConnection_Publish(link.connection.get(), item.subject.c_str(), item.message.data(),
                                   static_cast<int>(item.message.size())) != NATS_OK)
          continue;
        ++sent;
        bytes += item.message.size();
      }
      lock.lock();
      exchange_.counters.messages_out += sent;
      exchange_.counters.bytes_out += bytes;
      exchange_.counters.dropped_out += items.size() - sent;
    }
    const bool is_last = !exchange_.closed;
    std::string why = exchange_.closed_why.empty() ? "the connection was lost" : exchange_.closed_why;
    lock.unlock();
    if (is_last) (void)natsConnection_FlushTimeout(link.connection.get(), kLastFlush_ms);
    forget();
    return why;
  }

  /// The current connection has ended.
  void forget() {
    const std::lock_guard lock(exchange_.mutex);
    exchange_.current = nullptr;
    exchange_.closed = false;
  }

  const NatsSettings settings_;
  const NatsAddress address_;
  const NatsUser user_;
  std::string server_;
  Exchange& exchange_;
  std::thread thread_;
};

}  // namespace

Result<std::unique_ptr<NatsCarrier>> NatsCarrier::make(asio::any_io_executor network, NatsSettings settings) {
  ASSIGN_OR_RETURN(auto address, parseNatsAddress(settings.address));
  NatsUser user;
  if (!settings.user.empty()) {
    ASSIGN_OR_RETURN(user, readNatsUser(settings.user));
  }
  if (!settings.ca.empty()) {
    if (!address.tls)
      return Error{ErrorCode::kInvalidInput, "--live-ca: is for tls:// only; --live has nats://"};
    if (const auto read = readWholeFile(settings.ca, 1u << 20); !read)
      return Error{ErrorCode::kInvalidInput, "--live-ca " + read.error().message};
  }
  return std::unique_ptr<NatsCarrier>(
      new Carrier(std::move(network), std::move(settings), std::move(address), std::move(user)));
}

}  // namespace needlelab
