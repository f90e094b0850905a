#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

#include "common/base/bytes.h"
#include "common/gesture/chunk.h"
#include "common/gesture/chunk_format.h"
#include "common/gesture/column_coding.h"

namespace needlelab {
namespace {

using namespace chunk_format;
using namespace column_coding;

struct Header {
  ChunkInfo info;
  std::int64_t period_ns = 0;
  std::uint32_t raw = 0;
  ByteView cut_memory, paths;  ///< in the chunk
  std::size_t bytes = 0;       ///< where the first row starts
};

constexpr std::size_t kCountAt = kMagic.size() + 2;  // after the version and the resolution's code
constexpr std::size_t kSmallestSealedBytes = kCountAt + 2 + kCrcBytes;

Error corrupt(const std::string& why) {
  return {ErrorCode::kCorrupt, "gesture chunk: " + why};
}

bool isKnown(std::uint8_t version) {
  return version >= kVersion && version <= kVersionWithPaths;
}

std::size_t blocksOf(std::size_t count) {
  return (count - 1 + kBlock - 1) / kBlock;
}

Result<Header> readHeader(ByteView chunk) {
  const std::size_t size = chunk.size();
  if (size < kFixedHeaderBytes + kCrcBytes)
    return corrupt(
        fmt::format("it has {} bytes, the header alone takes {}", size, kFixedHeaderBytes + kCrcBytes));
  if (size > kMaxChunkBytes)
    return corrupt(fmt::format("it has {} bytes, at most {} are possible", size, kMaxChunkBytes));
  if (std::memcmp(chunk.data(), kMagic.data(), kMagic.size()) != 0)
    return corrupt("it does not start with the letters NLGC");
  ByteReader in(chunk.first(size - kCrcBytes).subspan(kMagic.size()));
  Header header;
  ChunkInfo& info = header.info;
  info.version = in.get<std::uint8_t>();
  if (!isKnown(info.version))
    return Error{ErrorCode::kVersion,
                 fmt::format("gesture chunk: format version {}; this program reads versions {} to {}",
                             info.version, kVersion, kVersionWithPaths)};
  std::uint32_t stored_crc;
  std::memcpy(&stored_crc, chunk.data() + size - kCrcBytes, kCrcBytes);
  if (crc32c(chunk.first(size - kCrcBytes)) != stored_crc)
    return corrupt("its CRC-32C does not agree with its bytes: damaged or cut off");

  const auto code = in.get<std::uint8_t>();
  info.count = std::uint32_t{in.get<std::uint16_t>()} + 1;
  info.first_tick = in.get<std::uint64_t>();
  info.last_tick = in.get<std::uint64_t>();
  info.first_time_ns = in.get<std::int64_t>();
  header.period_ns = in.get<std::int64_t>();
  header.raw = in.get<std::uint32_t>();
  if (code == kResolutionLossless) {
    info.resolution = Resolution::lossless();
  } else if (code == kResolutionListed) {
    Resolution& r = info.resolution;
    for (double* step : {&r.length_m, &r.quaternion, &r.force_N, &r.torque_Nm, &r.time_s, &r.speed_mps})
      *step = in.get<double>();
    if (!in.ok()) return corrupt("it ends within the resolution");
    if (const Status good = validate(r); !good.ok()) return corrupt(good.error().message);
  } else if (code != kResolutionStandard) {
    return corrupt(fmt::format("resolution code {} is unknown", code));
  }
  if (info.version >= kVersionWithCuts) {
    const std::size_t length = in.get<std::uint16_t>(), least = info.version == kVersionWithCuts ? 1 : 0;
    if (in.ok() && (length < least || length > kMaxCutMemoryBytes))
      return corrupt(fmt::format("its memory of the cut has {} bytes, {} to {} are possible", length, least,
                                 kMaxCutMemoryBytes));
    header.cut_memory = in.take(length);
    if (!in.ok()) return corrupt("it ends within the memory of the cut");
  }
  if (info.version >= kVersionWithPaths) {
    const std::size_t length = in.get<std::uint16_t>();
    if (in.ok() && (length == 0 || length > kMaxPathsBytes))
      return corrupt(
          fmt::format("its paths in a body have {} bytes, 1 to {} are possible", length, kMaxPathsBytes));
    header.paths = in.take(length);
    if (!in.ok()) return corrupt("it ends within the paths in a body");
  }
  const std::uint32_t declared = declaredRaw(info.resolution);
  if ((header.raw & ~kRealMask) != 0 || (declared & ~header.raw) != 0)
    return corrupt("its mask of raw columns contradicts its resolution");
  info.lossless_columns = header.raw & ~declared;

  // rows and blocks have a minimum length, so a short input cannot claim much memory
  header.bytes = kMagic.size() + in.position();
  const auto raw_count = static_cast<std::size_t>(std::popcount(header.raw));
  const std::size_t least = raw_count * 8 + (kColumnCount - 2 - raw_count) + blocksOf(info.count) * 4;
  if (in.left() < least)
    return corrupt(
        fmt::format("it has {} bytes of columns, {} samples take at least {}", in.left(), info.count, least));
  return header;
}

// the two preceding values, then the column's current block
template <typename U>
struct Window {
  U values[2 + kBlock] = {};
  U* block() { return values + 2; }
  [[nodiscard]] const U* block() const { return values + 2; }
  void carry(std::size_t rows) {
    const U last = block()[rows - 1], before = block()[static_cast<std::ptrdiff_t>(rows) - 2];
    values[0] = before;
    values[1] = last;
  }
};

// columns that can hold impossible values; and the tick, whose last value is in the header
constexpr std::uint32_t kJudged = 1u << kTick | 1u << kFlagsLow | 1u << kFlagsHigh | 1u << kLayer |
                                  1u << kPhase | 1u << kFault | 1u << kWallPresence;

// with null `out`: checks just as strictly, but unpacks only the judged columns and makes no samples
class Decoder {
 public:
  explicit Decoder(const Header& header) : header_(header), wide_(header.raw | kClockMask) {
    steps_ = realSteps(header.info.resolution);
    time_step_ns_ = timeStepNs(header.info.resolution);
  }

  // returns null for invalid bytes
  const std::uint8_t* firstRow(const std::uint8_t* in, const std::uint8_t* end, GestureSample* out) {
    for (std::size_t c = kFirstReal; c < kColumnCount; ++c) {
      if (wide_ >> c & 1u) {
        if (end - in < 8) return nullptr;
        std::uint64_t* const v = wide_columns_[c].values;
        std::memcpy(v, in, 8);
        v[1] = v[2] = v[0];
        in += 8;
      } else {
        std::uint64_t coded = 0;
        in = getVarint(in, end, 32, coded);
        if (in == nullptr) return nullptr;
        std::uint32_t* const v = columns_[c].values;
        v[0] = v[1] = v[2] = unzigzag(static_cast<std::uint32_t>(coded));
      }
    }
    if (!inRange(1)) return nullptr;
    if (out != nullptr) emit(0, 1, out);
    return in;
  }

  const std::uint8_t* block(const std::uint8_t* in, const std::uint8_t* end, std::size_t first,
                            std::size_t rows, GestureSample* out) {
    if (end - in < 4) return nullptr;
    std::uint32_t changed;
    std::memcpy(&changed, in, 4);
    in += 4;
    if ((changed >> kColumnCount) != 0) return nullptr;
    for (std::size_t c = 0; c < kColumnCount; ++c) {
      const bool stored = (changed >> c & 1u) != 0;
      const bool wide = (wide_ >> c & 1u) != 0;
      if (out == nullptr && (kJudged >> c & 1u) == 0) {
        if (stored)
          in = wide ? skipColumn<std::uint64_t>(in, end, rows) : skipColumn<std::uint32_t>(in, end, rows);
      } else if (wide) {
        in = stored ? unpackColumn(in, end, rows, wide_columns_[c].block())
                    : repeat(wide_columns_[c], rows, in);
      } else {
        in = stored ? unpackColumn(in, end, rows, columns_[c].block()) : repeat(columns_[c], rows, in);
      }
      if (in == nullptr) return nullptr;
    }
    if (!inRange(rows)) return nullptr;
    if (out != nullptr) emit(first, rows, out);
    for (std::size_t c = 0; c < kColumnCount; ++c) {
      if (out == nullptr && (kJudged >> c & 1u) == 0) continue;
      if (wide_ >> c & 1u)
        wide_columns_[c].carry(rows);
      else
        columns_[c].carry(rows);
    }
    return in;
  }

  // the tick of the last row; call after the last block
  [[nodiscard]] std::uint64_t lastTick() const {
    return header_.info.first_tick + wide_columns_[kTick].values[1] + (header_.info.count - 1);
  }

 private:
  template <typename U>
  static const std::uint8_t* repeat(Window<U>& window, std::size_t rows, const std::uint8_t* in) {
    const U last = window.values[1];
    for (std::size_t i = 0; i < rows; ++i) window.block()[i] = last;
    return in;
  }

  // false when a value is out of its field's range
  [[nodiscard]] bool inRange(std::size_t rows) const {
    const std::uint32_t* const low = columns_[kFlagsLow].block();
    const std::uint32_t* const high = columns_[kFlagsHigh].block();
    const std::uint32_t* const layer = columns_[kLayer].block();
    const std::uint32_t* const phase = columns_[kPhase].block();
    const std::uint32_t* const fault = columns_[kFault].block();
    const std::uint32_t* const there = columns_[kWallPresence].block();
    std::uint32_t too_big = 0;
    for (std::size_t i = 0; i < rows; ++i)
      too_big |= (low[i] | high[i]) >> 16 | (phase[i] | fault[i] | (layer[i] + 128)) >> 8 | there[i] >> 3;
    return too_big == 0;
  }

  // turns the columns' integers into samples
  void emit(std::size_t first, std::size_t rows, GestureSample* out) {
    const std::uint64_t* const tick = wide_columns_[kTick].block();
    const std::uint64_t* const time = wide_columns_[kTime].block();
    const auto period = static_cast<std::uint64_t>(header_.period_ns);
    for (std::size_t i = 0; i < rows; ++i) {
      const std::uint64_t ticks = tick[i] + first + i;
      out[i].tick = header_.info.first_tick + ticks;
      out[i].time_ns = static_cast<std::int64_t>(
          time[i] + static_cast<std::uint64_t>(header_.info.first_time_ns) + ticks * period);
    }
    for (std::size_t c = 0; c < kRealCount; ++c) emitReal(c, rows, out);
    emitIntegers(rows, out);
  }

  void emitReal(std::size_t c, std::size_t rows, GestureSample* out) {
    const std::size_t column = kFirstReal + c;
    unsigned char* const at = reinterpret_cast<unsigned char*>(out) + kRealOffset[c];
    const auto store = [at](std::size_t i, double value) {
      std::memcpy(at + i * sizeof *out, &value, sizeof value);
    };
    if (wide_ >> column & 1u) {
      const std::uint64_t* const v = wide_columns_[column].block();
      for (std::size_t i = 0; i < rows; ++i) store(i, fromOrderedBits(v[i]));
      return;
    }
    const std::uint32_t* const v = columns_[column].block();
    const double step = steps_[c];
    for (std::size_t i = 0; i < rows; ++i)
      store(i, static_cast<double>(static_cast<std::int32_t>(v[i])) * step);
    if (column < kWall || column >= kWall + 3u) return;
    const std::uint32_t* const there = columns_[kWallPresence].block();
    for (std::size_t i = 0; i < rows; ++i)
      if ((there[i] >> (column - kWall) & 1u) == 0) store(i, std::numeric_limits<double>::quiet_NaN());
  }

  void emitIntegers(std::size_t rows, GestureSample* out) {
    const std::uint32_t* const low = columns_[kFlagsLow].block();
    const std::uint32_t* const high = columns_[kFlagsHigh].block();
    const std::uint32_t* const buttons = columns_[kButtons].block();
    const std::uint32_t* const layer = columns_[kLayer].block();
    const std::uint32_t* const phase = columns_[kPhase].block();
    const std::uint32_t* const fault = columns_[kFault].block();
    for (std::size_t i = 0; i < rows; ++i) {
      out[i].flags = low[i] | high[i] << 16;
      out[i].buttons = buttons[i];
      out[i].layer = static_cast<std::int8_t>(layer[i]);
      out[i].phase = static_cast<std::uint8_t>(phase[i]);
      out[i].fault = static_cast<std::uint8_t>(fault[i]);
    }
    const std::uint32_t* const device = columns_[kDeviceTime].block();
    const std::uint32_t* const engine = columns_[kEngineTime].block();
    for (std::size_t i = 0; i < rows; ++i) {
      out[i].device_ns = nanoseconds(device[i]);
      out[i].engine_ns = nanoseconds(engine[i]);
    }
  }

  // time from steps, clamped to the field: a value at its limit may have been rounded beyond it
  [[nodiscard]] std::int32_t nanoseconds(std::uint32_t steps) const {
    using Limits = std::numeric_limits<std::int32_t>;
    const std::int64_t ns = static_cast<std::int32_t>(steps) * time_step_ns_;
    return static_cast<std::int32_t>(ns < Limits::min()   ? Limits::min()
                                     : ns > Limits::max() ? Limits::max()
                                                          : ns);
  }

  const Header& header_;
  std::uint32_t wide_;
  std::array<double, kRealCount> steps_{};
  std::int64_t time_step_ns_ = 1;
  Window<std::uint32_t> columns_[kColumnCount];
  Window<std::uint64_t> wide_columns_[kLastReal + 1];
};

// reads the columns after the header; `out` null: only checks them
Status readColumns(ByteView chunk, const Header& header, GestureSample* out) {
  const std::size_t count = header.info.count;
  const std::uint8_t* in = chunk.data() + header.bytes;
  const std::uint8_t* const end = chunk.data() + chunk.size() - kCrcBytes;
  Decoder decoder(header);
  in = decoder.firstRow(in, end, out);
  for (std::size_t first = 1; in != nullptr && first < count; first += kBlock)
    in = decoder.block(in, end, first, std::min(kBlock, count - first),
                       out == nullptr ? nullptr : out + first);
  if (in == nullptr) return corrupt("its columns end early or hold impossible values, though the CRC agrees");
  if (in != end) return corrupt(fmt::format("it has {} bytes behind its last sample", end - in));
  if (decoder.lastTick() != header.info.last_tick)
    return corrupt("its last tick is not the one in its header");
  return {};
}

}  // namespace

Result<ChunkInfo> inspectChunk(ByteView chunk) {
  ASSIGN_OR_RETURN(const auto header, readHeader(chunk));
  return header.info;
}

Bytes cutMemoryOf(ByteView chunk) {
  const auto header = readHeader(chunk);
  if (!header.ok()) return {};
  return {header->cut_memory.begin(), header->cut_memory.end()};
}

Bytes pathListOf(ByteView chunk) {
  const auto header = readHeader(chunk);
  if (!header.ok()) return {};
  return {header->paths.begin(), header->paths.end()};
}

std::optional<std::uint32_t> claimedSamples(ByteView chunk) {
  if (chunk.size() < kCountAt + 2 || std::memcmp(chunk.data(), kMagic.data(), kMagic.size()) != 0 ||
      !isKnown(chunk[kMagic.size()]))
    return std::nullopt;
  return ByteReader(chunk.subspan(kCountAt)).get<std::uint16_t>() + std::uint32_t{1};
}

std::optional<std::uint32_t> sealedSamples(ByteView chunk) {
  const auto claimed = claimedSamples(chunk);
  if (!claimed || chunk.size() < kSmallestSealedBytes || chunk.size() > kMaxChunkBytes) return std::nullopt;
  const std::uint32_t stored_crc = ByteReader(chunk.last(kCrcBytes)).get<std::uint32_t>();
  return crc32c(chunk.first(chunk.size() - kCrcBytes)) == stored_crc ? claimed : std::nullopt;
}

Result<ChunkInfo> checkChunk(ByteView chunk) {
  ASSIGN_OR_RETURN(const auto header, readHeader(chunk));
  RETURN_IF_ERROR(readColumns(chunk, header, nullptr));
  return header.info;
}

Result<std::vector<GestureSample>> decodeChunk(ByteView chunk) {
  ASSIGN_OR_RETURN(const auto header, readHeader(chunk));
  std::vector<GestureSample> samples(header.info.count);
  RETURN_IF_ERROR(readColumns(chunk, header, samples.data()));
  return samples;
}

}  // namespace needlelab
