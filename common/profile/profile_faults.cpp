#include "profile/profile_faults.h"

#include "profile/message_json.h"
#include "profile/profile.h"
#include "profile/rules.h"
#include "profile/strict_json.h"

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
