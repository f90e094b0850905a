/// Who asks for something.
#pragma once

#include <string>

#include "needlelab/types.pb.h"

namespace needlelab {

/// A person or a station, after log-in.
struct Principal {
  std::string name;
  pb::Role role = pb::ROLE_UNSPECIFIED;
};

}  // namespace needlelab
