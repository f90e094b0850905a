#include "client/instructor/model/lab_connection.h"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>

#include "client/net/backoff.h"
#include "common/base/clock.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

constexpr std::uint32_t kOverviewSubscription = 1;

/// Who may see a lab: the roles that may list its stations.
bool isStaff(pb::Role role) {
  return role == pb::INSTRUCTOR || role == pb::CURRICULUM_MANAGER || role == pb::ADMINISTRATOR;
}

Error lostBeforeAnswer(const std::string& why) {
  return {ErrorCode::kUnavailable,
          why + ": the answer did not come; look whether it happened before you do it again"};
}

}  // namespace

struct LabConnection::Net {
  struct Waiting {
    pb::Request request;
    Answer answer;
    OnLoss on_loss = OnLoss::kAskAgain;
    bool here = false;  // the answer runs on the network's thread
    std::int64_t until_ns = 0;
  };

  explicit Net(LabConnectionSettings chosen)
      : settings(std::move(chosen)),
        backoff(static_cast<std::uint64_t>(steadyNowNs()), {settings.first_retry, settings.most_retry, 2.0}) {
    asio::co_spawn(io, run(), rethrow);
    asio::co_spawn(io, watchTimes(), rethrow);
    thread = std::thread([this] { io.run(); });
  }

  // --- on the network's thread

  Task<> run();
  Task<> pause(std::chrono::milliseconds time);
  Task<> serve(ClientConnection connection);
  Task<> watchTimes();
  void take(pb::Envelope envelope);
  void takeAnswer(std::uint64_t id, Result<pb::Reply> reply);
  void deliver(Waiting& waiting, Result<pb::Reply> reply);
  void send(std::uint64_t id, const Waiting& waiting);
  void subscribe(std::uint32_t number, const std::string& station, double rate_hz);
  void ask(Waiting waiting);
  void lose(const std::string& why);
  void setTrouble(LinkPhase phase, const Error& why, std::int64_t next_try_ns);
  void endAll(const Error& why);
  [[nodiscard]] bool online() const { return channel && !channel->closing(); }

  LabConnectionSettings settings;
  Backoff backoff;
  asio::io_context io{1};
  asio::executor_work_guard<asio::io_context::executor_type> guard{io.get_executor()};
  asio::steady_timer nap{io};  // what run() waits for; cancelled by logIn, logOut, retryNow, the end
  std::optional<LabLogin> login;
  std::uint64_t login_number = 0;  // which log-in is meant
  std::string token;
  std::int64_t token_until_unix_ns = 0;
  std::shared_ptr<Channel> channel;
  std::optional<Error> ended;  // the server's own word on the end
  std::optional<double> overview_hz;
  std::map<std::string, std::uint32_t> watched;
  std::uint32_t next_subscription = kOverviewSubscription + 1;
  std::uint64_t next_request = 1;
  std::map<std::uint64_t, Waiting> waiting;
  bool stopping = false;

  // --- shared
  mutable std::mutex mutex;
  LinkState state;
  std::deque<LiveArrival> frames;
  std::map<std::string, pb::StationStatus> statuses;
  std::vector<std::string> status_order;
  std::vector<std::function<void()>> answers;

  std::thread thread;
};

Task<> LabConnection::Net::pause(std::chrono::milliseconds time) {
  nap.expires_after(time);
  co_await nap.async_wait(kUseTuple);
}

Task<> LabConnection::Net::run() {
  while (!stopping) {
    if (!login) {
      co_await pause(std::chrono::hours(1));
      continue;
    }
    const std::uint64_t number = login_number;
    const std::string server = endpointText(login->server);
    {
      const std::scoped_lock lock(mutex);
      if (state.phase != LinkPhase::kAway) state.phase = LinkPhase::kConnecting;
    }
    ClientConfig config;
    config.server = login->server;
    config.ca_file = login->ca_file;
    config.program = programText(settings.program);
    // frames should wait in the server's queue, where the old ones are dropped, rather than in the kernel
    config.limits.socket_buffer_bytes = 256 << 10;
    config.limits.close_grace = std::chrono::milliseconds(300);
    config.login = personLogin(login->user, login->password);
    const bool by_token = !token.empty() && token_until_unix_ns > wallNowNs();
    if (by_token) config.login.set_token(token);
    auto connection = co_await connectClient(std::move(config));
    if (stopping) break;
    if (number != login_number) {
      if (connection.ok()) connection->channel->finish(CloseReason::kLocal, "another log-in");
      continue;
    }
    if (connection.ok() && !isStaff(connection->welcome.role())) {
      connection->channel->finish(CloseReason::kLocal, "not for this role");
      connection = Error{ErrorCode::kDenied, "the peer refused (ROLE): '" + connection->welcome.name() +
                                                 "' is no instructor, and this program is for instructors"};
    }
    if (!connection.ok()) {
      const Error& why = connection.error();
      if (by_token && why.code == ErrorCode::kDenied) {
        // the server started again and knows its old tokens no more: with the password, at once
        token.clear();
        continue;
      }
      if (troubleOf(why, server).needs_person) {
        setTrouble(LinkPhase::kRefused, why, 0);
        co_await pause(std::chrono::hours(24));
      } else {
        const auto wait = backoff.next();
        setTrouble(LinkPhase::kAway, why, steadyNowNs() + std::chrono::nanoseconds(wait).count());
        co_await pause(wait);
      }
      continue;
    }
    const std::int64_t connected_ns = steadyNowNs();
    co_await serve(std::move(*connection));
    const Error why =
        ended ? *ended : Error{ErrorCode::kUnavailable, "the connection is lost: " + channel->closeText()};
    // what is queued (our goodbye) still has to go; the channel bounds the time
    while (!channel->closed()) co_await pause(std::chrono::milliseconds(10));
    channel.reset();
    lose(why.message);
    if (stopping || number != login_number) continue;
    if (steadyNowNs() - connected_ns > std::chrono::nanoseconds(settings.most_retry).count()) backoff.reset();
    if (why.code == ErrorCode::kDenied) {
      token.clear();
      setTrouble(LinkPhase::kRefused, why, 0);
      co_await pause(std::chrono::hours(24));
      continue;
    }
    const auto wait = backoff.next();
    setTrouble(LinkPhase::kAway, why, steadyNowNs() + std::chrono::nanoseconds(wait).count());
    co_await pause(wait);
  }
  endAll({ErrorCode::kFailed, "the program ends"});
  io.stop();
}

Task<> LabConnection::Net::serve(ClientConnection connection) {
  channel = connection.channel;
  ended.reset();
  token = connection.welcome.token();
  token_until_unix_ns = connection.welcome.token_expires_unix_ns();
  {
    const std::scoped_lock lock(mutex);
    state.phase = LinkPhase::kOnline;
    state.trouble = {};
    state.away_since_ns = state.next_try_ns = 0;
    state.role = connection.welcome.role();
    state.server_version = connection.welcome.server_version();
    ++state.connections;
  }
  if (overview_hz) subscribe(kOverviewSubscription, {}, *overview_hz);
  for (const auto& [station, number] : watched) subscribe(number, station, 0);
  for (const auto& [id, each] : waiting) send(id, each);
  for (;;) {
    auto got = co_await channel->receive();
    if (!got.ok()) {
      channel->finish(CloseReason::kProtocol, got.error().message);
      co_return;
    }
    take(std::move(*got));
  }
}

// requests that wait too long are given up
Task<> LabConnection::Net::watchTimes() {
  asio::steady_timer timer(io);
  while (!stopping) {
    timer.expires_after(std::chrono::milliseconds(250));
    co_await timer.async_wait(kUseTuple);
    const std::int64_t now_ns = steadyNowNs();
    for (auto it = waiting.begin(); it != waiting.end();) {
      if (it->second.until_ns > now_ns) {
        ++it;
        continue;
      }
      deliver(it->second, lostBeforeAnswer("the server did not answer in time"));
      it = waiting.erase(it);
    }
    const std::scoped_lock lock(mutex);
    state.waiting = waiting.size();
  }
}

void LabConnection::Net::take(pb::Envelope envelope) {
  if (envelope.has_ping()) {
    channel->send(pongTo(envelope.ping()));
  } else if (envelope.has_live_frame()) {
    const std::int64_t now_ns = wallNowNs();
    const std::scoped_lock lock(mutex);
    ++state.frames;
    if (frames.size() >= settings.most_frames) {
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
  } else if (envelope.has_reply()) {
    const std::uint64_t id = envelope.reply().id();
    takeAnswer(id, std::move(*envelope.mutable_reply()));
  } else if (envelope.has_refusal()) {
    const Error error = errorOf(envelope.refusal());
    if (envelope.refusal().fatal()) ended = error;
    if (envelope.refused_request() != 0) takeAnswer(envelope.refused_request(), error);
  } else if (envelope.has_bye()) {
    ended = Error{ErrorCode::kUnavailable, "the server said bye: " + envelope.bye().reason()};
  }
}

void LabConnection::Net::takeAnswer(std::uint64_t id, Result<pb::Reply> reply) {
  const auto found = waiting.find(id);
  if (found == waiting.end()) return;
  Waiting done = std::move(found->second);
  waiting.erase(found);
  deliver(done, std::move(reply));
}

void LabConnection::Net::deliver(Waiting& done, Result<pb::Reply> reply) {
  if (done.here) {
    done.answer(std::move(reply));
    return;
  }
  const std::scoped_lock lock(mutex);
  answers.push_back(
      [answer = std::move(done.answer), reply = std::move(reply)]() mutable { answer(std::move(reply)); });
}

void LabConnection::Net::send(std::uint64_t id, const Waiting& one) {
  if (!online()) return;
  pb::Envelope envelope;
  *envelope.mutable_request() = one.request;
  envelope.mutable_request()->set_id(id);
  channel->send(envelope);
}

void LabConnection::Net::subscribe(std::uint32_t number, const std::string& station, double rate_hz) {
  if (!online()) return;
  pb::Envelope envelope;
  envelope.mutable_subscribe()->set_subscription(number);
  envelope.mutable_subscribe()->set_station(station);
  envelope.mutable_subscribe()->set_rate_hz(rate_hz);
  channel->send(envelope);
}

void LabConnection::Net::ask(Waiting one) {
  if (stopping) {
    deliver(one, Error{ErrorCode::kFailed, "the program ends"});
    return;
  }
  if (one.on_loss == OnLoss::kGiveUp && !online()) {
    deliver(one,
            Error{ErrorCode::kUnavailable, "there is no connection to the server now: nothing was done"});
    return;
  }
  if (waiting.size() >= settings.most_waiting) {
    deliver(one, Error{ErrorCode::kUnavailable, "too many requests wait for an answer"});
    return;
  }
  one.until_ns = steadyNowNs() + std::chrono::nanoseconds(settings.answer_time).count();
  const std::uint64_t id = next_request++;
  const auto placed = waiting.emplace(id, std::move(one)).first;
  send(id, placed->second);
}

void LabConnection::Net::lose(const std::string& why) {
  for (auto it = waiting.begin(); it != waiting.end();) {
    if (it->second.on_loss == OnLoss::kAskAgain) {
      ++it;
      continue;
    }
    deliver(it->second, lostBeforeAnswer(why));
    it = waiting.erase(it);
  }
}

void LabConnection::Net::setTrouble(LinkPhase phase, const Error& why, std::int64_t next_try_ns) {
  const std::scoped_lock lock(mutex);
  if (state.away_since_ns == 0) state.away_since_ns = steadyNowNs();
  state.phase = phase;
  state.trouble = troubleOf(why, state.server);
  state.next_try_ns = next_try_ns;
}

void LabConnection::Net::endAll(const Error& why) {
  for (auto& [id, one] : waiting) deliver(one, why);
  waiting.clear();
}

LabConnection::LabConnection(LabConnectionSettings settings)
    : net_(std::make_unique<Net>(std::move(settings))) {}

LabConnection::~LabConnection() {
  Net& net = *net_;
  asio::post(net.io, [&net] {
    net.stopping = true;
    if (net.channel) {
      pb::Envelope bye;
      bye.mutable_bye()->set_reason("done");
      net.channel->finish(CloseReason::kLocal, "done", &bye);
      net.nap.cancel();
      return;
    }
    // nothing to say goodbye to: what is being connected is let go
    net.endAll({ErrorCode::kFailed, "the program ends"});
    net.io.stop();
  });
  net.thread.join();
}

void LabConnection::logIn(LabLogin login) {
  {
    const std::scoped_lock lock(net_->mutex);
    net_->state.phase = LinkPhase::kConnecting;
    net_->state.server = endpointText(login.server);
    net_->state.user = login.user;
    net_->state.trouble = {};
    net_->state.away_since_ns = net_->state.next_try_ns = 0;
  }
  asio::post(net_->io, [net = net_.get(), login = std::move(login)]() mutable {
    net->login = std::move(login);
    ++net->login_number;
    net->token.clear();
    net->backoff.reset();
    if (net->channel) net->channel->finish(CloseReason::kLocal, "another log-in");
    net->nap.cancel();
  });
}

void LabConnection::logOut() {
  {
    const std::scoped_lock lock(net_->mutex);
    net_->state.phase = LinkPhase::kLoggedOut;
    net_->state.trouble = {};
    net_->state.away_since_ns = net_->state.next_try_ns = 0;
  }
  asio::post(net_->io, [net = net_.get()] {
    net->login.reset();
    ++net->login_number;
    net->token.clear();
    net->endAll({ErrorCode::kUnavailable, "logged out"});
    pb::Envelope bye;
    bye.mutable_bye()->set_reason("logged out");
    if (net->channel) net->channel->finish(CloseReason::kLocal, "logged out", &bye);
    net->nap.cancel();
  });
}

void LabConnection::retryNow() {
  asio::post(net_->io, [net = net_.get()] { net->nap.cancel(); });
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
    if (net->online()) {
      pb::Envelope envelope;
      envelope.mutable_unsubscribe()->set_subscription(found->second);
      net->channel->send(envelope);
    }
    net->watched.erase(found);
  });
}

void LabConnection::ask(pb::Request request, Answer answer, OnLoss on_loss) {
  asio::post(net_->io,
             [net = net_.get(), request = std::move(request), answer = std::move(answer), on_loss]() mutable {
               net->ask({std::move(request), std::move(answer), on_loss, false, 0});
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
    net->ask({std::move(request),
              [shared](Result<pb::Reply> reply) {
                const std::scoped_lock lock(shared->mutex);
                shared->reply.emplace(std::move(reply));
                shared->came.notify_all();
              },
              OnLoss::kAskAgain, true, 0});
  });
  std::unique_lock lock(shared->mutex);
  while (!shared->reply) {
    shared->came.wait_for(lock, std::chrono::milliseconds(50));
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
  // outside of the lock: an answer may ask again
  for (auto& answer : answers) answer();
  return news;
}

LinkState LabConnection::state() const {
  const std::scoped_lock lock(net_->mutex);
  return net_->state;
}

}  // namespace needlelab
