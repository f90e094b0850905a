/// What stations and servers share about the contents of messages. A station checks a session's description
/// before it records, so that it records nothing that a server would refuse; the server checks it again,
/// because it comes from the network.
#pragma once

#include "common/base/result.h"
#include "needlelab/control.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// kInvalidInput names the field, its value and the allowed range.
Status checkDescription(const pb::SessionDescription& description);

/// Wipes the passwords, codes and lists of people in a request. What Protobuf and TLS copied stays.
void wipeSecrets(pb::Request& request);

}  // namespace needlelab
