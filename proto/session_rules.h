/// Checks a session's description. A station checks it before it records, so that it records nothing that a
/// server would refuse; the server checks it again, because it comes from the network.
#pragma once

#include "common/base/result.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// kInvalidInput names the field, its value and the allowed range.
Status checkDescription(const pb::SessionDescription& description);

}  // namespace needlelab
