#include "common/gesture/pose_track.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "common/base/histogram.h"
#include "common/base/plausible.h"
#include "common/base/range.h"
#include "common/base/text/csv.h"
#include "common/gesture/whole_recording.h"

namespace needlelab {
namespace {

constexpr double kMaxPosition_m = 1e3;        // as in a profile's vectors
constexpr double kQuaternionSlack = 1e-3;     // as client/sim/README.md says
constexpr double kPlungerSlack = 0x1p-15;     // a step of stored plungers (FORMAT.md)
constexpr std::size_t kMaxRows = 50'000'000;  // of a CSV

double lerp(double a, double b, double share) {
  return a + (b - a) * share;
}

// linear, on the shorter of the two ways, then normalised
Quat nlerp(Quat a, Quat b, double share) {
  if (dot(a, b) < 0) b = {-b.x, -b.y, -b.z, -b.w};
  return normalized(
      Quat{lerp(a.x, b.x, share), lerp(a.y, b.y, share), lerp(a.z, b.z, share), lerp(a.w, b.w, share)});
}

// calls `row_is(i)` or `between(i, share)` for each tick, in order
template <typename RowIs, typename Between>
void forEachTick(const PoseTrack& track, double rate_hz, RowIs row_is, Between between) {
  const std::size_t ticks = tickCount(track, rate_hz);
  const std::size_t last = track.t_s.size() - 1;
  std::size_t row = 0;
  for (std::size_t k = 0; k < ticks; ++k) {
    const double t = track.t_s.front() + static_cast<double>(k) / rate_hz;
    // the last row that is not after the tick
    while (row < last && track.t_s[row + 1] <= t + kOnTick_s) ++row;
    if (row == last || std::abs(track.t_s[row] - t) <= kOnTick_s)
      row_is(row);
    else
      between(row, (t - track.t_s[row]) / (track.t_s[row + 1] - track.t_s[row]));
  }
}

// the rows that come after a hole
std::vector<std::size_t> holesIn(const std::vector<double>& t_s) {
  std::vector<std::size_t> holes;
  if (t_s.size() < 3) return holes;
  std::vector<double> periods;
  for (std::size_t i = 1; i < t_s.size(); ++i) periods.push_back(t_s[i] - t_s[i - 1]);
  const double max_s = std::max(3 * medianOf(periods), kMaxGap_s) + kOnTick_s;
  for (std::size_t i = 0; i < periods.size(); ++i)
    if (periods[i] > max_s) holes.push_back(i + 1);
  return holes;
}

Status checkWays(const std::string& where, const CsvTable& table) {
  for (const char* const name : {"px_m", "py_m", "pz_m"}) {
    const auto& column = table.columns[static_cast<std::size_t>(table.find(name))];
    const auto [least, greatest] = std::minmax_element(column.begin(), column.end());
    RETURN_IF_ERROR(checkPlausible(
        fmt::format("{}: the way of {} ({} to {})", where, name, numberText(*least), numberText(*greatest)),
        Quantity::kWay, *greatest - *least));
  }
  return {};
}

}  // namespace

Result<PoseTrack> readPoseTrack(const std::filesystem::path& path, const TrackReading& reading) {
  auto table = readCsv(path, {"t_s", "px_m", "py_m", "pz_m", "qx", "qy", "qz", "qw"}, {"plunger"},
                       {.max_rows = kMaxRows, .lines_above = reading.lines_above});
  if (!table.ok()) return table.error();
  const auto column = [&](const char* name) -> const std::vector<double>& {
    return table->columns[static_cast<std::size_t>(table->find(name))];
  };
  const auto fail = [&](std::size_t row, const std::string& why) {
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{} row {} (line {}): {}", path.string(), row + 1, table->lines[row], why)};
  };

  PoseTrack track;
  track.t_s = column("t_s");
  const auto &px = column("px_m"), &py = column("py_m"), &pz = column("pz_m");
  const auto &qx = column("qx"), &qy = column("qy"), &qz = column("qz"), &qw = column("qw");
  track.X_WH.reserve(table->rows());
  for (std::size_t i = 0; i < table->rows(); ++i) {
    if (i > 0 && !(track.t_s[i] > track.t_s[i - 1]))
      return fail(
          i, fmt::format("t_s {} is {} {} of the row before; times must ascend{}", numberText(track.t_s[i]),
                         track.t_s[i] == track.t_s[i - 1] ? "the same as" : "before",
                         numberText(track.t_s[i - 1]),
                         track.t_s[i] == track.t_s[i - 1] ? ": were they written with too few digits?" : ""));
    const std::pair<const char*, double> positions[] = {{"px_m", px[i]}, {"py_m", py[i]}, {"pz_m", pz[i]}};
    for (const auto& [name, value] : positions)
      if (std::abs(value) > kMaxPosition_m)
        return fail(i, fmt::format("{} is {}, allowed is -1000 to 1000 m ({})", name, numberText(value),
                                   implausible(Quantity::kWay, value)));
    const Quat q{qx[i], qy[i], qz[i], qw[i]};
    const double length = std::sqrt(dot(q, q));
    if (!(std::abs(length - 1) <= kQuaternionSlack))
      return fail(
          i, "the quaternion qx,qy,qz,qw has length " + numberText(length) + ", allowed is 0.999 to 1.001");
    track.X_WH.push_back({{px[i], py[i], pz[i]}, normalized(q)});
  }
  RETURN_IF_ERROR(checkTimeStep(path.string(), track.t_s));
  RETURN_IF_ERROR(checkWays(path.string(), *table));
  for (const std::size_t gap : holesIn(track.t_s)) {
    const std::string jump =
        fmt::format("t_s jumps from {} to {}", numberText(track.t_s[gap - 1]), numberText(track.t_s[gap]));
    if (!reading.bridges_holes)
      return fail(gap, fmt::format("{}: at most three usual periods, or {} s, may lie between two rows "
                                   "(needlelab-sim bridges it with --damaged)",
                                   jump, numberText(kMaxGap_s)));
    track.holes.push_back(fmt::format("{} row {} (line {}): {}: a straight line bridges it", path.string(),
                                      gap + 1, table->lines[gap], jump));
  }
  if (const int at = table->find("plunger"); at >= 0) {
    track.plunger = table->columns[static_cast<std::size_t>(at)];
    for (std::size_t i = 0; i < track.plunger.size(); ++i)
      if (track.plunger[i] < 0 || track.plunger[i] > 1)
        return fail(i, fmt::format("plunger is {}, allowed is 0 to 1{}{}", numberText(track.plunger[i]),
                                   track.plunger[i] > 1 ? ": " : "",
                                   implausible(Quantity::kShare, track.plunger[i])));
  }
  return track;
}

Result<PoseTrack> readRecordedTrack(const std::filesystem::path& path, const Pose& X_HT) {
  const Pose X_TH = inverse(X_HT);
  PoseTrack track;
  std::int64_t first_ns = 0, last_ns = 0;
  const auto add = [&](const GestureSample& sample) -> Status {
    const auto fail = [&](const std::string& why) {
      return Error{ErrorCode::kInvalidInput, fmt::format("{} sample {} (tick {}): {}", path.string(),
                                                         track.t_s.size() + 1, sample.tick, why)};
    };
    if (track.t_s.empty()) first_ns = last_ns = sample.time_ns;
    if (!track.t_s.empty() && sample.time_ns <= last_ns)
      return fail(fmt::format("time_ns {} comes after {} of the sample before; times must ascend",
                              sample.time_ns, last_ns));
    last_ns = sample.time_ns;
    for (const double metres : sample.p_WT_m)
      if (!(std::abs(metres) <= kMaxPosition_m))
        return fail("the tip's position is " + numberText(metres) + ", allowed is -1000 to 1000 m");
    const Quat q{sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]};
    const double length = std::sqrt(dot(q, q));
    if (!(std::abs(length - 1) <= kQuaternionSlack))
      return fail("the tip's quaternion has length " + numberText(length) + ", allowed is 0.999 to 1.001");
    if (!(sample.plunger >= -kPlungerSlack && sample.plunger <= 1 + kPlungerSlack))
      return fail("plunger is " + numberText(sample.plunger) + ", allowed is 0 to 1");
    track.t_s.push_back(
        1e-9 * static_cast<double>(static_cast<std::int64_t>(static_cast<std::uint64_t>(sample.time_ns) -
                                                             static_cast<std::uint64_t>(first_ns))));
    const Pose X_WT{{sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]}, normalized(q)};
    track.X_WH.push_back(X_WT * X_TH);
    track.plunger.push_back(std::clamp(sample.plunger, 0.0, 1.0));
    return {};
  };
  // reports a hole before a sample that cannot be played: a damaged recording is read to its end first
  Status unplayable;
  const auto read = readRecordingByChunk(path, DamagedRecording::kRefuse,
                                         [&](std::span<const GestureSample> samples) -> Status {
                                           for (const GestureSample& sample : samples) {
                                             if (!unplayable.ok()) break;
                                             unplayable = add(sample);
                                           }
                                           return {};
                                         });
  if (!read.ok()) return read.error();
  RETURN_IF_ERROR(unplayable);
  if (track.t_s.empty()) return Error{ErrorCode::kInvalidInput, path.string() + ": has no samples to play"};
  return track;
}

std::size_t tickCount(const PoseTrack& track, double rate_hz) {
  const double duration_s = track.t_s.back() - track.t_s.front();
  return static_cast<std::size_t>(std::floor((duration_s + kOnTick_s) * rate_hz)) + 1;
}

std::vector<Pose> resamplePoses(const PoseTrack& track, double rate_hz) {
  std::vector<Pose> poses;
  poses.reserve(tickCount(track, rate_hz));
  forEachTick(
      track, rate_hz, [&](std::size_t i) { poses.push_back(track.X_WH[i]); },
      [&](std::size_t i, double share) {
        const Pose &a = track.X_WH[i], &b = track.X_WH[i + 1];
        const Vec3 p{lerp(a.p.x, b.p.x, share), lerp(a.p.y, b.p.y, share), lerp(a.p.z, b.p.z, share)};
        poses.push_back({p, nlerp(a.q, b.q, share)});
      });
  return poses;
}

std::vector<double> resamplePlunger(const PoseTrack& track, double rate_hz) {
  std::vector<double> plunger;
  if (track.plunger.empty()) return plunger;
  plunger.reserve(tickCount(track, rate_hz));
  forEachTick(
      track, rate_hz, [&](std::size_t i) { plunger.push_back(track.plunger[i]); },
      [&](std::size_t i, double share) {
        plunger.push_back(lerp(track.plunger[i], track.plunger[i + 1], share));
      });
  return plunger;
}

}  // namespace needlelab
