/// What a session's description may hold. A station checks it before it records, so that nothing is recorded
/// that no server would take; a server again, because it comes from the network.
#pragma once

#include "common/base/result.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// kInvalidInput names the field, its value and what is allowed.
Status checkDescription(const pb::SessionDescription& description);

}  // namespace needlelab
