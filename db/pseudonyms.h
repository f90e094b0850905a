/// Pseudonyms for people in studies and after an erasure; finding and replacing names in texts.
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
#include "db/other_names.h"

namespace needlelab {

/// DIR/pseudonym.key: 32 random bytes, readable only by the server's user (0600), created on first use.
/// Anyone with the key can test guessed names; without it the pseudonyms of earlier exports cannot be
/// reproduced. Thread: immutable.
class PseudonymKey {
 public:
  using Hash = std::array<std::uint8_t, 32>;

  /// Reads or creates the key. kFailed, kCorrupt (the file is not a key). Thread: any; the file is created
  /// once.
  static Result<PseudonymKey> ofFolder(const std::filesystem::path& folder);
  /// A key from these bytes, for tests.
  explicit PseudonymKey(const Hash& key) : key_(key) {}

  /// Keyed BLAKE2b-256 of a name. With the key, a guessed name can be compared with it; the name cannot be
  /// recovered.
  [[nodiscard]] Hash nameHash(std::string_view name) const;
  /// 16 hexadecimal digits that tell this key from others, and nothing of it.
  [[nodiscard]] std::string id() const;
  /// A key for another purpose, from which this one cannot be found.
  [[nodiscard]] Hash derived(std::string_view purpose) const;
  /// 32 hexadecimal digits: a MAC over a line of the list of erasures.
  [[nodiscard]] std::string macOf(std::string_view line) const;
  /// "p-" and 16 hexadecimal digits, the same for a person throughout a study. Includes the person's
  /// `created_unix_ns`, so that a new person with an old name gets another pseudonym.
  [[nodiscard]] std::string ofPerson(std::string_view study, std::string_view name,
                                     std::int64_t created_unix_ns) const;
  /// "s-" and 32 hexadecimal digits.
  [[nodiscard]] std::string ofSession(std::string_view study, const Uuid& session) const;

 private:
  Hash key_;
};

/// "erased-" and 12 hexadecimal digits, at random: in the place of an erased person's name.
std::string newErasurePseudonym();
/// Whether a name has that form.
bool isErasurePseudonym(std::string_view name);
/// kInvalidInput: it has that form, so that nobody gets an erased person's sessions.
Status checkNoPseudonym(std::string_view field, std::string_view name);

/// Lower-case hexadecimal digits.
std::string hexDigitsOf(std::string_view bytes);
/// The inverse. kInvalidInput.
Result<std::string> bytesOfHex(std::string_view hex);

/// Replaces a name in someone else's text, case-insensitively, where it is a whole word, and each word of the
/// full name longer than two letters. Punctuation of every script ends a word. A name in a script other than
/// Latin, Greek, Cyrillic and Armenian is replaced wherever it stands, also within a word. For remarks that
/// leave the lab: replacing one word too many is better than one too few.
std::string withoutName(const std::string& text, std::string_view name, std::string_view full_name,
                        std::string_view in_its_place);

/// One person's names, and other names that contain them.
struct ErasedNames {
  std::string name;
  std::vector<std::string> full_names;  ///< current and earlier ones
  OtherNames others;                    ///< names and ids of others that contain one of these
  std::string in_its_place;             ///< the pseudonym
  /// What people typed at stations for this person: any word.
  std::vector<std::string> given;
  /// Nobody had `name`: somebody typed it at a station, as a given name. It is any word, too.
  bool typed = false;
};

/// Replaces name and full names as a whole, case-insensitively, except within one of `others`. `own`, for
/// texts about this person: also replaces names that were typed at a station, and, case-sensitively, each
/// word of a full name longer than two letters. In other texts they may be a common word.
std::string withoutNames(const std::string& text, const ErasedNames& names, bool own);
/// Looks for a name, a given or a full name, or a word of one, anywhere in texts, in either case of any
/// script (foldCase), but for `others`. It finds more than withoutNames() replaces: "Annabel" for "anna",
/// "ÖSTLUND" for "Östlund", "WEISS" for "Weiß", and a part of a full name, also one beside a hyphen. Thread:
/// immutable.
class NameSearch {
 public:
  explicit NameSearch(const ErasedNames& names);
  [[nodiscard]] bool finds(std::string_view text) const;

 private:
  std::vector<std::string> words_;  ///< folded
  OtherNames others_;               ///< folded
};

/// Full names of a person in the audit log, oldest first, each once. "user change" writes them at the end of
/// its line: "full name: 'Old' to 'New'". Reads the lines behind number `after`, all of them.
Result<std::vector<std::string>> loggedFullNames(Connection& connection, std::string_view name,
                                                 std::int64_t after = -1);
/// Fills in `others` from the names and ids of people, sessions, stations, profiles and courses. `of_groups`:
/// with the names and ids of groups. None of `besides` is one.
Status addOthers(Connection& connection, ErasedNames& names, bool of_groups = true,
                 const std::set<std::string>& besides = {});

/// Names in a line of the audit log that the program put there: who did it, the person whom it is about,
/// whose samples were read. Some may be a station's.
std::vector<std::string> namesIn(const AuditRow& line);

/// Removes the person from a line of the audit log. Replaces who and subject only where they mean this person
/// (the action decides for the subject), and names in the detail according to the person that it is about.
/// Who did something had an account, so a name that was typed at a station is never that. `own_sessions`: ids
/// as text.
AuditRow withoutNames(const AuditRow& line, const ErasedNames& names,
                      const std::set<std::string>& own_sessions);

}  // namespace needlelab
