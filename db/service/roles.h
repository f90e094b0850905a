/// Which role may ask for what: one table (DESIGN §7).
#pragma once

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/service/principal.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// "user add", "session list", …: the words of the command line and of the audit log; "?" for no known call.
std::string_view callName(pb::Request::CallCase call);

/// kDenied names the call, the role, and the roles that may; kInvalidInput: the request holds no call that is
/// known.
Status checkRole(const Principal& principal, pb::Request::CallCase call);

/// "curriculum-manager" and the like.
std::string_view roleName(pb::Role role);
/// The inverse; ROLE_UNSPECIFIED when it is none.
pb::Role roleOfName(std::string_view name);

}  // namespace needlelab
