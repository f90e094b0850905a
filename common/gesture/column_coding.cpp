#include "common/gesture/column_coding.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

namespace needlelab::column_coding {
namespace {

constexpr std::size_t kRows = 32;

int varintBytes(std::uint64_t value) {
  return (std::max(1, static_cast<int>(std::bit_width(value))) + 6) / 7;
}

// six bits hold a width: 63 stands for 64 (and a need of 63 takes 64)
int storedWidth(std::uint64_t largest) {
  const int width = static_cast<int>(std::bit_width(largest));
  return width == 63 ? 64 : width;
}

void store64(std::uint8_t* out, std::uint64_t word) {
  std::memcpy(out, &word, 8);
}
std::uint64_t load64(const std::uint8_t* in) {
  std::uint64_t word;
  std::memcpy(&word, in, 8);
  return word;
}

// value i has the bits [i·width, (i+1)·width), least significant first; the last byte is padded with zeros
template <typename U>
std::uint8_t* packBits(const U* values, std::size_t rows, int width, std::uint8_t* out) {
  std::uint64_t pending = 0;
  int fill = 0;  // bits in `pending`: below 8 between pushes, at most 63 within one
  const auto push = [&](std::uint64_t value, int bits) {
    pending |= value << fill;
    fill += bits;
    store64(out, pending);
    out += fill >> 3;
    pending >>= fill & 56;
    fill &= 7;
  };
  if (width <= 28) {
    // two at a time: 7 + 2·28 bits still fit
    std::size_t i = 0;
    for (; i + 2 <= rows; i += 2)
      push(static_cast<std::uint64_t>(values[i]) | (static_cast<std::uint64_t>(values[i + 1]) << width),
           2 * width);
    if (i < rows) push(values[i], width);
  } else if (width <= 56) {
    for (std::size_t i = 0; i < rows; ++i) push(values[i], width);
  } else {
    for (std::size_t i = 0; i < rows; ++i) {
      const std::uint64_t value = values[i];
      push(value & 0xFFFFFFFFu, 32);
      push(value >> 32, width - 32);
    }
  }
  if (fill > 0) *out++ = static_cast<std::uint8_t>(pending);
  return out;
}

// reads up to 8 bytes beyond the values
template <typename U>
void unpackBits(const std::uint8_t* in, std::size_t rows, int width, U* values) {
  if (width == 0) {
    std::fill_n(values, rows, U{0});
  } else if (width <= 56) {
    const std::uint64_t mask = (std::uint64_t{1} << width) - 1;
    std::size_t at = 0;
    for (std::size_t i = 0; i < rows; ++i, at += static_cast<std::size_t>(width))
      values[i] = static_cast<U>((load64(in + (at >> 3)) >> (at & 7)) & mask);
  } else {
    const auto high = static_cast<std::size_t>(width) - 32;
    const std::uint64_t mask = (std::uint64_t{1} << high) - 1;
    std::size_t at = 0;
    for (std::size_t i = 0; i < rows; ++i, at += static_cast<std::size_t>(width)) {
      const std::uint64_t low = (load64(in + (at >> 3)) >> (at & 7)) & 0xFFFFFFFFu;
      const std::size_t next = at + 32;
      values[i] = static_cast<U>(low | (((load64(in + (next >> 3)) >> (next & 7)) & mask) << 32));
    }
  }
}

// statistics of a block for the choice of its mode, from one pass
template <typename U>
struct Extent {
  using S = SignedOf<U>;
  S low = std::numeric_limits<S>::max();
  S high = std::numeric_limits<S>::min();
  void add(U value) {
    low = std::min(low, static_cast<S>(value));
    high = std::max(high, static_cast<S>(value));
  }
  [[nodiscard]] U range() const { return static_cast<U>(high) - static_cast<U>(low); }
  // smallest width that holds the zig-zag of every value
  [[nodiscard]] U zigzagBits() const { return zigzag(static_cast<U>(low)) | zigzag(static_cast<U>(high)); }
};

}  // namespace

std::uint8_t* putVarint(std::uint8_t* out, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) *out++ = static_cast<std::uint8_t>(value | 0x80);
  *out++ = static_cast<std::uint8_t>(value);
  return out;
}

const std::uint8_t* getVarint(const std::uint8_t* in, const std::uint8_t* end, int bits,
                              std::uint64_t& value) {
  value = 0;
  for (int shift = 0; in != end && shift < bits; shift += 7) {
    const std::uint64_t group = *in & 0x7Fu;
    if (shift + 7 > bits && (group >> (bits - shift)) != 0) return nullptr;
    value |= group << shift;
    if ((*in++ & 0x80u) == 0) return in;
  }
  return nullptr;
}

template <typename U>
std::uint8_t* packColumn(const U* v, std::size_t rows, std::uint8_t* out) {
  // differences; plain loops that compilers turn into SIMD
  U first[kRows], second[kRows];
  U changed = 0;
  // at the first row, the index i - 1 would wrap around, which is undefined for pointers
  const U* const before = v - 1;
  const U* const before_that = v - 2;
  for (std::size_t i = 0; i < rows; ++i) {
    first[i] = v[i] - before[i];
    second[i] = v[i] - 2 * before[i] + before_that[i];
    changed |= first[i];
  }
  if (changed == 0) return out;
  Extent<U> level, slope, bend;
  for (std::size_t i = 0; i < rows; ++i) {
    level.add(v[i] - v[-1]);
    slope.add(first[i]);
    bend.add(second[i]);
  }

  // cost in bits of each mode, its base included
  const U bases[4] = {zigzag(static_cast<U>(level.low)), zigzag(static_cast<U>(slope.low)), 0, 0};
  const int widths[4] = {storedWidth(level.range()), storedWidth(slope.range()),
                         storedWidth(slope.zigzagBits()), storedWidth(bend.zigzagBits())};
  int mode = 0;
  std::size_t least = std::numeric_limits<std::size_t>::max();
  for (int m = 0; m < 4; ++m) {
    const std::size_t base_bytes = m < 2 ? static_cast<std::size_t>(varintBytes(bases[m])) : 0;
    const std::size_t cost = base_bytes + (rows * static_cast<std::size_t>(widths[m]) + 7) / 8;
    if (cost < least) {
      least = cost;
      mode = m;
    }
  }

  U residual[kRows];
  switch (mode) {
    case kFromLast:
      for (std::size_t i = 0; i < rows; ++i) residual[i] = v[i] - v[-1] - static_cast<U>(level.low);
      break;
    case kFirstFromBase:
      for (std::size_t i = 0; i < rows; ++i) residual[i] = first[i] - static_cast<U>(slope.low);
      break;
    case kFirstDifference:
      for (std::size_t i = 0; i < rows; ++i) residual[i] = zigzag(first[i]);
      break;
    default:
      for (std::size_t i = 0; i < rows; ++i) residual[i] = zigzag(second[i]);
      break;
  }
  *out++ = static_cast<std::uint8_t>((mode << 6) | std::min(widths[mode], 63));
  if (mode < 2) out = putVarint(out, bases[mode]);
  return packBits(residual, rows, widths[mode], out);
}

// what precedes the residuals of a stored column block, and the residuals' length
template <typename U>
struct BlockHead {
  int mode = 0;
  int width = 0;
  U base = 0;
  std::size_t bytes = 0;
};

// returns where the residuals start; null for invalid bytes or missing residuals
template <typename U>
const std::uint8_t* readHead(const std::uint8_t* in, const std::uint8_t* end, std::size_t rows,
                             BlockHead<U>& head) {
  constexpr int kBits = 8 * sizeof(U);
  if (in == end) return nullptr;
  head.mode = *in >> 6;
  head.width = *in++ & 63;
  if (head.width == 63) head.width = 64;
  if (head.width > kBits) return nullptr;
  if (head.mode < 2) {
    std::uint64_t coded = 0;
    in = getVarint(in, end, kBits, coded);
    if (in == nullptr) return nullptr;
    head.base = unzigzag(static_cast<U>(coded));
  }
  head.bytes = (rows * static_cast<std::size_t>(head.width) + 7) / 8;
  return head.bytes > static_cast<std::size_t>(end - in) ? nullptr : in;
}

template <typename U>
const std::uint8_t* skipColumn(const std::uint8_t* in, const std::uint8_t* end, std::size_t rows) {
  BlockHead<U> head;
  in = readHead(in, end, rows, head);
  return in == nullptr ? nullptr : in + head.bytes;
}

template <typename U>
const std::uint8_t* unpackColumn(const std::uint8_t* in, const std::uint8_t* end, std::size_t rows, U* v) {
  BlockHead<U> head;
  in = readHead(in, end, rows, head);
  if (in == nullptr) return nullptr;
  const auto [mode, width, base, bytes] = head;

  // whole words are loaded, so near the end of the chunk read from a padded copy
  U residual[kRows];
  if (bytes + 8 <= static_cast<std::size_t>(end - in)) {
    unpackBits(in, rows, width, residual);
  } else {
    std::uint8_t copy[kRows * sizeof(U) + 8] = {};
    std::memcpy(copy, in, bytes);
    unpackBits(copy, rows, width, residual);
  }
  U last = v[-1];
  switch (mode) {
    case kFromLast:
      for (std::size_t i = 0; i < rows; ++i) v[i] = v[-1] + base + residual[i];
      break;
    case kFirstFromBase:
      for (std::size_t i = 0; i < rows; ++i) v[i] = last += base + residual[i];
      break;
    case kFirstDifference:
      for (std::size_t i = 0; i < rows; ++i) v[i] = last += unzigzag(residual[i]);
      break;
    default: {
      U slope = v[-1] - v[-2];
      for (std::size_t i = 0; i < rows; ++i) {
        slope += unzigzag(residual[i]);
        v[i] = last += slope;
      }
      break;
    }
  }
  return in + bytes;
}

template std::uint8_t* packColumn<std::uint32_t>(const std::uint32_t*, std::size_t, std::uint8_t*);
template std::uint8_t* packColumn<std::uint64_t>(const std::uint64_t*, std::size_t, std::uint8_t*);
template const std::uint8_t* skipColumn<std::uint32_t>(const std::uint8_t*, const std::uint8_t*, std::size_t);
template const std::uint8_t* skipColumn<std::uint64_t>(const std::uint8_t*, const std::uint8_t*, std::size_t);
template const std::uint8_t* unpackColumn<std::uint32_t>(const std::uint8_t*, const std::uint8_t*,
                                                         std::size_t, std::uint32_t*);
template const std::uint8_t* unpackColumn<std::uint64_t>(const std::uint8_t*, const std::uint8_t*,
                                                         std::size_t, std::uint64_t*);

}  // namespace needlelab::column_coding
