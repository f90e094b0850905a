#include "server/together/access_listener.h"

#include <fmt/core.h>

#include <algorithm>

namespace needlelab {
namespace {

using Milliseconds = std::chrono::milliseconds;

std::int64_t nsOf(Milliseconds time) {
  return std::chrono::nanoseconds(time).count();
}

}  // namespace

AccessListener::AccessListener(std::unique_ptr<AccessFeed> feed, std::string server, Settings settings,
                               Tell tell, TimeSource& time)
    : feed_(std::move(feed)),
      server_(std::move(server)),
      settings_(settings),
      tell_(std::move(tell)),
      time_(time),
      began_ns_(time.nowNs()),
      pause_(settings.first_pause) {}

AccessListener::~AccessListener() {
  stop();
}

void AccessListener::start() {
  thread_ = std::thread([this] {
    while (!stopping_.load()) turn();
  });
}

void AccessListener::stop() {
  stopping_.store(true);
  if (thread_.joinable()) thread_.join();
}

void AccessListener::turn() {
  if (!is_connected_) {
    if (const std::int64_t now_ns = time_.nowNs(); now_ns < connect_at_ns_)
      time_.sleepUntilNs(std::min(connect_at_ns_, now_ns + nsOf(settings_.slice)));
    else
      connect();
    deliverOwnChanges();
    return;
  }
  const auto heard = feed_->wait(settings_.slice);
  if (!heard)
    lose(heard.error());
  else if (*heard || time_.nowNs() - looked_ns_ >= nsOf(settings_.poll_every))
    look();
  deliverOwnChanges();
}

void AccessListener::connect() {
  if (const Status connected = feed_->connect(); !connected) {
    lose(connected.error());
    return;
  }
  is_connected_ = true;
  faults_looked_ns_ = 0;
  {
    const std::lock_guard lock(mutex_);
    hearing_.is_connected = true;
    ++hearing_.connections;
  }
  // listening: later commits are heard, and earlier ones are read now
  look();
  if (!is_connected_) return;
  pause_ = settings_.first_pause;
  tell_.look_at_all();
}

void AccessListener::look() {
  const std::int64_t now_ns = time_.nowNs();
  looked_ns_ = now_ns;
  if (faults_looked_ns_ == 0 || now_ns - faults_looked_ns_ >= nsOf(settings_.faults_every)) {
    auto fault = feed_->fault();
    if (!fault) return lose(fault.error());
    faults_looked_ns_ = now_ns;
    setFault(std::move(*fault));
  }
  const auto last = feed_->last();
  if (!last) return lose(last.error());
  // log-ins here happened later; or the PostgreSQL server lacks numbers, and all accounts are checked
  if (!knows_number_ || *last < number_) number_ = *last;
  knows_number_ = true;
  if (*last > number_) {
    auto changes = feed_->after(number_);
    if (!changes) return lose(changes.error());
    std::vector<AccessChange> others;
    for (AccessChange& change : *changes) {
      number_ = std::max(number_, change.number);
      if (!server_.empty() && change.server == server_)
        own_.emplace_back(now_ns + nsOf(settings_.own_after), std::move(change));
      else
        others.push_back(std::move(change));
    }
    number_ = std::max(number_, *last);
    {
      const std::lock_guard lock(mutex_);
      hearing_.changes += others.size();
    }
    if (!others.empty()) tell_.changes(std::move(others));
  }
  bool is_faulty = false;
  {
    const std::lock_guard lock(mutex_);
    answered_ns_ = time_.nowNs();
    is_faulty = !hearing_.fault.empty();
  }
  // numbers are not reliable
  if (is_faulty) tell_.look_at_all();
}

void AccessListener::lose(const Error& error) {
  is_connected_ = false;
  connect_at_ns_ = time_.nowNs() + nsOf(pause_);
  pause_ = std::min(2 * pause_, settings_.longest_pause);
  {
    const std::lock_guard lock(mutex_);
    hearing_.is_connected = false;
  }
  setFault("changes of access at other servers are not heard: " + error.message);
}

void AccessListener::deliverOwnChanges() {
  std::vector<AccessChange> due;
  while (!own_.empty() && own_.front().first <= time_.nowNs()) {
    due.push_back(std::move(own_.front().second));
    own_.pop_front();
  }
  if (!due.empty()) tell_.changes(std::move(due));
}

void AccessListener::setFault(std::string fault) {
  {
    const std::lock_guard lock(mutex_);
    if (hearing_.fault == fault) return;
    hearing_.fault = fault;
  }
  tell_.fault(std::move(fault));
}

AccessListener::Hearing AccessListener::hearing() const {
  const std::lock_guard lock(mutex_);
  Hearing hearing = hearing_;
  const std::int64_t silence_ns = time_.nowNs() - (answered_ns_ != 0 ? answered_ns_ : began_ns_);
  if (answered_ns_ != 0) hearing.silence_s = static_cast<double>(silence_ns) / 1e9;
  hearing.is_deaf = silence_ns > nsOf(settings_.deaf_after);
  return hearing;
}

}  // namespace needlelab
