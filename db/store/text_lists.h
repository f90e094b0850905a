/// A list of texts as one statement parameter, so that data for many rows can be read in one statement,
/// however many there are. Private to db.
#pragma once

#include <span>
#include <string>

#include "db/store/connection.h"

namespace needlelab {

/// SQL for "is among the texts of parameter `parameter`" (from 1), to be appended to an expression: "name" +
/// amongTexts(…).
std::string amongTexts(Connection& connection, int parameter);
/// Binds such a list to the next parameter of `statement`, which must belong to this connection. Copies the
/// texts.
Statement& bindTexts(Connection& connection, Statement& statement, std::span<const std::string> texts);

}  // namespace needlelab
