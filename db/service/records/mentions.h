/// Finds people's names in texts that others wrote. An erasure leaves such texts unchanged; a person finds,
/// edits or redacts them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "db/store/connection.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// What to search for: names of one or more words. "anna.bell" and "Anna Bell" have the same words.
class Phrases {
 public:
  /// Texts without a letter or digit are ignored.
  explicit Phrases(std::span<const std::string> texts);
  [[nodiscard]] bool empty() const { return phrases_.empty(); }
  /// The ranges [first, behind) of `text` at which a phrase occurs as whole words, compared by nameKey(); in
  /// order, without overlaps.
  [[nodiscard]] std::vector<std::pair<std::size_t, std::size_t>> placesIn(std::string_view text) const;
  /// The text with these ranges replaced by "[name removed]".
  [[nodiscard]] std::string without(std::string_view text) const;

 private:
  std::vector<std::vector<std::string>> phrases_;  // the words' keys
};

/// Does not own the connection. Thread: as its Connection; redact() needs the writer's and a transaction.
class MentionStore {
 public:
  explicit MentionStore(Connection& connection) : connection_(connection) {}

  /// Reads all texts, skips the first `skipped` mentions and returns at most `most`; next_page: how many to
  /// skip for the next page.
  Result<pb::Mentions> find(const Phrases& phrases, std::size_t skipped, std::size_t most);
  /// Returns the number of replacements in the text `where` (pb::Mention::where). kInvalidInput, kNotFound.
  Result<std::size_t> redact(const Phrases& phrases, std::string_view where);

 private:
  Connection& connection_;
};

}  // namespace needlelab
