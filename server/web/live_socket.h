/// The live page's WebSocket: sends a viewer the board whenever it changes.
#pragma once

#include <memory>
#include <string>

namespace needlelab {

class HttpTakeover;
class WebServer;

/// Sends one message at a time to a viewer and skips changes in between, so that nothing queues up. Cuts a
/// viewer that does not accept a message within live_write_timeout. Ends with the viewer's session. Ignores
/// the contents of the viewer's messages; one of more than 4 KiB ends the connection. Calls viewerLeft at its
/// end. `token`: of the session. Thread: the network's.
std::shared_ptr<HttpTakeover> makeLiveSocket(std::shared_ptr<WebServer> server, std::string token,
                                             std::string who);

}  // namespace needlelab
