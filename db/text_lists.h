/// A list of texts as one parameter of a statement: what many rows need is read by one statement, however
/// many there are. Private to db.
#pragma once

#include <span>
#include <string>

#include "db/connection.h"

namespace needlelab {

/// "is among the texts of parameter `parameter`" (from 1), to go behind an expression: "name" +
/// amongTexts(…).
std::string amongTexts(Connection& connection, int parameter);
/// Binds the next parameter of `statement`, which is of this connection, to such a list. Copies the texts.
Statement& bindTexts(Connection& connection, Statement& statement, std::span<const std::string> texts);

}  // namespace needlelab
