/// What is wrong with an address of PostgreSQL: before somebody connects, and when nobody could. Private to
/// this folder.
#pragma once

#include <string>

#include "common/base/result.h"

namespace needlelab {

/// host, port, database and user of a URL, for messages; kInvalidInput, of one with a password, too.
Result<std::string> withoutPassword(const std::string& url);

/// `said`: what libpq says of a connection that it could not make, lines for each host that it tried.
/// kDenied: user, password or pg_hba.conf; kInvalidInput: what does not exist (database, user, host's name,
/// file), or a parameter's value; kUnavailable where one of the hosts may answer later, and where the
/// server's messages are not English, because libpq tells no SQLSTATE of a connection that was not made.
Error cannotConnect(const std::string& shown_url, const char* said);

}  // namespace needlelab
