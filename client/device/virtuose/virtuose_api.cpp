#include "client/device/virtuose/virtuose_api.h"

#include <dlfcn.h>
#include <fmt/core.h>

#include <cstdlib>

namespace needlelab {
namespace {

// loads the functions one by one; `missing` collects the names of missing ones
class Symbols {
 public:
  explicit Symbols(void* library) : library_(library) {}
  template <typename Function>
  void find(const char* name, Function& function) {
    if (!optional(name, function)) missing_ += (missing_.empty() ? "" : ", ") + std::string(name);
  }
  template <typename Function>
  bool optional(const char* name, Function& function) {
    function = reinterpret_cast<Function>(::dlsym(library_, name));
    return function != nullptr;
  }
  [[nodiscard]] const std::string& missing() const { return missing_; }

 private:
  void* library_;
  std::string missing_;
};

// `named_by`: where the name of `file` came from, for messages
Result<VirtuoseApi> load(const std::string& file, const std::string& named_by) {
  void* library = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    const char* why = ::dlerror();
    return Error{ErrorCode::kNotFound,
                 "the Virtuose's library" + named_by + " cannot be loaded: " + (why ? why : file.c_str()) +
                     ". It is the vendor's (Haption) and does not come with needlelab: install the Linux "
                     "VirtuoseAPI of your device and put " +
                     kVirtuoseLibraryName + " where the system finds it (then run ldconfig), or set " +
                     kVirtuoseLibraryVariable + " to its full path"};
  }
  VirtuoseApi api;
  Symbols symbols(library);
#define NEEDLELAB_FIND(name) symbols.find(#name, api.name)
  NEEDLELAB_FIND(virtOpen);
  NEEDLELAB_FIND(virtClose);
  NEEDLELAB_FIND(virtGetErrorCode);
  NEEDLELAB_FIND(virtGetErrorMessage);
  NEEDLELAB_FIND(virtSetIndexingMode);
  NEEDLELAB_FIND(virtSetForceFactor);
  NEEDLELAB_FIND(virtSetSpeedFactor);
  NEEDLELAB_FIND(virtSetTimeStep);
  NEEDLELAB_FIND(virtSetTimeoutValue);
  NEEDLELAB_FIND(virtSetBaseFrame);
  NEEDLELAB_FIND(virtSetObservationFrame);
  NEEDLELAB_FIND(virtSetCommandType);
  NEEDLELAB_FIND(virtSetPowerOn);
  NEEDLELAB_FIND(virtSaturateTorque);
  NEEDLELAB_FIND(virtGetPosition);
  NEEDLELAB_FIND(virtGetSpeed);
  NEEDLELAB_FIND(virtSetForce);
  NEEDLELAB_FIND(virtGetButton);
  NEEDLELAB_FIND(virtGetDeadMan);
  NEEDLELAB_FIND(virtGetEmergencyStop);
  NEEDLELAB_FIND(virtGetPowerOn);
  NEEDLELAB_FIND(virtGetAlarm);
  NEEDLELAB_FIND(virtGetFailure);
#undef NEEDLELAB_FIND
  if (!symbols.missing().empty())
    return Error{ErrorCode::kVersion, "the Virtuose's library " + file + named_by + " lacks " +
                                          symbols.missing() +
                                          ": it is another version than needlelab knows, or another "
                                          "library; install the vendor's current VirtuoseAPI, or set " +
                                          kVirtuoseLibraryVariable + " to the right file"};
  symbols.optional("virtAPIVersion", api.virtAPIVersion);
  symbols.optional("virtGetControlerVersion", api.virtGetControlerVersion);
  api.path = file;
  return api;
}

}  // namespace

Result<VirtuoseApi> loadVirtuoseApi(const std::string& file) {
  return load(file, "");
}

Result<VirtuoseApi> loadVirtuoseApi() {
  const char* named = std::getenv(kVirtuoseLibraryVariable);
  const bool is_set = named != nullptr && *named != '\0';
  return is_set ? load(named, std::string(" that ") + kVirtuoseLibraryVariable + " names")
                : load(kVirtuoseLibraryName, "");
}

std::string virtuoseLibraryVersion(const VirtuoseApi& api) {
  int major = 0, minor = 0;
  if (api.virtAPIVersion == nullptr || api.virtAPIVersion(&major, &minor) != 0) return {};
  return fmt::format("{}.{}{}", major, minor < 10 ? "0" : "", minor);
}

}  // namespace needlelab
