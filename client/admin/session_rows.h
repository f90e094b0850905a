/// What is known of a session, as JSON.
#pragma once

#include <string>

#include "client/admin/output.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Everything but profile, score and remarks.
Json sessionRow(const pb::SessionInfo& session);
/// Lower-case hexadecimal digits.
std::string hexOfBytes(const std::string& bytes);

}  // namespace needlelab
