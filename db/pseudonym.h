/// Names that stand for people in studies and after an erasure, made with a key that is in no backup and in
/// no export.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/base/uuid.h"

namespace needlelab {

/// DIR/pseudonym.key: 32 random bytes, for the server's user only (0600), made when it is first needed. Who
/// has it can try out names; who loses it cannot make the pseudonyms of earlier exports again. Thread:
/// immutable.
class PseudonymKey {
 public:
  using Hash = std::array<std::uint8_t, 32>;

  /// kFailed, kCorrupt (a file that is no key). Thread: any; the file is made once.
  static Result<PseudonymKey> ofFolder(const std::filesystem::path& folder);
  /// A key of these bytes, for tests.
  explicit PseudonymKey(const Hash& key) : key_(key) {}

  /// Keyed BLAKE2b-256 of a name: which erased person it was can be asked, not read.
  [[nodiscard]] Hash nameHash(std::string_view name) const;
  /// "p-" and 16 hexadecimal digits, the same for a person within a study. `created_unix_ns` of the person is
  /// part of it, so that somebody who gets an old name is somebody else.
  [[nodiscard]] std::string ofPerson(std::string_view study, std::string_view name,
                                     std::int64_t created_unix_ns) const;
  /// "s-" and 32 hexadecimal digits.
  [[nodiscard]] std::string ofSession(std::string_view study, const Uuid& session) const;

 private:
  Hash key_;
};

/// Lower-case hexadecimal digits.
std::string hexDigitsOf(std::string_view bytes);
/// The inverse; nothing when it is none.
Result<std::string> bytesOfHex(std::string_view hex);

}  // namespace needlelab
