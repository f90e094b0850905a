#include "client/station/run/checks/list_devices.h"

#include <fmt/core.h>

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "client/device/factory/device_factory.h"
#include "client/station/run/io/terminal.h"
#include "common/base/program.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

// shared with the search threads, because one that never returns outlives the caller
struct Answers {
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<std::optional<std::vector<FoundDevice>>> found;
};

FoundDevice notListed(const DeviceLister& lister, const std::string& state) {
  return {lister.spec, lister.name,
          state + ": unplug and plug in the device, restart its driver or daemon, and look again", false};
}

void look(const DeviceLister& lister, std::size_t place, Answers& answers) {
  std::vector<FoundDevice> found;
  try {
    found = lister.look();
  } catch (const std::exception& error) {
    found = {notListed(lister, std::string("looking for it failed (") + error.what() + ")")};
  }
  const std::scoped_lock lock(answers.mutex);
  answers.found[place] = std::move(found);
  answers.changed.notify_all();
}

}  // namespace

std::vector<DeviceLister> deviceListers() {
  std::vector<DeviceLister> listers;
  for (const DeviceKind& kind : deviceKinds()) listers.push_back({kind.listed_as, kind.title, kind.list});
  return listers;
}

DeviceList listDevices(const std::vector<DeviceLister>& listers, std::chrono::milliseconds patience,
                       TimeSource& time) {
  const auto answers = std::make_shared<Answers>();
  answers->found.resize(listers.size());
  for (std::size_t i = 0; i < listers.size(); ++i)
    std::thread([answers, i, lister = listers[i]] { look(lister, i, *answers); }).detach();

  DeviceList list;
  std::unique_lock lock(answers->mutex);
  const std::int64_t due_ns = time.nowNs() + std::chrono::nanoseconds(patience).count();
  list.all_answered = time.waitUntilNs(answers->changed, lock, due_ns, [&] {
    return std::all_of(answers->found.begin(), answers->found.end(),
                       [](const auto& a) { return a.has_value(); });
  });
  for (std::size_t i = 0; i < listers.size(); ++i) {
    if (const auto& found = answers->found[i])
      list.devices.insert(list.devices.end(), found->begin(), found->end());
    else
      list.devices.push_back(notListed(
          listers[i], fmt::format("no answer within {:g} s", static_cast<double>(patience.count()) * 1e-3)));
  }
  return list;
}

std::string deviceListText(const std::vector<FoundDevice>& devices) {
  constexpr std::size_t kVerdict = 11;
  std::size_t spec = 8;
  for (const FoundDevice& device : devices) spec = std::max(spec, countCharacters(device.spec) + 2);
  std::string text = padded("--device", spec) + padded("", kVerdict) + "what it is, and how it is\n";
  for (const FoundDevice& device : devices) {
    text += padded(device.spec, spec) + padded(device.ready ? "ready" : "NOT READY", kVerdict);
    text += wrapped(device.name, spec + kVerdict).substr(spec + kVerdict);
    text += wrapped(device.state, spec + kVerdict);
  }
  return text;
}

std::string deviceListJson(const std::vector<FoundDevice>& devices) {
  auto rows = nlohmann::ordered_json::array();
  for (const FoundDevice& device : devices)
    rows.push_back(
        {{"device", device.spec}, {"name", device.name}, {"ready", device.ready}, {"state", device.state}});
  return reportJson(rows);
}

int runListDevices(const StationOptions& options) {
  constexpr auto kPatience = std::chrono::seconds(3);
  const DeviceList list = listDevices(deviceListers(), kPatience);
  const int code =
      printReport(options, deviceListText(list.devices), deviceListJson(list.devices), kExitDone);
  // a thread that hangs in a driver would use destroyed statics
  if (!list.all_answered) endProgram(code);
  return code;
}

}  // namespace needlelab
