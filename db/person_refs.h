/// Rows refer to a person by a ref, "@" and its id; people write names. Requests are translated to refs
/// before they are executed, and replies to names afterwards.
#pragma once

#include <google/protobuf/message.h>

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"

namespace needlelab {

/// "@17".
bool isPersonRef(std::string_view text);
/// "erased person 17", for the ref of an erased person.
std::string erasedName(std::string_view ref);

/// Adds a name that was typed at a station and that no account has. Checks nothing. Returns the ref.
/// Writer's connection.
Result<std::string> addTypedName(Connection& connection, std::string_view name, std::int64_t now_unix_ns);
/// The row in `names` of a new person. Writer's connection.
Status addNameOf(Connection& connection, std::int64_t person, std::string_view name,
                 std::string_view full_name, bool typed);

enum class Named {
  kAccount,         ///< people with an account
  kAccountOrTyped,  ///< or a name that was typed at a station, where no account has it
};
/// The ref of the person who is named by "@17", by "@" and the UUID, or by a name (nameKey()). An erased
/// person is found by id. Nothing: not found.
Result<std::optional<std::string>> findPerson(Connection& connection, std::string_view named,
                                              Named among = Named::kAccount);
/// "@" and the UUID, which stations and files have instead of a ref. Nothing: not found.
Result<std::optional<std::string>> outerRef(Connection& connection, std::string_view ref);
/// The same of many, by ref; those that are not found are left out.
Result<std::map<std::string, std::string>> outerRefs(Connection& connection,
                                                     std::span<const std::string> refs);

/// The names of refs, by ref. An erased person has erasedName(); an unknown ref is left out. In some
/// statements for all of them.
Result<std::map<std::string, std::string>> namesOfRefs(Connection& connection,
                                                       std::span<const std::string> refs);
/// One of them; any other text, or an unknown ref, as it is.
Result<std::string> shownName(Connection& connection, std::string_view ref);

/// The refs in a text, each once; not what is part of a word or an address, as in "user@10.0.0.1".
std::set<std::string> refsIn(std::string_view text);
/// The text with names in the place of refs, as far as `names` has them.
std::string withNames(std::string_view text, const std::map<std::string, std::string>& names);

/// Puts refs in the place of names in the fields of `message` that have the option `person`, where there is
/// such a person; other texts stay. Adds each that it put to `names`, as it was written.
Status toRefs(Connection& connection, google::protobuf::Message& message,
              std::map<std::string, std::string>& names);
/// How many bytes toNames() may add to the message at most.
std::size_t roomForNames(const google::protobuf::Message& message);
/// The inverse of toRefs(); and in texts about persons.
Status toNames(Connection& connection, google::protobuf::Message& message);

}  // namespace needlelab
