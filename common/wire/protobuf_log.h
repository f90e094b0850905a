/// What Protobuf has to say about malformed messages.
#pragma once

namespace needlelab {

/// Protobuf prints a line on standard error for each text that is no UTF-8, that is for each such message of
/// a hostile peer; who parsed it is told anyway, by an Error, and says so where it counts. From here on it
/// prints nothing. Called first by each program that reads what a network or a database gives it, before it
/// starts threads.
void keepProtobufQuiet();

}  // namespace needlelab
