#include "client/instructor/model/live/lab_connection.h"

#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>

#include "client/net/link/connect.h"
#include "client/net/link/server_link.h"
#include "common/base/text/plain_words.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

bool contains(const Error& error, const std::string& part) {
  return error.message.find(part) != std::string::npos;
}

LinkTrouble denied(const Error& error, const std::string& server) {
  if (contains(error, kNotForThisName)) {
    return {"The server's certificate is not valid for the address " + server + ".",
            "Use the name in the certificate (ask the person who runs the server), or have the server "
            "started with "
            "--host-name for this address.",
            true,
            {}};
  }
  if (contains(error, "(ROLE)")) {
    return {"This account may not do that.",
            "Log in as an instructor, curriculum manager or administrator.",
            true,
            {}};
  }
  if (contains(error, "(LOGIN)")) {
    return {"The server does not accept this name and password.",
            "Check both: upper and lower case matter. If they are right, the account may be disabled or its "
            "password changed; ask an administrator.",
            true,
            {}};
  }
  return {"The certificate of the server at " + server + " does not belong to the chosen CA file.",
          "Choose the tls/ca.crt of this server; a reinstalled server has a new one. If the file "
          "is right, something else answers at this address: do not enter a password, ask the person who "
          "runs the lab.",
          true,
          {}};
}

LinkTrouble explanationOf(const Error& error, const std::string& server) {
  switch (error.code) {
    case ErrorCode::kDenied:
      return denied(error, server);
    case ErrorCode::kVersion:
      return {"The server and this program have different versions.",
              "Update the older one; the details name both versions.",
              true,
              {}};
    case ErrorCode::kInvalidInput:
    case ErrorCode::kNotFound:
      return {"The CA file cannot be used.",
              "Choose the file tls/ca.crt from the server's folder; the person who runs the server has it.",
              true,
              {}};
    case ErrorCode::kCorrupt:
      return {"The program that answers at " + server + " is not needlelab-server.",
              "Check host and port: the instructor's port is 7750 unless the lab says otherwise.",
              true,
              {}};
    case ErrorCode::kUnavailable:
      break;
    default:
      return {"The connection failed.", "The program keeps trying; the details say more.", false, {}};
  }
  if (contains(error, "(RATE_LIMITED)")) {
    return {"Too many log-ins failed: the server makes you wait.",
            "Wait a minute; the program then tries again.",
            false,
            {}};
  }
  if (contains(error, "(SHUTTING_DOWN)") || contains(error, "said bye")) {
    return {"The server at " + server + " is being shut down or restarted.",
            "Nothing to do: the program reconnects when the server is back.",
            false,
            {}};
  }
  return {"No needlelab-server answers at " + server + ".",
          "Is the server running, and is this its address? The program keeps trying.",
          false,
          {}};
}

}  // namespace

LinkTrouble troubleOf(const Error& error, const std::string& server) {
  LinkTrouble trouble = explanationOf(error, printable(server));
  trouble.detail = plainWords(printable(error.message));
  return trouble;
}

namespace {

constexpr std::uint32_t kOverviewSubscription = 1;
constexpr std::int64_t kStopPollPeriod_ns = 50'000'000;

/// Whether the role may list the lab's stations.
bool isStaff(pb::Role role) {
  return role == pb::INSTRUCTOR || role == pb::CURRICULUM_MANAGER || role == pb::ADMINISTRATOR;
}

Status acceptStaff(const pb::Welcome& welcome) {
  if (isStaff(welcome.role())) return {};
  return Error{ErrorCode::kDenied, "the peer refused (ROLE): '" + welcome.name() +
                                       "' is not an instructor; this program is for instructors"};
}

/// Replaces a loss of connection that the server did not explain by kUnavailable, for any cause.
Error reasonOf(const LinkEnd& end) {
  if (!end.was_connected || end.is_server_reason) return end.error;
  return {ErrorCode::kUnavailable, "the connection is lost: " + end.channel_text};
}

}  // namespace

struct LabConnection::Net {
  explicit Net(LabConnectionSettings chosen)
      : settings(std::move(chosen)),
        link(io,
             {.retry = {settings.first_retry, settings.max_retry, 2.0},
              .lasting = settings.max_retry,
              .max_waiting = settings.max_waiting,
              .clock = settings.clock},
             handlers()) {
    thread = std::thread([this] { io.run(); });
  }

  // --- on the network's thread

  LinkHandlers handlers();
  void onConnected(const pb::Welcome& welcome);
  void onMessage(pb::Envelope& envelope);
  void onAway(const LinkEnd& end);
  void subscribe(std::uint32_t number, const std::string& station, double rate_hz);
  void ask(pb::Request request, Answer answer, OnLoss on_loss);
  void countWaiting();

  LabConnectionSettings settings;
  asio::io_context io{1};
  asio::executor_work_guard<asio::io_context::executor_type> guard{io.get_executor()};
  ServerLink link;
  std::optional<double> overview_hz;
  std::map<std::string, std::uint32_t> watched;
  std::uint32_t next_subscription = kOverviewSubscription + 1;

  // --- shared
  mutable std::mutex mutex;
  LinkState state;
  std::deque<LiveArrival> frames;
  std::map<std::string, pb::StationStatus> statuses;
  std::vector<std::string> status_order;
  std::vector<std::function<void()>> answers;

  std::thread thread;
};

LinkHandlers LabConnection::Net::handlers() {
  return {.accept = acceptStaff,
          .connected = [this](const pb::Welcome& welcome) { onConnected(welcome); },
          .message = [this](pb::Envelope& envelope) { onMessage(envelope); },
          .judge =
              [](const LinkEnd& end) {
                const bool needs_person = end.was_connected ? reasonOf(end).code == ErrorCode::kDenied
                                                            : troubleOf(end.error, end.server).needs_person;
                return needs_person ? Retry::kNever : Retry::kBackOff;
              },
          .away = [this](const LinkEnd& end) { onAway(end); }};
}

void LabConnection::Net::onConnected(const pb::Welcome& welcome) {
  {
    const std::scoped_lock lock(mutex);
    state.phase = LinkPhase::kOnline;
    state.trouble = {};
    state.away_since_ns = state.next_try_ns = 0;
    state.server = endpointText(link.server());
    state.role = welcome.role();
    state.server_version = welcome.server_version();
    ++state.connections;
  }
  if (overview_hz) subscribe(kOverviewSubscription, {}, *overview_hz);
  for (const auto& [station, number] : watched) subscribe(number, station, 0);
}

void LabConnection::Net::onAway(const LinkEnd& end) {
  countWaiting();
  if (end.stopping) return;
  const std::scoped_lock lock(mutex);
  if (state.away_since_ns == 0) state.away_since_ns = settings.clock->steadyNs();
  state.phase = end.next_try_ns == 0 ? LinkPhase::kRefused : LinkPhase::kAway;
  state.trouble = troubleOf(reasonOf(end), end.server);
  state.next_try_ns = end.next_try_ns;
}

void LabConnection::Net::onMessage(pb::Envelope& envelope) {
  if (envelope.has_live_frame()) {
    const std::int64_t now_ns = wallNowNs();
    const std::scoped_lock lock(mutex);
    ++state.frames;
    if (frames.size() >= settings.max_frames) {
      frames.pop_front();
      ++state.frames_dropped;
    }
    frames.push_back({std::move(*envelope.mutable_live_frame()), now_ns});
  } else if (envelope.has_station_status()) {
    std::string name = envelope.station_status().station();
    const std::scoped_lock lock(mutex);
    const auto [place, is_new] =
        statuses.insert_or_assign(name, std::move(*envelope.mutable_station_status()));
    if (is_new) status_order.push_back(std::move(name));
  }
}

void LabConnection::Net::subscribe(std::uint32_t number, const std::string& station, double rate_hz) {
  pb::Envelope envelope;
  envelope.mutable_subscribe()->set_subscription(number);
  envelope.mutable_subscribe()->set_station(station);
  envelope.mutable_subscribe()->set_rate_hz(rate_hz);
  link.send(envelope);
}

void LabConnection::Net::ask(pb::Request request, Answer answer, OnLoss on_loss) {
  link.ask(
      std::move(request),
      [this, answer = std::move(answer)](Result<pb::Reply> reply) {
        answer(std::move(reply));
        countWaiting();
      },
      on_loss, settings.answer_time);
  countWaiting();
}

void LabConnection::Net::countWaiting() {
  const std::scoped_lock lock(mutex);
  state.waiting = link.waiting();
}

LabConnection::LabConnection(LabConnectionSettings settings)
    : net_(std::make_unique<Net>(std::move(settings))) {}

LabConnection::~LabConnection() {
  Net& net = *net_;
  asio::post(net.io, [&net] { net.link.stop("done", [&net] { net.io.stop(); }); });
  net.thread.join();
}

void LabConnection::logIn(LabLogin login) {
  {
    const std::scoped_lock lock(net_->mutex);
    net_->state.phase = LinkPhase::kConnecting;
    net_->state.server = endpointsText(login.servers);
    net_->state.user = login.user;
    net_->state.trouble = {};
    net_->state.away_since_ns = net_->state.next_try_ns = 0;
  }
  ClientConfig config;
  config.setServers(login.servers);
  config.ca_file = login.ca_file;
  config.program = programText(net_->settings.program);
  // frames should wait in the server's queue, which drops the oldest, and not in the kernel
  config.limits.socket_buffer_bytes = 256 << 10;
  config.limits.close_grace = std::chrono::milliseconds(300);
  config.login = personLogin(login.user, login.password);
  asio::post(net_->io, [net = net_.get(), config = std::move(config)]() mutable {
    net->link.logIn(std::move(config));
  });
}

void LabConnection::logOut() {
  {
    const std::scoped_lock lock(net_->mutex);
    net_->state.phase = LinkPhase::kLoggedOut;
    net_->state.trouble = {};
    net_->state.away_since_ns = net_->state.next_try_ns = 0;
  }
  asio::post(net_->io, [net = net_.get()] { net->link.logOut("logged out"); });
}

void LabConnection::retryNow() {
  {
    const std::scoped_lock lock(net_->mutex);
    if (net_->state.phase == LinkPhase::kRefused) net_->state.phase = LinkPhase::kConnecting;
  }
  asio::post(net_->io, [net = net_.get()] { net->link.retryNow(); });
}

void LabConnection::watchAll(double rate_hz) {
  asio::post(net_->io, [net = net_.get(), rate_hz] {
    if (net->overview_hz) return;
    net->overview_hz = rate_hz;
    net->subscribe(kOverviewSubscription, {}, rate_hz);
  });
}

void LabConnection::watch(const std::string& station) {
  asio::post(net_->io, [net = net_.get(), station] {
    const auto [place, is_new] = net->watched.try_emplace(station, net->next_subscription);
    if (!is_new) return;
    ++net->next_subscription;
    net->subscribe(place->second, station, 0);
  });
}

void LabConnection::unwatch(const std::string& station) {
  asio::post(net_->io, [net = net_.get(), station] {
    const auto found = net->watched.find(station);
    if (found == net->watched.end()) return;
    pb::Envelope envelope;
    envelope.mutable_unsubscribe()->set_subscription(found->second);
    net->link.send(envelope);
    net->watched.erase(found);
  });
}

void LabConnection::ask(pb::Request request, Answer answer, OnLoss on_loss) {
  asio::post(net_->io, [net = net_.get(), request = std::move(request), answer = std::move(answer),
                        on_loss]() mutable {
    // a later poll runs the answer
    const auto keep = [net, answer = std::move(answer)](Result<pb::Reply> reply) {
      const std::scoped_lock lock(net->mutex);
      net->answers.push_back([answer, reply = std::move(reply)]() mutable { answer(std::move(reply)); });
    };
    net->ask(std::move(request), keep, on_loss);
  });
}

Result<pb::Reply> LabConnection::call(pb::Request request, const std::function<bool()>& stopped) {
  struct Shared {
    std::mutex mutex;
    std::condition_variable came;
    std::optional<Result<pb::Reply>> reply;
  };
  const auto shared = std::make_shared<Shared>();
  asio::post(net_->io, [net = net_.get(), shared, request = std::move(request)]() mutable {
    const auto hand_over = [shared](Result<pb::Reply> reply) {
      const std::scoped_lock lock(shared->mutex);
      shared->reply.emplace(std::move(reply));
      shared->came.notify_all();
    };
    net->ask(std::move(request), hand_over, OnLoss::kResend);
  });
  TimeSource& time = net_->settings.clock->time();
  std::unique_lock lock(shared->mutex);
  while (!shared->reply) {
    time.waitUntilNs(shared->came, lock, time.nowNs() + kStopPollPeriod_ns);
    if (!shared->reply && stopped && stopped()) return Error{ErrorCode::kFailed, "stopped"};
  }
  return std::move(*shared->reply);
}

LabNews LabConnection::poll() {
  LabNews news;
  std::vector<std::function<void()>> answers;
  {
    const std::scoped_lock lock(net_->mutex);
    news.frames.assign(std::make_move_iterator(net_->frames.begin()),
                       std::make_move_iterator(net_->frames.end()));
    net_->frames.clear();
    for (const std::string& name : net_->status_order)
      news.statuses.push_back(std::move(net_->statuses[name]));
    net_->status_order.clear();
    net_->statuses.clear();
    answers.swap(net_->answers);
  }
  // without the lock: an answer's callback may send another request
  for (auto& answer : answers) answer();
  return news;
}

LinkState LabConnection::state() const {
  const std::scoped_lock lock(net_->mutex);
  return net_->state;
}

}  // namespace needlelab
