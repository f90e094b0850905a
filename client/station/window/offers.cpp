#include "client/station/window/offers.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <set>
#include <string>
#include <utility>

#include "client/station/run/list_devices.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr auto kDevicePatience = std::chrono::seconds(3);
constexpr int kMostPages = 50;

void addName(std::vector<std::string>& names, const std::string& name) {
  if (checkName("trainee", name).ok() && std::find(names.begin(), names.end(), name) == names.end())
    names.push_back(name);
}

// "virtuose" of "virtuose:host#1", "falcon" of "falcon@1-4.2"
std::string kindOf(const std::string& spec) {
  return spec.substr(0, spec.find_first_of(":@"));
}

}  // namespace

LessonOffers offersHere(const StationOptions& options, const Spool& spool) {
  LessonOffers offers;
  offers.exercises = listExercises(LessonCache(options.spool).list(), std::nullopt);
  offers.profile_file = options.profile_file.string();
  if (options.trainee_given) addName(offers.trainees, options.trainee);
  for (const auto& sessions : {spool.unfinished(), spool.closedButNotSafe()})
    for (const auto& session : sessions) addName(offers.trainees, session->description().trainee());
  return offers;
}

Status addServersOffers(LessonOffers& offers, const std::vector<CachedLesson>& cached, const AskServer& ask) {
  auto exercises = exercisesBy(ask);
  if (!exercises.ok()) return exercises.error();
  std::vector<std::string> trainees = offers.trainees;
  std::vector<std::pair<std::string, std::string>> assigned;
  pb::Request request;
  request.mutable_list_assignments();
  for (int page = 0; page < kMostPages; ++page) {
    auto reply = ask(request);
    if (!reply.ok()) return reply.error();
    for (const pb::Assignment& assignment : reply->assignments().assignments()) {
      addName(trainees, assignment.trainee());
      if (!assignment.exercise_id().empty())
        assigned.emplace_back(printable(assignment.trainee()), printable(assignment.exercise_id()));
    }
    if (reply->assignments().next_page().empty()) break;
    request.mutable_list_assignments()->set_page(reply->assignments().next_page());
  }
  std::sort(trainees.begin(), trainees.end());
  offers.exercises = listExercises(cached, *exercises);
  offers.descriptions = std::move(*exercises);
  offers.trainees = std::move(trainees);
  offers.assigned = std::move(assigned);
  return {};
}

DeviceNews deviceNews(const StationOptions& options, bool steered, bool& hangs) {
  const std::string kind = kindOf(options.device);
  if (kind == "simulated")
    return {"simulated Virtuose 6D Desktop",
            steered ? "you move it with mouse and keys"
                    : "a simulated hand moves it (plan " + options.hand.plan + ")",
            true, true};
  if (kind == "recording") {
    const std::string file = options.device.substr(options.device.find(':') + 1);
    std::error_code error;
    const bool there = std::filesystem::is_regular_file(file, error);
    return {"recorded motion", there ? file + "; the hand feels nothing" : file + " is not there", there,
            true};
  }
  std::vector<DeviceLister> listers;
  for (DeviceLister& lister : deviceListers())
    if (kindOf(lister.spec) == kind) listers.push_back(std::move(lister));
  const DeviceList list = listDevices(listers, kDevicePatience);
  hangs = hangs || !list.all_answered;
  const FoundDevice* best = nullptr;
  for (const FoundDevice& found : list.devices)
    if (found.spec == options.device) best = &found;
  for (const FoundDevice& found : list.devices)
    if (best == nullptr || (found.ready && !best->ready && best->spec != options.device)) best = &found;
  if (best == nullptr) return {options.device, "there is none: plug it in and switch it on", false, true};
  return {best->name, best->state, best->ready, true};
}

}  // namespace needlelab
