#include "tests/load/station_crowd.h"

#include <algorithm>

namespace needlelab::test {

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
