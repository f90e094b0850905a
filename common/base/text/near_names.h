/// Names that a person may have meant by a mistyped one. Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace needlelab {

/// Longer texts have no distance: the work grows with the product of both lengths.
inline constexpr std::size_t kMaxComparedBytes = 200;

/// The least number of insertions, deletions, replacements, and swaps of two neighbours that turns `a` into
/// `b`; a swapped pair is not edited again (optimal string alignment). Counts UTF-8 characters, ignoring the
/// case of A-Z. Returns nothing if the distance is more than `most`, or if a text has more than
/// kMaxComparedBytes.
std::optional<std::size_t> editDistance(std::string_view a, std::string_view b, std::size_t most);

struct KnownName {
  std::string name;
  std::string full_name;  ///< may be empty
  friend bool operator==(const KnownName&, const KnownName&) = default;
};

/// Returns the people in `known` whose name or full name is near `typed`, nearest first, then by name; at
/// most `count`. Near: at most 1 edit for up to 4 characters of `typed`, 2 for up to 8, else 3.
std::vector<KnownName> nearNames(std::string_view typed, std::span<const KnownName> known,
                                 std::size_t count = 3);

}  // namespace needlelab
