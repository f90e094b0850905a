#include "common/base/text/near_names.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <tuple>
#include <utility>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

/// One number per character, made of its bytes (at most four in valid UTF-8).
std::vector<std::uint32_t> charactersOf(std::string_view text) {
  std::vector<std::uint32_t> characters;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool continues = (byte & 0xC0U) == 0x80U && !characters.empty();
    if (continues) {
      characters.back() = characters.back() << 8U | byte;
    } else {
      characters.push_back(static_cast<unsigned char>(lowerCase(c)));
    }
  }
  return characters;
}

}  // namespace

std::optional<std::size_t> editDistance(std::string_view a, std::string_view b, std::size_t most) {
  if (a.size() > kMaxComparedBytes || b.size() > kMaxComparedBytes) return std::nullopt;
  const auto from = charactersOf(a), to = charactersOf(b);
  const std::size_t longer = std::max(from.size(), to.size()), shorter = std::min(from.size(), to.size());
  if (longer - shorter > most) return std::nullopt;
  // row i: the distances of the first i characters of `from` to each beginning of `to`
  std::vector<std::size_t> two_before, before(to.size() + 1), row(to.size() + 1);
  std::iota(before.begin(), before.end(), std::size_t{0});
  for (std::size_t i = 1; i <= from.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= to.size(); ++j) {
      const std::size_t replaced = before[j - 1] + (from[i - 1] == to[j - 1] ? 0 : 1);
      row[j] = std::min({before[j] + 1, row[j - 1] + 1, replaced});
      const bool swapped = i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1];
      if (swapped) row[j] = std::min(row[j], two_before[j - 2] + 1);
    }
    two_before = std::exchange(before, row);
  }
  return before.back() <= most ? std::optional(before.back()) : std::nullopt;
}

std::vector<KnownName> nearNames(std::string_view typed, std::span<const KnownName> known,
                                 std::size_t count) {
  if (typed.size() > kMaxComparedBytes) return {};
  const std::size_t characters = charactersOf(typed).size();
  const std::size_t most = characters <= 4 ? 1 : characters <= 8 ? 2 : 3;
  std::vector<std::pair<std::size_t, const KnownName*>> near;
  for (const KnownName& person : known) {
    const auto by_name = editDistance(typed, person.name, most);
    const auto by_full_name =
        person.full_name.empty() ? std::nullopt : editDistance(typed, person.full_name, most);
    if (by_name || by_full_name)
      near.emplace_back(std::min(by_name.value_or(most), by_full_name.value_or(most)), &person);
  }
  std::sort(near.begin(), near.end(), [](const auto& a, const auto& b) {
    return std::tie(a.first, a.second->name) < std::tie(b.first, b.second->name);
  });
  std::vector<KnownName> names;
  for (const auto& [distance, person] : near)
    if (names.size() < count) names.push_back(*person);
  return names;
}

}  // namespace needlelab
