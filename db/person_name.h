/// The rule of people's account names: two names with one key are one name. A name is stored and shown as it
/// was typed; `people.folded` has its key.
#pragma once

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// Under this name the server writes remarks and lines of the audit log of its own.
inline constexpr const char* kServerName = "server";

/// Without the white space (Unicode's White_Space) at both ends. Bytes that are not UTF-8 stay.
std::string_view trimmedName(std::string_view name);

/// What names are compared by: Unicode's normalisation form C of the full case folding, without characters
/// that have no shape of their own (Default_Ignorable_Code_Point). `name`: UTF-8; other bytes are left as
/// they are.
std::string nameKey(std::string_view name);

/// kInvalidInput: a new account may not have this name. Checks checkNewName(), white space at the ends, a
/// first character '@' (which ids begin with), U+FFFD, invisible characters, and the names that the server
/// uses itself: "server", "guest", "local", "local:…", "retention", "erasure".
Status checkNewPersonName(std::string_view field, std::string_view name);

/// The words behind "there is already": names the account and asks whether it is the same person.
std::string sameNameQuestion(std::string_view there, std::string_view typed);

/// Computes the keys again when this program's tables of Unicode differ from those that they were computed
/// with (meta `names_unicode`). kInvalidInput: two names would become one; it names both, and what to do.
/// Writer's connection, in a transaction.
Status refreshNameKeys(Connection& connection);

}  // namespace needlelab
