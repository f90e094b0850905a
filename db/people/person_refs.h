/// Rows refer to a person by a ref, "@" and the person's id; users write names. Requests are translated to
/// refs before execution, and replies to names afterwards.
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
#include "common/base/text/uuid.h"
#include "db/store/connection.h"

namespace needlelab {

/// "@17".
bool isPersonRef(std::string_view text);
/// "erased person 17", for the ref of an erased person.
std::string erasedName(std::string_view ref);

/// Adds a name typed at a station that no account has. Checks nothing. Returns the ref. Needs the writer's
/// connection.
Result<std::string> addTypedName(Connection& connection, std::string_view name, std::int64_t now_unix_ns);
/// Adds a new person's row in `names`. Needs the writer's connection.
Status addNameOf(Connection& connection, std::int64_t person, std::string_view name,
                 std::string_view full_name, bool typed);

enum class Named {
  kAccount,         ///< people with an account
  kAccountOrTyped,  ///< or a name typed at a station that no account has
};
/// The ref of the person given as "@17", as "@" and the UUID, or by name (nameKey()). Finds erased people by
/// id. Nothing: not found.
Result<std::optional<std::string>> findPerson(Connection& connection, std::string_view named,
                                              Named among = Named::kAccount);
/// "@" and the UUID, which stations and files use instead of a ref. Nothing: not found.
Result<std::optional<std::string>> outerRef(Connection& connection, std::string_view ref);
/// Same for several, by ref; unknown refs are omitted.
Result<std::map<std::string, std::string>> outerRefs(Connection& connection,
                                                     std::span<const std::string> refs);

/// The names of refs, by ref; erasedName() for erased people. Unknown refs are omitted. Needs only a few
/// statements in total. `full_names` receives those that are known, by ref.
Result<std::map<std::string, std::string>> namesOfRefs(
    Connection& connection, std::span<const std::string> refs,
    std::map<std::string, std::string>* full_names = nullptr);
/// The name of one ref; any other text, or an unknown ref, is returned unchanged.
Result<std::string> shownName(Connection& connection, std::string_view ref);

/// The refs in a text, each once; not within a word or an address, as in "user@10.0.0.1".
std::set<std::string> refsIn(std::string_view text);
/// The text with refs replaced by those names that `names` has.
std::string withNames(std::string_view text, const std::map<std::string, std::string>& names);

/// Replaces names with refs in those fields of `message` that have the option `person`, if the person exists;
/// other texts stay. Adds each replaced name to `names` as it was written.
Status toRefs(Connection& connection, google::protobuf::Message& message,
              std::map<std::string, std::string>& names);
/// Upper bound of the bytes that toNames() adds to the message.
std::size_t roomForNames(const google::protobuf::Message& message);
/// The inverse of toRefs(); also replaces refs in texts about people.
Status toNames(Connection& connection, google::protobuf::Message& message);

}  // namespace needlelab
