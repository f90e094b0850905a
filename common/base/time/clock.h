/// The programs' two clocks (engine and gate count ticks and read no clock), and timing of short operations:
/// median and p99 over batches, so that the cost of reading the clock does not matter. Times of day for
/// people: in this machine's time zone (TZ); files, logs and the database keep UTC.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace needlelab {

/// Monotonic time of this machine since some start, in ns (CLOCK_MONOTONIC). No system call through the vDSO.
std::int64_t steadyNowNs() noexcept;

/// Time of day, ns since 1970-01-01 UTC (CLOCK_REALTIME). May jump.
std::int64_t wallNowNs() noexcept;

/// The duration of a short operation, in ns per operation.
struct Timing {
  double median_ns = 0;
  double p99_ns = 0;  ///< p99 of the batches' means: a single slow operation is averaged over its batch
  double min_ns = 0;  ///< the quickest batch: the machine's speed when nothing disturbs it
  double resolution_ns =
      0;  ///< clock resolution per operation: one reading of the clock, divided by the batch size
  std::size_t batches = 0, per_batch = 0;
};

/// Stopwatch for the stages of long work (wall time).
class Stopwatch {
 public:
  /// Seconds since the last lap, or since construction.
  double lap() {
    const std::int64_t now_ns = steadyNowNs();
    const double seconds = static_cast<double>(now_ns - since_ns_) * 1e-9;
    since_ns_ = now_ns;
    return seconds;
  }

 private:
  std::int64_t since_ns_ = steadyNowNs();
};

/// Quantiles of the batches' means (ns per operation); `values` may be in any order. Zero batches give zeros.
/// Quantile q is the smallest value that at least the share q of all values does not exceed.
Timing timingOf(std::vector<double> means_ns, std::size_t per_batch);
/// For work whose speed drifts: cuts `means_ns`, in the order of measurement, into `runs` equal runs (at
/// least 1, at most one per value). Each quantile is the median over the runs (for an even number of runs,
/// the lower of the two middle ones), so p99 is never below the median.
Timing timingOfRuns(const std::vector<double>& means_ns, std::size_t per_batch, std::size_t runs);

/// The cost of one reading of the clock (median of 1,000), in ns; measured once per process.
double clockCost_ns();

/// Keeps the compiler from optimising away the work that computed `value`.
template <typename T>
inline void keep(const T& value) {
  asm volatile("" : : "g"(&value) : "memory");
}

/// Calls `operation()` `batches` × `per_batch` times, after one batch to warm up (hot caches), and appends
/// the batches' means, in ns per operation. The cost of one reading of the clock is subtracted. Thread: any;
/// run it alone on its core for good figures.
template <typename Operation>
void measureBatches(std::size_t batches, std::size_t per_batch, Operation&& operation,
                    std::vector<double>& means_ns) {
  for (std::size_t i = 0; i < per_batch; ++i) operation();
  const double clock_ns = clockCost_ns();
  for (std::size_t b = 0; b < batches; ++b) {
    const std::int64_t from_ns = steadyNowNs();
    for (std::size_t i = 0; i < per_batch; ++i) operation();
    const auto took_ns = static_cast<double>(steadyNowNs() - from_ns);
    means_ns.push_back(std::max(0.0, took_ns - clock_ns) / static_cast<double>(per_batch));
  }
}

/// As measureBatches, returning quantiles.
template <typename Operation>
Timing timeBatches(std::size_t batches, std::size_t per_batch, Operation&& operation) {
  std::vector<double> means_ns;
  means_ns.reserve(batches);
  measureBatches(batches, per_batch, operation, means_ns);
  return timingOf(std::move(means_ns), per_batch);
}

/// As timeBatches, for about `budget_s`: batches are at least 100 times as long as a reading of the clock,
/// and there are 50 to 4,000 of them.
template <typename Operation>
Timing timeFor(double budget_s, Operation&& operation) {
  constexpr std::size_t kMaxPerBatch = 4096;
  const double min_batch_ns = 100 * clockCost_ns();
  // estimate the cost: double the count until the run is long enough to measure
  std::size_t per_batch = 1;
  double batch_ns = 0;
  while (true) {
    // take the quickest of three: an interruption would make a run look long enough
    for (int look = 0; look < 3; ++look) {
      const std::int64_t from_ns = steadyNowNs();
      for (std::size_t i = 0; i < per_batch; ++i) operation();
      const auto took_ns = static_cast<double>(steadyNowNs() - from_ns);
      batch_ns = look == 0 ? took_ns : std::min(batch_ns, took_ns);
    }
    if (batch_ns >= min_batch_ns || per_batch >= kMaxPerBatch) break;
    per_batch *= 2;
  }
  const double wanted = budget_s * 1e9 / std::max(batch_ns, 1.0);
  return timeBatches(static_cast<std::size_t>(std::clamp(wanted, 50.0, 4000.0)), per_batch, operation);
}

enum class TimeForm : std::uint8_t {
  kDay,     ///< 2026-07-01
  kMinute,  ///< 2026-07-01 09:34
  kClock,   ///< 09:34:56
  kWords,   ///< 1 July 2026, 09:34: in a sentence
  kZoned,   ///< 2026-07-01 09:34:56 NDT: for texts that may be read in another zone
};

/// A time, ns since 1970, in local form; "-" for 0 (never) and for times that no calendar can express.
std::string localTime(std::int64_t unix_ns, TimeForm form);

/// "2026-07-01 12:04:56 UTC": for texts that are stored.
std::string utcTime(std::int64_t unix_ns);
/// UTC in ISO 8601, "2026-07-01T12:04:56Z": for tables that other programs read. Empty for 0 (never).
std::string isoTime(std::int64_t unix_ns);
/// Like isoTime, to the millisecond, rounded down: "2026-07-01T12:04:56.999Z".
std::string isoTimeMs(std::int64_t unix_ns);
/// "2026-07-01 12:04:56", UTC: spreadsheets read it as a date and a time, in any language. Empty for 0
/// (never).
std::string spreadsheetTime(std::int64_t unix_ns);

/// The beginning of a local day, ns since 1970. `day` may be one past the end of the month; it then means the
/// first of the next month. A day lasts 23, 24 or 25 hours: it ends at the beginning of `day + 1`.
std::int64_t localMidnightNs(int year, int month, int day);

}  // namespace needlelab
