/// A question to the server whose answer somebody waits for: private to the uplink.
#pragma once

#include <optional>

#include "client/net/uplink.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// Guarded by the uplink's mutex.
struct Uplink::Call {
  pb::Request request;
  std::uint64_t sent_as = 0;  // the request's id on this connection; 0 = not sent
  std::optional<Result<pb::Reply>> result;
};

}  // namespace needlelab
