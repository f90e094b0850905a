/// Pseudonyms, which stand for people in studies and after an erasure, and how a name is found and replaced
/// in texts by others.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/audit.h"
#include "db/connection.h"

namespace needlelab {

/// DIR/pseudonym.key: 32 random bytes, for the server's user only (0600), made when it is first needed. A
/// person who has it can try out names; without it the pseudonyms of earlier exports cannot be made again.
/// Thread: immutable.
class PseudonymKey {
 public:
  using Hash = std::array<std::uint8_t, 32>;

  /// kFailed, kCorrupt (the file is not a key). Thread: any; the file is made once.
  static Result<PseudonymKey> ofFolder(const std::filesystem::path& folder);
  /// A key of these bytes, for tests.
  explicit PseudonymKey(const Hash& key) : key_(key) {}

  /// Keyed BLAKE2b-256 of a name: a name can be tried against it, but not read from it.
  [[nodiscard]] Hash nameHash(std::string_view name) const;
  /// "p-" and 16 hexadecimal digits, the same for a person within a study. `created_unix_ns` of the person is
  /// part of it, so that a new person with an old name gets another one.
  [[nodiscard]] std::string ofPerson(std::string_view study, std::string_view name,
                                     std::int64_t created_unix_ns) const;
  /// "s-" and 32 hexadecimal digits.
  [[nodiscard]] std::string ofSession(std::string_view study, const Uuid& session) const;

 private:
  Hash key_;
};

/// Lower-case hexadecimal digits.
std::string hexDigitsOf(std::string_view bytes);
/// The inverse. kInvalidInput.
Result<std::string> bytesOfHex(std::string_view hex);

/// Replaces the name in a text by others where it stands as a word of its own, in either case, and each word
/// of the full name that is longer than two letters. For remarks that leave the lab, where a word too many is
/// better than one too few.
std::string withoutName(const std::string& text, std::string_view name, std::string_view full_name,
                        std::string_view in_its_place);

/// One person's names, and what must not be taken for them.
struct ErasedNames {
  std::string name;
  std::vector<std::string> full_names;  ///< of now, and earlier ones
  std::vector<std::string> others;      ///< names and ids of others in which one of these stands
  std::string in_its_place;             ///< the pseudonym
};

/// Replaces name and full names as wholes, in either case, except within one of `others`. `parts`: also each
/// word of a full name that is longer than two letters, in its own case: in texts that are about this person.
std::string withoutNames(const std::string& text, const ErasedNames& names, bool parts);

/// Full names that lines of the audit log about this person tell, oldest first; as "user change" writes them:
/// "full name: 'Old' to 'New'" at the end.
Result<std::vector<std::string>> loggedFullNames(Connection& connection, std::string_view name);
/// Fills `others` from the store.
Status addOthers(Connection& connection, ErasedNames& names);

/// A line of the audit log without the person: who and subject only where they are this person, by what the
/// action says of its subject; the detail by whom it is about. `own_sessions`: ids as text.
AuditRow withoutNames(const AuditRow& line, const ErasedNames& names,
                      const std::set<std::string>& own_sessions);

}  // namespace needlelab
