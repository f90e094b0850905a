#include "db/other_names.h"

#include <algorithm>
#include <utility>

#include "common/base/text.h"

namespace needlelab {
namespace {

unsigned char smallByte(char c) {
  return static_cast<unsigned char>(lowerCase(c));
}

}  // namespace

OtherNames::OtherNames(std::vector<std::string> names) : names_(std::move(names)) {
  for (const std::string& name : names_)
    if (!name.empty()) add(name);
  linkFallbacks();
}

void OtherNames::add(std::string_view name) {
  std::uint32_t node = 0;
  for (const char c : name) {
    const unsigned char byte = smallByte(c);
    std::uint32_t longer = after(node, byte);
    if (longer == 0) {
      longer = static_cast<std::uint32_t>(nodes_.size());
      nodes_.push_back({.byte = byte, .next = nodes_[node].child});
      nodes_[node].child = longer;
      if (node == 0) first_[byte] = longer;
    }
    node = longer;
  }
  nodes_[node].name_bytes = name.size();
}

void OtherNames::linkFallbacks() {
  std::vector<std::uint32_t> shortest_first{0};
  for (std::size_t i = 0; i < shortest_first.size(); ++i) {
    const std::uint32_t parent = shortest_first[i];
    for (std::uint32_t node = nodes_[parent].child; node != 0; node = nodes_[node].next) {
      Node& one = nodes_[node];
      if (parent != 0) one.fallback = afterOrFallback(nodes_[parent].fallback, one.byte);
      const Node& fallback = nodes_[one.fallback];
      one.shorter = fallback.name_bytes > 0 ? one.fallback : fallback.shorter;
      shortest_first.push_back(node);
    }
  }
}

std::uint32_t OtherNames::after(std::uint32_t node, unsigned char byte) const {
  if (node == 0) return first_[byte];
  std::uint32_t longer = nodes_[node].child;
  while (longer != 0 && nodes_[longer].byte != byte) longer = nodes_[longer].next;
  return longer;
}

std::uint32_t OtherNames::afterOrFallback(std::uint32_t node, unsigned char byte) const {
  for (;;) {
    const std::uint32_t longer = after(node, byte);
    if (longer != 0 || node == 0) return longer;
    node = nodes_[node].fallback;
  }
}

OtherNames::Places OtherNames::placesIn(std::string_view text, IsWhole is_whole) const {
  Places places;
  if (nodes_.size() == 1) return places;
  std::uint32_t node = 0;
  for (std::size_t at = 0; at < text.size(); ++at) {
    node = afterOrFallback(node, smallByte(text[at]));
    const std::size_t end = at + 1;
    // the longest that ends here covers what the shorter ones cover
    for (std::uint32_t name = nodes_[node].name_bytes > 0 ? node : nodes_[node].shorter; name != 0;
         name = nodes_[name].shorter) {
      const std::size_t begin = end - nodes_[name].name_bytes;
      if (!is_whole(text, begin, end)) continue;
      if (places.reach_.empty()) places.reach_.resize(text.size());
      places.reach_[begin] = end;  // greater than what was there: the ends come in order
      break;
    }
  }
  for (std::size_t at = 1; at < places.reach_.size(); ++at)
    places.reach_[at] = std::max(places.reach_[at], places.reach_[at - 1]);
  return places;
}

}  // namespace needlelab
