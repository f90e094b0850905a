/// A viewer of the live page: a WebSocket that is sent the board as it changes.
#pragma once

#include <memory>
#include <string>

namespace needlelab {

class HttpTakeover;
class WebServer;

/// At most one message is under way to a viewer; what changes meanwhile is skipped, so that nothing piles up.
/// A viewer that has not taken a message after live_write_timeout is cut. It ends with the viewer's session.
/// The messages of a viewer are not looked at, and more than 4 KiB in one ends the connection. Its end tells
/// the server by viewerLeft.
/// `token`: of the session. Thread: the network's.
std::shared_ptr<HttpTakeover> makeLiveSocket(std::shared_ptr<WebServer> server, std::string token,
                                             std::string who);

}  // namespace needlelab
