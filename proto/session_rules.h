/// Rules for the contents of messages, shared by stations and servers. A station checks a session's
/// description before recording, so that it does not record what a server would refuse; the server checks it
/// again, because it comes from the network.
#pragma once

#include "common/base/result.h"
#include "needlelab/control.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Errors: kInvalidInput, naming the field, its value and the allowed range.
Status checkDescription(const pb::SessionDescription& description);

/// Wipes the passwords, codes and lists of people in a request, but not the copies made by Protobuf and TLS.
void wipeSecrets(pb::Request& request);

}  // namespace needlelab
