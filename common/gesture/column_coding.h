/// The coding of one column over one block of up to 32 rows (FORMAT.md, "Column blocks"). Internal to
/// common/gesture.
///
/// A column is a sequence of 32- or 64-bit integers; all arithmetic is modulo 2³² or 2⁶⁴, so that every
/// sequence has a code. `v` points at the block's first value inside an array that also holds the two values
/// before it: v[-2], v[-1].
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace needlelab::column_coding {

/// The prediction behind a column block's residuals. Stored in two bits.
enum Mode : std::uint8_t {
  kFromLast = 0,          ///< v[i] − v[−1] − base: noise about a level
  kFirstFromBase = 1,     ///< (v[i] − v[i−1]) − base: steady motion
  kFirstDifference = 2,   ///< zig-zag of v[i] − v[i−1]
  kSecondDifference = 3,  ///< zig-zag of (v[i] − v[i−1]) − (v[i−1] − v[i−2])
};

template <typename U>
using SignedOf = std::make_signed_t<U>;

/// Maps 0, −1, 1, −2, 2 … to 0, 1, 2, 3, 4 …
template <typename U>
constexpr U zigzag(U value) {
  return static_cast<U>((value << 1) ^
                        static_cast<U>(static_cast<SignedOf<U>>(value) >> (8 * sizeof(U) - 1)));
}
template <typename U>
constexpr U unzigzag(U value) {
  return static_cast<U>((value >> 1) ^ (U{0} - (value & 1u)));
}

/// The greatest size of a column block: head, base, 32 values; packColumn may write 16 bytes beyond it.
template <typename U>
inline constexpr std::size_t kMaxColumnBytes = 1 + 10 + 32 * sizeof(U);
inline constexpr std::size_t kScribble = 16;

/// Writes little-endian groups of 7 bits, with the top bit set on all but the last. Returns the end.
std::uint8_t* putVarint(std::uint8_t* out, std::uint64_t value);
/// Returns the end, or null when the bytes end early or the value has more than `bits` bits. Within `bits`,
/// accepts trailing zero groups, which putVarint would not write.
const std::uint8_t* getVarint(const std::uint8_t* in, const std::uint8_t* end, int bits,
                              std::uint64_t& value);

/// Packs `rows` (1-32) values by the cheapest mode. Returns the end, or `out` itself when every value equals
/// v[-1]: then the block is not stored. Needs kMaxColumnBytes<U> + kScribble bytes of room.
template <typename U>
std::uint8_t* packColumn(const U* v, std::size_t rows, std::uint8_t* out);

/// Inverse of packColumn for a stored block. Returns the end, or null for invalid bytes.
template <typename U>
const std::uint8_t* unpackColumn(const std::uint8_t* in, const std::uint8_t* end, std::size_t rows, U* v);

/// Returns the end of a stored block without reading its values; null where unpackColumn returns null.
template <typename U>
const std::uint8_t* skipColumn(const std::uint8_t* in, const std::uint8_t* end, std::size_t rows);

extern template std::uint8_t* packColumn<std::uint32_t>(const std::uint32_t*, std::size_t, std::uint8_t*);
extern template std::uint8_t* packColumn<std::uint64_t>(const std::uint64_t*, std::size_t, std::uint8_t*);
extern template const std::uint8_t* skipColumn<std::uint32_t>(const std::uint8_t*, const std::uint8_t*,
                                                              std::size_t);
extern template const std::uint8_t* skipColumn<std::uint64_t>(const std::uint8_t*, const std::uint8_t*,
                                                              std::size_t);
extern template const std::uint8_t* unpackColumn<std::uint32_t>(const std::uint8_t*, const std::uint8_t*,
                                                                std::size_t, std::uint32_t*);
extern template const std::uint8_t* unpackColumn<std::uint64_t>(const std::uint8_t*, const std::uint8_t*,
                                                                std::size_t, std::uint64_t*);

}  // namespace needlelab::column_coding
