#include "client/device/virtuose/virtuose_probe.h"

#include "client/device/virtuose/virtuose_words.h"
#include "common/haptics/device_condition.h"

namespace needlelab {
namespace {

std::string versionWords(const VirtuoseApi& api, VirtContext context) {
  std::string text;
  if (const std::string version = virtuoseLibraryVersion(api); !version.empty())
    text += ", library " + version;
  int major = 0, minor = 0;
  if (api.virtGetControlerVersion != nullptr && api.virtGetControlerVersion(context, &major, &minor) == 0)
    text += ", device software " + std::to_string(major) + "." + std::to_string(minor);
  return text;
}

// what a person has to do before it works; empty when it is ready
std::string stateOf(const VirtuoseApi& api, VirtContext context) {
  int operational = 0;
  unsigned alarm = 0, failure = 0;
  // the code is that of the last call: the first refusal ends it
  const bool answered = api.virtGetEmergencyStop(context, &operational) == 0 &&
                        api.virtGetAlarm(context, &alarm) == 0 && api.virtGetFailure(context, &failure) == 0;
  if (!answered) {
    const int code = api.virtGetErrorCode(context);
    return "it does not tell how it is: " + virtuoseErrorWords(code, api.virtGetErrorMessage(code));
  }
  // nobody needs to hold it yet, and without permission it has no power
  return virtuoseStateWords(operational != 0 ? 0u : kDeviceEmergencyStop, alarm, failure);
}

}  // namespace

std::vector<FoundDevice> listVirtuose(const std::string& address, const std::string& library) {
  FoundDevice found{"virtuose:" + address, "Virtuose 6D Desktop", "", false};
  const auto api = library.empty() ? loadVirtuoseApi() : loadVirtuoseApi(library);
  if (!api.ok()) {
    found.state = api.error().message;
    return {found};
  }
  VirtContext context = api->virtOpen(address.c_str());
  if (context == nullptr) {
    const int code = api->virtGetErrorCode(nullptr);
    if (const std::string version = virtuoseLibraryVersion(*api); !version.empty())
      found.name += ", library " + version;
    found.state =
        "no device answers at " + address + ": " + virtuoseErrorWords(code, api->virtGetErrorMessage(code));
    return {found};
  }
  found.name += versionWords(*api, context);
  found.state = stateOf(*api, context);
  found.ready = found.state.empty();
  if (found.ready)
    found.state = "it answers; press its power switch and hold the handle when the lesson begins";
  api->virtClose(context);
  return {found};
}

}  // namespace needlelab
