/// Where people are named in texts that other people wrote. An erasure leaves such texts as they are: a
/// person finds them, and edits or redacts them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// What is looked for: each a name of one or more words. "anna.bell" and "Anna Bell" have the same words.
class Phrases {
 public:
  /// Those without a letter or digit are left out.
  explicit Phrases(std::span<const std::string> texts);
  [[nodiscard]] bool empty() const { return phrases_.empty(); }
  /// The places [first, behind) of `text` at which a phrase stands as whole words, compared by nameKey(); in
  /// order, none within another.
  [[nodiscard]] std::vector<std::pair<std::size_t, std::size_t>> placesIn(std::string_view text) const;
  /// The text with "[name removed]" in their place.
  [[nodiscard]] std::string without(std::string_view text) const;

 private:
  std::vector<std::vector<std::string>> phrases_;  // the words' keys
};

/// Does not own the connection. Thread: as its Connection; redact() needs the writer's and a transaction.
class MentionStore {
 public:
  explicit MentionStore(Connection& connection) : connection_(connection) {}

  /// Reads all texts, passes over the first `skipped` mentions and returns at most `most`; next_page: how
  /// many there are before the next.
  Result<pb::Mentions> find(const Phrases& phrases, std::size_t skipped, std::size_t most);
  /// Returns how many places it replaced in the text `where` (pb::Mention::where). kInvalidInput, kNotFound.
  Result<std::size_t> redact(const Phrases& phrases, std::string_view where);

 private:
  Connection& connection_;
};

}  // namespace needlelab
