/// Pseudonyms for people in studies; replacing names in texts.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/base/text/uuid.h"

namespace needlelab {

/// DIR/pseudonym.key: 32 random bytes, readable only by the server's user (0600), created on first use.
/// Anyone with the key can test guessed names; without it the pseudonyms of earlier exports cannot be
/// reproduced. Thread: immutable.
class PseudonymKey {
 public:
  using Hash = std::array<std::uint8_t, 32>;

  /// Reads or creates the key (once). Errors: kFailed, kCorrupt (the file is not a key). Thread: any.
  static Result<PseudonymKey> ofFolder(const std::filesystem::path& folder);
  /// A key from these bytes, for tests.
  explicit PseudonymKey(const Hash& key) : key_(key) {}

  /// Keyed BLAKE2b-256 of a name. With the key, a guessed name can be compared with it; the name cannot be
  /// recovered.
  [[nodiscard]] Hash nameHash(std::string_view name) const;
  /// 16 hexadecimal digits that distinguish this key from others without revealing anything about it.
  [[nodiscard]] std::string id() const;
  /// A key for another purpose, from which this one cannot be derived.
  [[nodiscard]] Hash derived(std::string_view purpose) const;
  /// "p-" and 16 hexadecimal digits, the same for a person throughout a study even if the name changes.
  /// `outer_ref`: the person's outerRef().
  [[nodiscard]] std::string ofPerson(std::string_view study, std::string_view outer_ref) const;
  /// "s-" and 32 hexadecimal digits.
  [[nodiscard]] std::string ofSession(std::string_view study, const Uuid& session) const;

 private:
  Hash key_;
};

/// Replaces a name in someone else's text, case-insensitively, where it is a whole word, and likewise each
/// word of the full name longer than two letters. Punctuation of any script ends a word. A name in a script
/// other than Latin, Greek, Cyrillic and Armenian is replaced wherever it occurs, even within a word. For
/// remarks that leave the lab: replacing one word too many is better than one too few.
std::string withoutName(const std::string& text, std::string_view name, std::string_view full_name,
                        std::string_view in_its_place);

}  // namespace needlelab
