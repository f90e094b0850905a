/// The rule for names that people type: two names with the same key are the same name. A name is stored and
/// shown as typed; `names.folded` has a person's key. look_alikes.h compares all other names.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/store/connection.h"

namespace needlelab {

/// The name under which the server itself writes remarks and audit lines.
inline constexpr const char* kServerName = "server";

/// Removes white space (Unicode's White_Space) at both ends. Bytes that are not UTF-8 stay.
std::string_view trimmedName(std::string_view name);

/// The key by which names are compared: normalisation form C of Unicode's full case folding, without
/// characters that have no shape of their own (Default_Ignorable_Code_Point), each run of white space as one
/// space, each hyphen, dash and minus as '-'. `name`: UTF-8; other bytes are unchanged.
std::string nameKey(std::string_view name);

/// kInvalidInput: not allowed as a new account name. Checks checkNewName(), white space at the ends, a
/// leading '@' (used by ids), U+FFFD, invisible characters, and the server's reserved names: "server",
/// "guest", "local", "local:…", "retention", "erasure".
Status checkNewPersonName(std::string_view field, std::string_view name);

/// The words after "there is already": names the account and asks whether it is the same person.
std::string sameNameQuestion(std::string_view there, std::string_view typed);

/// Recomputes the keys if this program's rule or Unicode tables differ from those used before (meta
/// `names_unicode`).
/// kInvalidInput: two names would become the same; the message names both and says what to do. Needs the
/// writer's connection, in a transaction.
Status refreshNameKeys(Connection& connection);

// --- erased people by name or UUID, to recognise their data in late stations or restored backups

/// How long an erased person's typed name waits for a manager instead of counting for a namesake: longer than
/// any station keeps its recordings.
inline constexpr std::int64_t kErasedNamesKept_ns = std::int64_t{400} * 86'400'000'000'000;

/// Whether a person with this name was erased after `started_unix_ns`, within the last kErasedNamesKept_ns: a
/// session that began then may be that person's, so it waits. Thread: as the connection; also for the next
/// function.
Result<bool> wasErased(Connection& connection, std::string_view name, std::int64_t started_unix_ns,
                       std::int64_t now_unix_ns);
/// Whether this is the UUID of an erased person.
Result<bool> isErased(Connection& connection, const Uuid& person);

}  // namespace needlelab
