/// Names in texts by others: found as they stand there, not within other words or other people's names.
#pragma once

#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/audit_store.h"
#include "db/connection.h"

namespace needlelab {

/// The name in a text by others is replaced where it stands as a word of its own, in either case; so is each
/// word of the full name that is longer than two letters. For texts in which a word too many is better than
/// one too few: remarks that leave the house.
std::string withoutName(const std::string& text, std::string_view name, std::string_view full_name,
                        std::string_view in_its_place);

/// One person's names, and what must not be taken for them.
struct ErasedNames {
  std::string name;
  std::vector<std::string> full_names;  ///< of now, and earlier ones
  std::vector<std::string> others;      ///< names and ids of others in which one of these stands
  std::string in_its_place;             ///< the pseudonym
};

/// Name and full names as wholes, in either case, but where one of `others` stands. `parts`: also each word
/// of a full name that is longer than two letters, in its own case: in texts that are about this person.
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
