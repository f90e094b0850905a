#include "tests/postgres/isolation/interleaving.h"
#include "tests/support/patience.h"

#include <chrono>
#include <stdexcept>
#include <thread>
#include <utility>

namespace needlelab::test {
namespace {

/// Whether a program waits for a lock held by another. The one that is held at the gate does not wait for a
/// lock.
bool somebodyWaits(Connection& control) {
  auto waiting = control.prepare(
      "SELECT 1 FROM pg_stat_activity WHERE datname = current_database() AND wait_event_type = 'Lock'"
      " AND backend_type = 'client backend'");
  const auto found = waiting.step();
  if (!found) throw std::runtime_error(found.error().message);
  return *found;
}

}  // namespace

void StatementGate::arm(std::optional<std::size_t> held_before) {
  const std::lock_guard lock(mutex_);
  held_before_ = held_before;
  count_ = 0;
  edges_.clear();
  held_ = ended_ = false;
}

void StatementGate::pass(std::string_view sql) {
  std::unique_lock lock(mutex_);
  if (sql == "BEGIN" || sql == "COMMIT") edges_.push_back(count_);
  if (count_++ != held_before_) return;
  held_ = true;
  changed_.notify_all();
  changed_.wait(lock, [this] { return !held_before_; });
}

void StatementGate::end() {
  const std::lock_guard lock(mutex_);
  ended_ = true;
  changed_.notify_all();
}

bool StatementGate::waitForHoldOrEnd() {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, kPatience, [this] { return held_ || ended_; });
}

bool StatementGate::waitForEnd() {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, std::chrono::milliseconds(1), [this] { return ended_; });
}

void StatementGate::release() {
  const std::lock_guard lock(mutex_);
  held_before_.reset();
  changed_.notify_all();
}

std::size_t StatementGate::count() const {
  const std::lock_guard lock(mutex_);
  return count_;
}

std::vector<std::size_t> StatementGate::edges() const {
  const std::lock_guard lock(mutex_);
  return edges_;
}

OneServer::OneServer(StoreAddress address) : address_(std::move(address)) {
  address_.before_statement = [this](std::string_view sql) { gate_.pass(sql); };
  auto connection = openAt(address_, Connection::Mode::kWriter);
  if (!connection) throw std::runtime_error(connection.error().message);
  DbWriter::Options options;
  options.window = std::chrono::milliseconds(0);
  writer_ = std::make_unique<DbWriter>(std::move(*connection), options, DbWriter::OnFatal());
  readers_ = std::make_unique<ReaderPool>(address_);
  startAnew();
}

void OneServer::startAnew() {
  service_ = std::make_unique<Service>(*writer_, *readers_);
  service_->setRetentionPace({.pause = std::chrono::milliseconds(0)});
}

TwoAnswers runInTurn(OneServer& first_on, const ServerWork& first, OneServer& second_on,
                     const ServerWork& second, const std::function<void()>& between) {
  TwoAnswers answers;
  for (OneServer* server : {&first_on, &second_on}) {
    server->startAnew();
    server->gate().arm({});
  }
  answers.first = first(first_on);
  between();
  answers.second = second(second_on);
  return answers;
}

TwoAnswers runInterleaved(OneServer& first_on, const ServerWork& first, OneServer& second_on,
                          const ServerWork& second, std::size_t held_before, Connection& control) {
  TwoAnswers answers;
  first_on.startAnew();
  second_on.startAnew();
  first_on.gate().arm(held_before);
  second_on.gate().arm({});
  std::thread first_thread([&] {
    answers.first = first(first_on);
    first_on.gate().end();
  });
  bool in_time = first_on.gate().waitForHoldOrEnd();
  answers.was_held = first_on.gate().count() > held_before;
  std::thread second_thread([&] {
    answers.second = second(second_on);
    second_on.gate().end();
  });
  const auto until = std::chrono::steady_clock::now() + kPatience;
  while (in_time && !second_on.gate().waitForEnd()) {
    answers.second_waited = somebodyWaits(control);
    if (answers.second_waited) break;
    in_time = std::chrono::steady_clock::now() < until;
  }
  first_on.gate().release();
  first_thread.join();
  second_thread.join();
  if (!in_time) throw std::runtime_error("neither done nor waiting for a lock within two minutes");
  return answers;
}

}  // namespace needlelab::test
