#include "tests/load/station_crowd.h"

#include <algorithm>
#include <queue>

#include "common/base/time/clock.h"

namespace needlelab::test {
namespace {

// the network gets a turn after this many frames, even when behind schedule
constexpr std::size_t kFramesAtOnce = 32;
// one wake-up serves all frames due within this time
constexpr std::int64_t kGrid_ns = 1'000'000;

}  // namespace

StationThread::StationThread(LoadShared& shared, std::size_t first, std::size_t of)
    : shared_(shared), first_(first), of_(of) {
  for (std::size_t i = first; i < shared.stations.size(); i += of)
    stations_.push_back(std::make_unique<LoadStation>(shared, i, totals_, net_.io()));
  ended_.resize(stations_.size());
}

StationThread::~StationThread() {
  stop();
}

void StationThread::connect(double per_s) {
  asio::co_spawn(net_.io(), connectAll(per_s), rethrow);
}

Task<> StationThread::connectAll(double per_s) {
  asio::steady_timer timer(net_.io());
  const auto begin = std::chrono::steady_clock::now();
  for (std::size_t i = 0; i < stations_.size() && !stopping_; ++i) {
    timer.expires_at(
        begin + std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * static_cast<double>(i) / per_s)));
    co_await timer.async_wait(kUseTuple);
    stations_[i]->connect();
  }
}

void StationThread::stream() {
  asio::co_spawn(net_.io(), schedule(), rethrow);
}

Task<> StationThread::schedule() {
  using Due = std::pair<std::int64_t, std::size_t>;
  std::priority_queue<Due, std::vector<Due>, std::greater<>> queue;
  for (std::size_t i = 0; i < stations_.size(); ++i) queue.push({stations_[i]->nextDue_ns(), i});
  asio::steady_timer timer(net_.io());
  while (!queue.empty() && !stopping_) {
    std::size_t done = 0;
    while (!queue.empty() && done < kFramesAtOnce && (queue.top().first <= steadyNowNs() || end_now_)) {
      const auto [due_ns, i] = queue.top();
      queue.pop();
      ++done;
      if (end_now_)
        stations_[i]->end();
      else if (stations_[i]->step(steadyNowNs()))
        queue.push({stations_[i]->nextDue_ns(), i});
      ended_[i] = queue.empty() || stations_[i]->ticks() >= shared_.ticks || end_now_;
    }
    if (done == kFramesAtOnce) {
      co_await asio::post(net_.io(), asio::use_awaitable);
    } else if (!queue.empty()) {
      const std::int64_t wake_ns = (queue.top().first / kGrid_ns + 1) * kGrid_ns;
      timer.expires_at(std::chrono::steady_clock::time_point(std::chrono::nanoseconds(wake_ns)));
      co_await timer.async_wait(kUseTuple);
    }
  }
  // all at once, as at the end of a lab; the streaming figures do not include the server's scoring
  for (const auto& station : stations_) station->close();
}

void StationThread::endNow() {
  net_.call([this] { end_now_ = true; });
}

void StationThread::cut(std::size_t station) {
  net_.call([this, station] { stations_[(station - first_) / of_]->cut(); });
}

void StationThread::tell(CrowdState& state) {
  net_.call([&] {
    for (std::size_t i = 0; i < stations_.size(); ++i) {
      const LoadStation& station = *stations_[i];
      state.opened += station.opened() ? 1 : 0;
      state.whole += station.whole_ns() != 0 ? 1 : 0;
      state.watched += station.watched() ? 1 : 0;
      state.ended += ended_[i] ? 1 : 0;
      state.closed += station.closed() ? 1 : 0;
      state.finished += station.finished() ? 1 : 0;
      state.samples_made += station.ticks();
      const std::string& trouble = station.trouble().empty() ? station.lastError() : station.trouble();
      if (!station.closed() && !trouble.empty())
        state.trouble = shared_.stations[first_ + i * of_].name + ": " + trouble;
    }
    state.samples_sent += totals_.samples_sent;
    state.samples_acked += totals_.samples_acked;
  });
}

void StationThread::tellWhole(std::vector<std::int64_t>& since_ns) {
  net_.call([&] {
    for (const auto& station : stations_)
      if (station->whole_ns() != 0) since_ns.push_back(station->whole_ns());
  });
}

void StationThread::addTotals(StationTotals& totals) {
  if (stopping_)
    totals.add(totals_);
  else
    net_.call([&] { totals.add(totals_); });
}

void StationThread::tellTicks(std::vector<std::uint64_t>& ticks) const {
  for (std::size_t i = 0; i < stations_.size(); ++i) ticks[first_ + i * of_] = stations_[i]->ticks();
}

void StationThread::stop() {
  if (stopping_) return;
  net_.call([this] {
    stopping_ = true;
    for (const auto& station : stations_) station->stop();
  });
  // lets the woken coroutines finish
  for (int i = 0; i < 3; ++i) net_.call([] {});
  net_.stop();
}

StationCrowd::StationCrowd(LoadShared& shared, std::size_t threads) : stations_(shared.stations.size()) {
  const std::size_t of = std::clamp<std::size_t>(stations_, 1, threads);
  for (std::size_t first = 0; first < of; ++first)
    threads_.push_back(std::make_unique<StationThread>(shared, first, of));
}

void StationCrowd::connect(double per_s) {
  for (const auto& thread : threads_) thread->connect(per_s / static_cast<double>(threads_.size()));
}

void StationCrowd::stream() {
  for (const auto& thread : threads_) thread->stream();
}

void StationCrowd::endNow() {
  for (const auto& thread : threads_) thread->endNow();
}

void StationCrowd::cut(std::size_t station) {
  threads_[station % threads_.size()]->cut(station);
}

CrowdState StationCrowd::state() {
  CrowdState state;
  for (const auto& thread : threads_) thread->tell(state);
  return state;
}

std::vector<std::int64_t> StationCrowd::wholeSince_ns() {
  std::vector<std::int64_t> since_ns;
  for (const auto& thread : threads_) thread->tellWhole(since_ns);
  return since_ns;
}

std::vector<std::uint64_t> StationCrowd::ticks() const {
  std::vector<std::uint64_t> ticks(stations_);
  for (const auto& thread : threads_) thread->tellTicks(ticks);
  return ticks;
}

StationTotals StationCrowd::totals() {
  StationTotals totals;
  for (const auto& thread : threads_) thread->addTotals(totals);
  return totals;
}

void StationCrowd::stop() {
  for (const auto& thread : threads_) thread->stop();
}

}  // namespace needlelab::test
