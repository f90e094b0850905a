#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <memory>

#include "common/base/bytes.h"
#include "common/gesture/chunk.h"
#include "common/gesture/chunk_format.h"
#include "common/gesture/column_coding.h"

namespace needlelab {
namespace {

using namespace chunk_format;
using namespace column_coding;

// the maximum number of steps in a stored integer; a larger value makes its column raw
constexpr double kMaxSteps = 2147483647.0;
// adding this to a double below 2⁵¹ leaves the nearest integer (ties to even) in the low bits: rounding
// without a call
constexpr double kRounder = 0x1.8p52;

double loadReal(const unsigned char* at) {
  double value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

// the two preceding values, then the column's current block
template <typename U>
struct Window {
  U values[2 + kBlock];
  U* block() { return values + 2; }
  void carry(std::size_t rows) {
    const U last = block()[rows - 1], before = block()[static_cast<std::ptrdiff_t>(rows) - 2];
    values[0] = before;
    values[1] = last;
  }
};

/// A chunk under construction. `raw` marks the real columns that are stored as bits.
class Encoder {
 public:
  Encoder(const Resolution& resolution, std::span<const GestureSample> samples, std::uint32_t raw)
      : samples_(samples), raw_(raw), wide_(raw | kClockMask) {
    const auto steps = realSteps(resolution);
    for (std::size_t c = 0; c < kRealCount; ++c) inverse_[c] = steps[c] > 0 ? 1.0 / steps[c] : 0;
    inverse_time_ = 1.0 / static_cast<double>(timeStepNs(resolution));

    // the line through the first and the last sample's clock
    const GestureSample &first = samples.front(), &last = samples.back();
    const auto ticks = static_cast<std::int64_t>(last.tick - first.tick);
    const auto duration = static_cast<std::int64_t>(static_cast<std::uint64_t>(last.time_ns) -
                                                    static_cast<std::uint64_t>(first.time_ns));
    if (ticks > 0 && duration > 0)
      period_ns_ = duration / ticks + (duration % ticks >= ticks - duration % ticks ? 1 : 0);
  }

  std::int64_t periodNs() const { return period_ns_; }
  // columns with a value that cannot be stored in steps
  std::uint32_t misfits() const { return misfits_; }

  std::uint8_t* firstRow(std::uint8_t* out) {
    fill(0, 1);
    for (std::size_t c = 0; c < kColumnCount; ++c) {
      if (wide_ >> c & 1u) {
        std::uint64_t* const v = wide_columns_[c].values;
        v[0] = v[1] = v[2];
        // the clocks' first values are in the header
        if (raw_ >> c & 1u) {
          std::memcpy(out, &v[2], 8);
          out += 8;
        }
      } else {
        std::uint32_t* const v = columns_[c].values;
        v[0] = v[1] = v[2];
        out = putVarint(out, zigzag(v[2]));
      }
    }
    return out;
  }

  std::uint8_t* block(std::size_t first, std::size_t rows, std::uint8_t* out) {
    fill(first, rows);
    std::uint8_t* const mask_at = out;
    std::uint32_t mask = 0;
    out += sizeof mask;
    for (std::size_t c = 0; c < kColumnCount; ++c) {
      std::uint8_t* const start = out;
      if (wide_ >> c & 1u) {
        out = packColumn(wide_columns_[c].block(), rows, out);
        wide_columns_[c].carry(rows);
      } else {
        out = packColumn(columns_[c].block(), rows, out);
        columns_[c].carry(rows);
      }
      if (out != start) mask |= 1u << c;
    }
    std::memcpy(mask_at, &mask, sizeof mask);
    return out;
  }

 private:
  // turns rows [first, first + rows) of the samples into the columns' integers
  void fill(std::size_t first, std::size_t rows) {
    const GestureSample* const s = samples_.data() + first;
    std::uint64_t* const tick = wide_columns_[kTick].block();
    std::uint64_t* const time = wide_columns_[kTime].block();
    for (std::size_t i = 0; i < rows; ++i) {
      const std::uint64_t ticks = s[i].tick - samples_.front().tick;
      tick[i] = ticks - (first + i);
      time[i] = static_cast<std::uint64_t>(s[i].time_ns) -
                static_cast<std::uint64_t>(samples_.front().time_ns) -
                ticks * static_cast<std::uint64_t>(period_ns_);
    }
    fillPresence(s, rows);
    for (std::size_t c = 0; c < kRealCount; ++c) fillReal(c, s, rows);
    fillIntegers(s, rows);
  }

  void fillReal(std::size_t c, const GestureSample* s, std::size_t rows) {
    const std::size_t column = kFirstReal + c;
    const unsigned char* const at = reinterpret_cast<const unsigned char*>(s) + kRealOffset[c];
    if (raw_ >> column & 1u) {
      std::uint64_t* const v = wide_columns_[column].block();
      for (std::size_t i = 0; i < rows; ++i) v[i] = orderedBits(loadReal(at + i * sizeof *s));
      return;
    }
    std::uint32_t* const v = columns_[column].block();
    const double inverse = inverse_[c];
    const bool is_wall = column >= kWall && column < kWall + 3u;
    const std::uint32_t all_there = is_wall ? 1u << (column - kWall) : 0;
    if (is_wall && (absent_ & all_there) != 0) {
      fillGappy(all_there, at, rows, inverse, v, column);
      return;
    }
    int good = 1;
    for (std::size_t i = 0; i < rows; ++i) {
      const double steps = loadReal(at + i * sizeof(GestureSample)) * inverse;
      good &= static_cast<int>(std::fabs(steps) <= kMaxSteps);
      v[i] = static_cast<std::uint32_t>(std::bit_cast<std::uint64_t>(steps + kRounder));
    }
    if (good == 0) misfits_ |= 1u << column;
  }

  // a wall column; absent values repeat the previous value, which costs nothing
  void fillGappy(std::uint32_t bit, const unsigned char* at, std::size_t rows, double inverse,
                 std::uint32_t* v, std::size_t column) {
    const std::uint32_t* const there = columns_[kWallPresence].block();
    std::uint32_t last = fresh_ ? 0 : v[-1];
    for (std::size_t i = 0; i < rows; ++i) {
      if ((there[i] & bit) != 0) {
        const double steps = loadReal(at + i * sizeof(GestureSample)) * inverse;
        if (!(std::fabs(steps) <= kMaxSteps)) misfits_ |= 1u << column;
        last = static_cast<std::uint32_t>(std::bit_cast<std::uint64_t>(steps + kRounder));
      }
      v[i] = last;
    }
  }

  // bit k: wall component k is a number, or its column is raw and holds any value
  void fillPresence(const GestureSample* s, std::size_t rows) {
    std::uint32_t* const there = columns_[kWallPresence].block();
    const std::uint32_t always = raw_ >> kWall & 7u;
    std::uint32_t all = 7;
    for (std::size_t i = 0; i < rows; ++i) {
      const double* const w = s[i].wall_W_m;
      const std::uint32_t bits = static_cast<std::uint32_t>(w[0] == w[0]) |
                                 static_cast<std::uint32_t>(w[1] == w[1]) << 1 |
                                 static_cast<std::uint32_t>(w[2] == w[2]) << 2;
      there[i] = bits | always;
      all &= there[i];
    }
    absent_ = ~all & 7u;
  }

  void fillIntegers(const GestureSample* s, std::size_t rows) {
    const auto column = [&](Column c, auto value) {
      std::uint32_t* const v = columns_[c].block();
      for (std::size_t i = 0; i < rows; ++i) v[i] = static_cast<std::uint32_t>(value(s[i]));
    };
    const auto steps = [this](std::int32_t ns) {
      return std::bit_cast<std::uint64_t>(static_cast<double>(ns) * inverse_time_ + kRounder);
    };
    column(kDeviceTime, [&](const GestureSample& x) { return steps(x.device_ns); });
    column(kEngineTime, [&](const GestureSample& x) { return steps(x.engine_ns); });
    column(kFlagsLow, [](const GestureSample& x) { return x.flags & 0xFFFFu; });
    column(kFlagsHigh, [](const GestureSample& x) { return x.flags >> 16; });
    column(kButtons, [](const GestureSample& x) { return x.buttons; });
    column(kLayer, [](const GestureSample& x) { return static_cast<std::int32_t>(x.layer); });
    column(kPhase, [](const GestureSample& x) { return x.phase; });
    column(kFault, [](const GestureSample& x) { return x.fault; });
    fresh_ = false;
  }

  std::span<const GestureSample> samples_;
  std::uint32_t raw_, wide_;
  std::uint32_t misfits_ = 0, absent_ = 0;
  bool fresh_ = true;  ///< no row was filled yet
  std::int64_t period_ns_ = 0;
  double inverse_time_ = 1;
  double inverse_[kRealCount] = {};
  Window<std::uint32_t> columns_[kColumnCount];
  Window<std::uint64_t> wide_columns_[kLastReal + 1];
};

// room for the longest possible chunk of `count` samples
std::size_t worstCase(std::size_t count) {
  constexpr std::size_t kWorstRow = (kLastReal + 1) * 10 + (kColumnCount - kLastReal) * 6;
  constexpr std::size_t kWorstBlock = 4 + (kLastReal + 1) * kMaxColumnBytes<std::uint64_t> +
                                      (kColumnCount - kLastReal) * kMaxColumnBytes<std::uint32_t>;
  constexpr std::size_t kWorstHeader =
      kFixedHeaderBytes + 48 + kCutsHeadBytes + kMaxCutMemoryBytes + kPathsHeadBytes + kMaxPathsBytes;
  static_assert(kWorstHeader + kWorstRow + (kMaxChunkSamples / kBlock) * kWorstBlock + kCrcBytes <=
                kMaxChunkBytes);
  return kWorstHeader + kWorstRow + (count / kBlock + 1) * kWorstBlock + kCrcBytes + kScribble;
}

template <typename T>
std::uint8_t* putValue(std::uint8_t* out, T value) {
  std::memcpy(out, &value, sizeof value);
  return out + sizeof value;
}

std::uint8_t* putBytes(std::uint8_t* out, ByteView bytes) {
  out = putValue(out, static_cast<std::uint16_t>(bytes.size()));
  return std::copy(bytes.begin(), bytes.end(), out);
}

std::uint8_t* putHeader(std::uint8_t* out, const Resolution& resolution,
                        std::span<const GestureSample> samples, ByteView cut_memory, ByteView paths,
                        std::int64_t period_ns, std::uint32_t raw) {
  const std::uint8_t version = !paths.empty()        ? kVersionWithPaths
                               : !cut_memory.empty() ? kVersionWithCuts
                                                     : kVersion;
  const ResolutionCode code = resolution == Resolution::standard()   ? kResolutionStandard
                              : resolution == Resolution::lossless() ? kResolutionLossless
                                                                     : kResolutionListed;
  std::memcpy(out, kMagic.data(), kMagic.size());
  out += kMagic.size();
  out = putValue(out, version);
  out = putValue(out, static_cast<std::uint8_t>(code));
  out = putValue(out, static_cast<std::uint16_t>(samples.size() - 1));
  out = putValue(out, samples.front().tick);
  out = putValue(out, samples.back().tick);
  out = putValue(out, samples.front().time_ns);
  out = putValue(out, period_ns);
  out = putValue(out, raw);
  if (code == kResolutionListed)
    for (const double step : {resolution.length_m, resolution.quaternion, resolution.force_N,
                              resolution.torque_Nm, resolution.time_s, resolution.speed_mps})
      out = putValue(out, step);
  if (version >= kVersionWithCuts) out = putBytes(out, cut_memory);
  if (version >= kVersionWithPaths) out = putBytes(out, paths);
  return out;
}

// work space kept per thread, so that one chunk per second does not allocate
std::uint8_t* scratchOf(std::size_t bytes) {
  thread_local std::unique_ptr<std::uint8_t[]> scratch;
  thread_local std::size_t room = 0;
  if (room < bytes) {
    scratch = std::make_unique_for_overwrite<std::uint8_t[]>(bytes);
    room = bytes;
  }
  return scratch.get();
}

}  // namespace

Bytes encodeChunk(const Resolution& resolution, std::span<const GestureSample> samples, ByteView cut_memory,
                  ByteView paths) {
  const bool valid = !samples.empty() && samples.size() <= kMaxChunkSamples && validate(resolution).ok() &&
                     cut_memory.size() <= kMaxCutMemoryBytes && paths.size() <= kMaxPathsBytes;
  assert(valid && "1 to 65,536 samples, a valid resolution, at most 4,096 bytes of memory, 32,768 of paths");
  if (!valid) return {};

  std::uint8_t* const begin = scratchOf(worstCase(samples.size()));
  for (std::uint32_t raw = declaredRaw(resolution);;) {
    Encoder encoder(resolution, samples, raw);
    std::uint8_t* out = putHeader(begin, resolution, samples, cut_memory, paths, encoder.periodNs(), raw);
    out = encoder.firstRow(out);
    for (std::size_t first = 1; first < samples.size(); first += kBlock)
      out = encoder.block(first, std::min(kBlock, samples.size() - first), out);
    // when a column did not fit, encode the chunk again with that column raw: rare, and at most once, because
    // every row has been seen
    if (encoder.misfits() != 0) {
      raw |= encoder.misfits();
      continue;
    }
    out = putValue(out, crc32c({begin, out}));
    return {begin, out};
  }
}

}  // namespace needlelab
