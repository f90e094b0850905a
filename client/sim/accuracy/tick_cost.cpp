#include "client/sim/accuracy/tick_cost.h"

#include <fmt/core.h>

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <thread>
#include <utility>

#include "common/base/clock.h"

namespace needlelab {
namespace {

double quantile(const std::vector<double>& sorted, double q) {
  if (sorted.empty()) return 0;
  const double rank = std::ceil(q * static_cast<double>(sorted.size()) - 1e-9);
  return sorted[static_cast<std::size_t>(std::max(rank, 1.0)) - 1];
}

double medianOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return quantile(values, 0.5);
}

// all runs' durations of one kind
std::vector<double> pooled(const std::vector<SingleTicks>& runs, std::vector<double> SingleTicks::*kind) {
  std::vector<double> all;
  for (const SingleTicks& run : runs) all.insert(all.end(), (run.*kind).begin(), (run.*kind).end());
  return all;
}

// a quarter more than the last cache, as the machine gives its size; a machine that says nothing, or counts
// the caches of cores that we do not have, gets a usual size
std::size_t flushBytes() {
  constexpr std::size_t kMiB = 1u << 20;
  const long said = ::sysconf(_SC_LEVEL3_CACHE_SIZE);
  const std::size_t cache = said > 0 ? static_cast<std::size_t>(said) : 32 * kMiB;
  return std::clamp(cache, 8 * kMiB, 48 * kMiB) / 4 * 5;
}

class CacheFlush {
 public:
  CacheFlush() : words_(flushBytes() / sizeof(std::uint64_t), 1) {}
  void operator()() const {
    constexpr std::size_t kLine = 64 / sizeof(std::uint64_t);
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < words_.size(); i += kLine) sum += words_[i];
    keep(sum);
  }

 private:
  std::vector<std::uint64_t> words_;  // written once: each page is a page of its own
};

double once_ns(const TimedTick& timed) {
  const std::int64_t from_ns = steadyNowNs();
  timed.tick();
  return static_cast<double>(steadyNowNs() - from_ns);
}

SingleTicks measureRun(const TimedTick& timed, const CostEffort& effort, const CacheFlush& flush) {
  SingleTicks run;
  const auto goOn = [&](std::size_t samples) {
    for (std::size_t i = 1; i < std::max<std::size_t>(1, timed.period / samples); ++i) timed.tick();
  };
  run.hot_ns.reserve(effort.hot);
  run.flushed_ns.reserve(effort.flushed);
  run.slept_ns.reserve(effort.slept);
  for (int warm = 0; warm < 100; ++warm) timed.tick();
  for (std::size_t i = 0; i < effort.hot; ++i) run.hot_ns.push_back(once_ns(timed));
  for (std::size_t i = 0; i < effort.flushed; ++i) {
    goOn(effort.flushed);
    flush();
    run.flushed_ns.push_back(once_ns(timed));
  }
  for (std::size_t i = 0; i < effort.slept; ++i) {
    goOn(effort.slept);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    run.slept_ns.push_back(once_ns(timed));
  }
  return run;
}

}  // namespace

TickQuantiles quantilesOf(std::vector<double> single_ns) {
  std::sort(single_ns.begin(), single_ns.end());
  return {quantile(single_ns, 0.5), quantile(single_ns, 0.99), quantile(single_ns, 0.999)};
}

CostInterval intervalOf(std::vector<double> runs) {
  if (runs.empty()) return {};
  std::sort(runs.begin(), runs.end());
  return {quantile(runs, 0.5), runs.front(), runs.back()};
}

TickCost tickCostOf(const std::vector<SingleTicks>& runs, const std::vector<SingleTicks>& empty) {
  TickCost cost;
  cost.runs = std::min(runs.size(), empty.size());
  std::vector<double> costs_ns, tails_ns;
  for (std::size_t r = 0; r < cost.runs; ++r) {
    costs_ns.push_back(std::max(0.0, medianOf(runs[r].flushed_ns) - medianOf(empty[r].flushed_ns)));
    tails_ns.push_back(std::max(quantilesOf(runs[r].hot_ns).p999_ns, quantilesOf(runs[r].slept_ns).p999_ns));
  }
  cost.tail_ns = medianOf(tails_ns);
  cost.cost_ns = intervalOf(std::move(costs_ns));
  struct Kind {
    std::vector<double> SingleTicks::*single_ns;
    TickQuantiles &ticks, &empty;
    std::size_t& count;
  };
  for (const Kind& kind :
       {Kind{&SingleTicks::hot_ns, cost.hot, cost.hot_empty, cost.hot_count},
        Kind{&SingleTicks::flushed_ns, cost.flushed, cost.flushed_empty, cost.flushed_count},
        Kind{&SingleTicks::slept_ns, cost.slept, cost.slept_empty, cost.slept_count}}) {
    std::vector<double> ticks_ns = pooled(runs, kind.single_ns);
    kind.count = ticks_ns.size();
    kind.ticks = quantilesOf(std::move(ticks_ns));
    kind.empty = quantilesOf(pooled(empty, kind.single_ns));
  }
  return cost;
}

std::vector<TickCost> measureTicks(const std::vector<TimedTick>& ticks, const CostEffort& effort,
                                   const std::function<void(double share)>& done) {
  const CacheFlush flush;
  const TimedTick nothing{[] {}, 1};
  std::vector<std::vector<SingleTicks>> runs(ticks.size());
  std::vector<SingleTicks> empty;
  for (std::size_t r = 0; r < effort.runs; ++r) {
    empty.push_back(measureRun(nothing, effort, flush));
    for (std::size_t i = 0; i < ticks.size(); ++i) {
      runs[i].push_back(measureRun(ticks[i], effort, flush));
      if (done)
        done(static_cast<double>(r * ticks.size() + i + 1) / static_cast<double>(effort.runs * ticks.size()));
    }
  }
  std::vector<TickCost> costs;
  for (const auto& of_one : runs) costs.push_back(tickCostOf(of_one, empty));
  return costs;
}

std::string costText(const TickCost& cost) {
  const std::size_t runs = std::max<std::size_t>(1, cost.runs);
  return fmt::format(
      "time: {} runs of {} hot ticks, {} with flushed caches ({} MiB read before each), {} after 1 ms of "
      "sleep",
      cost.runs, cost.hot_count / runs, cost.flushed_count / runs, flushBytes() >> 20,
      cost.slept_count / runs);
}

}  // namespace needlelab
