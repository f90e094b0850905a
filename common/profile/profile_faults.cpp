#include "common/profile/profile_faults.h"

#include "common/profile/message_json.h"
#include "common/profile/profile.h"
#include "common/profile/rules.h"
#include "common/profile/strict_json.h"

namespace needlelab {

std::vector<Error> profileFaults(std::string_view json) {
  const auto tree = readStrictJson(json, "profile", kMaxProfileBytes);
  if (!tree) return {tree.error()};
  pb::Profile profile;
  std::vector<Error> faults = messageFaults(*tree, profile);
  if (!faults.empty()) return faults;
  if (Status status = checkProfileRules(profile); !status) faults.push_back(status.error());
  return faults;
}

}  // namespace needlelab
