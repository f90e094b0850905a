/// What a session's description may hold. It comes from a station, i.e. from the network.
#pragma once

#include "base/result.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// kInvalidInput names the field, its value and what is allowed.
Status checkDescription(const pb::SessionDescription& description);

}  // namespace needlelab
