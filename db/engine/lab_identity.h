/// Which lab's database it is, and of which schema.
#pragma once

#include <cstdint>
#include <string>

namespace needlelab {

/// The lab's id, in `meta` of a database on PostgreSQL.
inline constexpr const char* kLabKey = "lab_id";

struct LabIdentity {
  std::string lab;  ///< kLabKey
  std::int64_t schema_version = 0;
};

}  // namespace needlelab
