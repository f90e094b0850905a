#include "common/haptics/gate/handle_stiffness.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <string_view>
#include <vector>

#include "common/base/text/text.h"
#include "common/haptics/effects/effect_entry.h"

namespace needlelab {
namespace {

// the lever's components along and across the needle, squared
struct Lever {
  double along_m2 = 0, across_m2 = 0;
};
Lever leverOf(const Pose& X_HT) {
  const double along_m = dot(X_HT.p, zAxis(normalized(X_HT.q)));
  const double along_m2 = along_m * along_m;
  return {along_m2, std::max(0.0, normSquared(X_HT.p) - along_m2)};
}

// what tool and device bound
bool isOnLever(const EffectEntry& entry) {
  return entry.on_device.across_N_per_m != nullptr || entry.on_device.turning_Nm_per_rad != nullptr;
}

// the effects that a station lowers for them, those across the needle before those that turn it: "fixture,
// bone and orientation limit"
std::string loweredWords(EffectMask left_out) {
  std::vector<std::string_view> words;
  for (const bool turning : {false, true})
    for (const EffectEntry* entry : effectEntries()) {
      const OnDevice& on_device = entry->on_device;
      if (isOnLever(*entry) && (on_device.turning_Nm_per_rad != nullptr) == turning &&
          (left_out & bitOf(entry->effect)) == 0)
        words.push_back(on_device.words);
    }
  std::string list;
  for (std::size_t i = 0; i < words.size(); ++i)
    list += std::string(i == 0 ? "" : i + 1 < words.size() ? ", " : " and ") + std::string(words[i]);
  return list;
}

std::string atStart(std::string words) {
  if (!words.empty()) words.front() = upperCase(words.front());
  return words;
}

}  // namespace

// A turn θ of the handle moves the tip by θ × l. About the axis perpendicular to lever and needle, the
// movement's component along the needle is l_across and across it l_along; about the axis perpendicular to
// the lever in their common plane, all of it is across. These are the principal axes.
HandleStiffness handleStiffness(const SceneSpec& spec, double axial_N_per_m, const Pose& X_HT) {
  assert(axial_N_per_m >= 0);
  HandleStiffness of;
  for (const EffectEntry* entry : effectEntries()) {
    const OnDevice& on_device = entry->on_device;
    if ((spec.effects & bitOf(entry->effect)) == 0) continue;
    if (on_device.across_N_per_m != nullptr) of.across_N_per_m += on_device.across_N_per_m(spec);
    if (on_device.turning_Nm_per_rad != nullptr) of.turning_Nm_per_rad += on_device.turning_Nm_per_rad(spec);
  }
  const Lever lever = leverOf(X_HT);
  const double across = of.across_N_per_m;
  of.handle_Nm_per_rad =
      of.turning_Nm_per_rad + std::max(across * (lever.along_m2 + lever.across_m2),
                                       across * lever.along_m2 + axial_N_per_m * lever.across_m2);
  return of;
}

double heldStiffnessShare(const SceneSpec& spec, double axial_N_per_m, const DeviceLimits& limits,
                          const Pose& X_HT) {
  const HandleStiffness wanted = handleStiffness(spec, axial_N_per_m, X_HT);
  const Lever lever = leverOf(X_HT);
  const auto shareWithin = [](double stiffness, double most) {
    if (stiffness <= most) return 1.0;
    return std::max(0.0, most) / stiffness;
  };
  const double most = limits.max_rotational_stiffness_Nm_per_rad;
  const double turn = wanted.turning_Nm_per_rad + wanted.across_N_per_m * lever.along_m2;
  const double walls_Nm_per_rad = axial_N_per_m * lever.across_m2;
  // the walls alone may exceed the limit, even without what can be lowered
  if (walls_Nm_per_rad > most) return 0;
  return std::min({shareWithin(wanted.across_N_per_m, limits.max_stiffness_N_per_m),
                   shareWithin(turn + wanted.across_N_per_m * lever.across_m2, most),
                   shareWithin(turn, most - walls_Nm_per_rad)});
}

double stableInLightestGrip_N_per_m(double damping_Ns_per_m, double rate_hz, double delay_ticks) {
  return (damping_Ns_per_m + kLightestGrip_Ns_per_m) * rate_hz / (0.5 + delay_ticks);
}

void lowerStiffness(SceneSpec& spec, const StiffnessShares& shares) {
  for (const EffectEntry* entry : effectEntries()) {
    if (entry->lower == nullptr) continue;
    const bool turns = entry->on_device.turning_Nm_per_rad != nullptr;
    const double share = std::min(isOnLever(*entry) ? shares.lever : 1.0, turns ? 1.0 : shares.delay);
    assert(share > 0);
    if (share < 1) entry->lower(spec, share);
  }
}

std::string stiffnessShareText(const StiffnessShares& shares, EffectMask left_out) {
  std::string text;
  for (const EffectEntry* entry : effectEntries())
    if ((left_out & bitOf(entry->effect)) != 0)
      text += fmt::format("{} was left out: {}. ", atStart(std::string(entry->on_device.words)),
                          entry->on_device.was_without);
  if (shares.lever < 1)
    text += fmt::format("{} were rendered at {:.0f} % of the profile's stiffness. ",
                        atStart(loweredWords(left_out)), 100 * shares.lever);
  if (!text.empty()) text += "This device and tool cannot hold more.";
  if (shares.delay < 1)
    text += fmt::format(
        "{}Because the device's force comes late, what acts along the needle was rendered at {:.0f} % of the "
        "profile's stiffness: the tissue's forces are the same, over a longer way.",
        text.empty() ? "" : " ", 100 * shares.delay);
  return text;
}

}  // namespace needlelab
