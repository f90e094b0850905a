#include "db/service/name_index.h"

#include <algorithm>
#include <numeric>

#include "common/base/text.h"

namespace needlelab {
namespace {

std::uint64_t keyOf(std::uint32_t node, unsigned char byte) {
  return (std::uint64_t{node} << 8) | byte;
}

}  // namespace

bool NameIndex::add(std::string_view word, const std::string& owner) {
  if (word.empty()) return false;
  const std::string text = lowerCase(word);
  std::uint32_t at = 0;
  for (const char letter : text) {
    const auto byte = static_cast<unsigned char>(letter);
    const auto [found, made] = next_.try_emplace(keyOf(at, byte), static_cast<std::uint32_t>(nodes_.size()));
    if (made) nodes_.push_back({at, byte});
    at = found->second;
  }
  Word& stored = owners_[at];
  stored.text = text;
  linked_ = false;
  return stored.people.insert(owner).second;
}

std::uint32_t NameIndex::after(std::uint32_t node, unsigned char byte) const {
  const auto found = next_.find(keyOf(node, byte));
  return found == next_.end() ? 0 : found->second;
}

std::uint32_t NameIndex::afterOrFallback(std::uint32_t node, unsigned char byte) const {
  for (;; node = nodes_[node].fallback) {
    const std::uint32_t next = after(node, byte);
    if (next != 0 || node == 0) return next;
  }
}

void NameIndex::link() {
  // shorter beginnings first: a fallback is shorter than its node
  std::vector<std::uint32_t> length(nodes_.size()), order(nodes_.size());
  for (std::uint32_t node = 1; node < nodes_.size(); ++node) length[node] = length[nodes_[node].parent] + 1;
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return length[a] < length[b]; });
  for (const std::uint32_t number : order) {
    Node& node = nodes_[number];
    if (number == 0) continue;
    node.fallback = node.parent == 0 ? 0 : afterOrFallback(nodes_[node.parent].fallback, node.byte);
    node.shorter = owners_.contains(node.fallback) ? node.fallback : nodes_[node.fallback].shorter;
  }
  linked_ = true;
}

std::map<std::string, std::set<std::string>> NameIndex::in(std::string_view text) {
  std::map<std::string, std::set<std::string>> found;
  if (owners_.empty()) return found;
  if (!linked_) link();
  ++looks_;
  std::uint32_t at = 0;
  for (const char letter : text) {
    at = afterOrFallback(at, static_cast<unsigned char>(lowerCase(letter)));
    // where a beginning was met before, so were the words that it ends with
    for (std::uint32_t word = at; word != 0 && nodes_[word].seen != looks_; word = nodes_[word].shorter) {
      nodes_[word].seen = looks_;
      const auto whole = owners_.find(word);
      if (whole == owners_.end()) continue;
      for (const std::string& person : whole->second.people) found[person].insert(whole->second.text);
    }
  }
  return found;
}

}  // namespace needlelab
