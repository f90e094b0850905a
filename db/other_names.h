/// Many names, found in a text all at once.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace needlelab {

/// Names that stay where another one is replaced. A search reads the text once, however many names there are
/// (Aho and Corasick, 1975); capitals of ASCII are the same as small letters. Thread: immutable.
class OtherNames {
 public:
  OtherNames() = default;
  OtherNames(std::initializer_list<std::string> names) : OtherNames(std::vector<std::string>(names)) {}
  explicit OtherNames(std::vector<std::string> names);
  [[nodiscard]] const std::vector<std::string>& list() const { return names_; }

  /// Where the names stand in one text.
  class Places {
   public:
    /// True when [begin, end) lies within one of the names that is longer than it. `end` is in the text.
    [[nodiscard]] bool cover(std::size_t begin, std::size_t end) const {
      if (reach_.empty()) return false;
      return reach_[begin] > end || (begin > 0 && reach_[begin - 1] >= end);
    }

   private:
    friend class OtherNames;
    std::vector<std::size_t> reach_;  ///< by position: the last end of the names that begin there or before
  };
  /// Decides whether [begin, end) of the text is a name, and not a part of a word.
  using IsWhole = bool (*)(std::string_view text, std::size_t begin, std::size_t end);
  [[nodiscard]] Places placesIn(std::string_view text, IsWhole is_whole) const;

 private:
  /// The beginning of a name. Number 0 is the empty one, and stands for "none".
  struct Node {
    unsigned char byte = 0;      ///< its last one
    std::uint32_t next = 0;      ///< the next one that continues the same beginning
    std::uint32_t child = 0;     ///< the first one that continues this
    std::uint32_t fallback = 0;  ///< the longest other beginning that this one ends with
    std::uint32_t shorter = 0;   ///< the longest whole name among the fallbacks
    std::size_t name_bytes = 0;  ///< 0: no name ends here
  };
  [[nodiscard]] std::uint32_t after(std::uint32_t node, unsigned char byte) const;
  [[nodiscard]] std::uint32_t afterOrFallback(std::uint32_t node, unsigned char byte) const;
  void add(std::string_view name);
  void linkFallbacks();

  std::vector<std::string> names_;
  std::vector<Node> nodes_ = std::vector<Node>(1);
  std::array<std::uint32_t, 256> first_{};  ///< the beginnings of one byte
};

}  // namespace needlelab
