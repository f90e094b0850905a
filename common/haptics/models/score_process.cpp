#include "common/haptics/models/score_process.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

#include "common/haptics/det_math.h"

namespace needlelab {
namespace {

constexpr double kRange_m = 1.0;  // maximum depth of a table
constexpr double kCellsPerLength = 4;

// SplitMix64's finaliser (Steele, Lea and Flood 2014): every bit of the result depends on every bit of the
// word
std::uint64_t mixed(std::uint64_t word) noexcept {
  word += 0x9E3779B97F4A7C15ull;
  word = (word ^ (word >> 30)) * 0xBF58476D1CE4E5B9ull;
  word = (word ^ (word >> 27)) * 0x94D049BB133111EBull;
  return word ^ (word >> 31);
}

}  // namespace

std::uint64_t scoreKey(std::uint64_t seed, std::uint64_t insertion) noexcept {
  return mixed(mixed(seed) ^ insertion);
}

double normalOf(std::uint64_t key, std::uint64_t index) noexcept {
  const std::uint64_t first = mixed(key ^ mixed(2 * index)), second = mixed(key ^ mixed(2 * index + 1));
  const double u = static_cast<double>((first >> 11) + 1) * 0x1p-53;  // (0, 1]
  const double turn = static_cast<double>(second >> 11) * 0x1p-53;    // [0, 1)
  return std::sqrt(-2.0 * detLog(u)) * detCos(2.0 * kPi * turn);
}

ScoreProcess::ScoreProcess(double length_m) {
  assert(length_m > 0.0);
  while (levels_ < kMaxScoreLevels && spacing_m_ * kCellsPerLength > length_m) {
    spacing_m_ /= 2;
    const double rho = detExp(-spacing_m_ / length_m);
    bridges_[static_cast<std::size_t>(levels_)] = {rho / (1 + rho * rho),
                                                   std::sqrt((1 - rho * rho) / (1 + rho * rho))};
    ++levels_;
  }
  inverse_spacing_ = 1 / spacing_m_;
  root_rho_ = detExp(-kRange_m / length_m);
  cell_loss_ = 2 * (1 - detExp(-spacing_m_ / length_m));
}

double ScoreProcess::at(std::uint64_t key, double depth_m, ScorePath& path) const noexcept {
  const double place = std::clamp(depth_m, 0.0, kRange_m) * inverse_spacing_;
  const std::int32_t last = (std::int32_t{1} << levels_) - 1;
  assert(path.cell >= -1 && path.cell <= last);
  const std::int32_t cell = std::min(static_cast<std::int32_t>(place), last);
  if (cell != path.cell) {
    // nodes are numbered as in a heap: the ends 0 and 1, then the midpoint of cell i at level l is 2 + 2^l +
    // i
    int level = 0;
    if (path.cell < 0) {
      path.low[0] = normalOf(key, 0);
      path.high[0] = root_rho_ * path.low[0] + std::sqrt(1 - root_rho_ * root_rho_) * normalOf(key, 1);
    } else {
      // keep levels at which the old and the new place share a cell
      level = levels_ - std::bit_width(static_cast<std::uint32_t>(cell ^ path.cell));
    }
    for (; level < levels_; ++level) {
      const auto l = static_cast<std::size_t>(level);
      const std::uint64_t above = static_cast<std::uint64_t>(cell) >> (levels_ - level);
      const double middle = bridges_[l].weight * (path.low[l] + path.high[l]) +
                            bridges_[l].sd * normalOf(key, 2 + ((std::uint64_t{1} << level) + above));
      const bool upper = ((cell >> (levels_ - level - 1)) & 1) != 0;
      path.low[l + 1] = upper ? middle : path.low[l];
      path.high[l + 1] = upper ? path.high[l] : middle;
    }
    path.cell = cell;
  }
  const auto l = static_cast<std::size_t>(levels_);
  const double t = place - cell;
  assert(t >= 0.0 && t <= 1.0);
  const double z = path.low[l] + t * (path.high[l] - path.low[l]);
  return z / std::sqrt(1 - t * (1 - t) * cell_loss_);
}

}  // namespace needlelab
