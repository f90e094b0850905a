/// Finds what is wrong with a PostgreSQL address, before connecting and after a failure to connect. Private
/// to this folder.
#pragma once

#include <string>

#include "common/base/result.h"

namespace needlelab {

/// host, port, database and user of a URL, for messages. kInvalidInput also if it contains a password.
Result<std::string> withoutPassword(const std::string& url);

/// `said`: libpq's message about a failed connection, with lines for each host it tried. kDenied: user,
/// password or pg_hba.conf. kInvalidInput: something does not exist (database, user, host name, file), or a
/// bad parameter value. kUnavailable: one of the hosts may answer later, or the server's messages are not
/// English (libpq gives no SQLSTATE for a failed connection).
Error cannotConnect(const std::string& shown_url, const char* said);

}  // namespace needlelab
