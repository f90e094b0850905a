#include "common/wire/version.h"

namespace needlelab {

pb::Version ourVersion() {
  pb::Version version;
  version.set_major(kProtocolMajor);
  version.set_minor(kProtocolMinor);
  return version;
}

std::string versionText(const pb::Version& version) {
  return std::to_string(version.major()) + "." + std::to_string(version.minor());
}

std::string programText(const std::string& name) {
  return "needlelab-" + name + " " NEEDLELAB_VERSION;
}

Status checkVersion(const pb::Version& ours, const pb::Version& theirs) {
  if (ours.major() == theirs.major()) return {};
  return Error{ErrorCode::kVersion, "protocol versions do not fit: we speak " + versionText(ours) +
                                        ", the peer " + versionText(theirs) +
                                        "; install the same release on both sides"};
}

}  // namespace needlelab
