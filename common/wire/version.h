/// The protocol's version: peers with different majors refuse each other; a minor adds only what others may
/// ignore.
#pragma once

#include <cstdint>
#include <string>

#include "common/base/result.h"
#include "needlelab/session.pb.h"

namespace needlelab {

inline constexpr std::uint32_t kProtocolMajor = 1;
inline constexpr std::uint32_t kProtocolMinor = 2;

pb::Version ourVersion();
std::string versionText(const pb::Version& version);
/// "needlelab-NAME 0.1.0"
std::string programText(const std::string& name);

/// kVersion, naming both, unless the majors are the same.
Status checkVersion(const pb::Version& ours, const pb::Version& theirs);

}  // namespace needlelab
