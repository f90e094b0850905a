/// Which fault comes when: random, from a seed.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <vector>

#include "client/device/hand_tremor.h"
#include "tests/load/load_options.h"

namespace needlelab::test {

struct PlannedFault {
  enum class Kind : std::uint8_t {
    kCut,         ///< connections of some stations, without a word
    kKillServer,  ///< kill -9; started again after `time`
    kSlowViewer,  ///< reads nothing for `time`
  };
  Kind kind = Kind::kCut;
  std::vector<std::size_t> who;  ///< stations or viewers
  std::chrono::milliseconds time{0};
};

/// Exponential times between faults, `fault_every_s` on average. The first is a cut, the second a kill, so
/// that a short run has both; later kills come in the first half only: in the second one server lives long
/// enough to show whether its memory stays flat. The same seed plans the same faults. Thread: one.
class FaultPlan {
 public:
  explicit FaultPlan(const LoadOptions& options);

  /// The fault that is due at this time of the run, if any; ask often.
  std::optional<PlannedFault> at(double time_s);

 private:
  void planNext();
  std::size_t stations_, viewers_;
  double every_s_, seconds_, next_s_ = 0;
  std::uint64_t count_ = 0;
  HandRandom random_;
};

}  // namespace needlelab::test
