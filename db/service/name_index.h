/// Which of many names a text holds. Private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace needlelab {

/// Words of people, found in a text all at once, wherever they stand, also within a longer word: a text is
/// read once, however many words there are (Aho and Corasick, 1975). Capitals of ASCII are the same as small
/// letters. All words are added before the first look. Thread: one at a time.
class NameIndex {
 public:
  /// `owner`: the person whose word it is. False: the person has it already.
  bool add(std::string_view word, const std::string& owner);
  /// The words that are in the text, as they are after lowerCase(), by their owner.
  [[nodiscard]] std::map<std::string, std::set<std::string>> in(std::string_view text);

 private:
  /// The beginning of a word. Number 0 is the empty one.
  struct Node {
    std::uint32_t parent = 0;
    unsigned char byte = 0;      ///< its last one
    std::uint32_t fallback = 0;  ///< the longest other beginning that this one ends with
    std::uint32_t shorter = 0;   ///< the longest whole word among the fallbacks; 0: none
    std::size_t seen = 0;        ///< the last look that met it or, of a word, found it
  };
  [[nodiscard]] std::uint32_t after(std::uint32_t node, unsigned char byte) const;
  [[nodiscard]] std::uint32_t afterOrFallback(std::uint32_t node, unsigned char byte) const;
  void link();

  std::vector<Node> nodes_ = std::vector<Node>(1);
  std::unordered_map<std::uint64_t, std::uint32_t> next_;  ///< by node and byte
  struct Word {
    std::string text;
    std::set<std::string> people;
  };
  std::map<std::uint32_t, Word> owners_;  ///< by the node that ends the word
  std::size_t looks_ = 0;
  bool linked_ = false;
};

}  // namespace needlelab
