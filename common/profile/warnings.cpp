#include "common/profile/warnings.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/base/text/text.h"
#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/profile/layer_names.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {

namespace {

constexpr double kMinFidelity = 0.5;
constexpr double kNoticeableShare = 0.1;

/// Three significant digits: enough for a sentence.
std::string shortNumber(double value) {
  return fmt::format("{:.3g}", value);
}

bool lists(const pb::Profile& profile, pb::Profile::Effect effect) {
  return std::find(profile.effects().begin(), profile.effects().end(), effect) != profile.effects().end();
}

/// "layers[3] (ligamentum flavum, 5 mm)"
std::string describedLayer(const pb::Profile& profile, int i) {
  return fmt::format("layers[{}] ({}, {} mm)", i, layerNames(profile)[static_cast<std::size_t>(i)],
                     shortNumber(profile.layers(i).thickness_m() * 1e3));
}

/// The depth at which a pushed membrane ruptures: the positive root of k1 z + k2 z² = force, in the form
/// that does not lose digits when k2 is small.
double ruptureDepth(double k1, double k2, double force) {
  return 2 * force / (k1 + std::sqrt(k1 * k1 + 4 * k2 * force));
}

/// Some models have their own membranes; PUNCTURE's act under every other model.
std::optional<MembraneSpec> membraneOf(const AxialEntry& axial, const LayerSpec& layer, bool punctures) {
  if (axial.topOf != nullptr) return axial.topOf(layer);
  return punctures ? layer.membrane : std::nullopt;
}

void warnAboutRupture(const pb::Profile& profile, const LayerSpec& layer, int i,
                      std::vector<std::string>& warnings) {
  const auto membrane = membraneOf(axialEntryOf(profile), layer, lists(profile, pb::Profile::PUNCTURE));
  if (!membrane) return;
  const double depth_m =
      ruptureDepth(membrane->linear_N_per_m, membrane->quadratic_N_per_m2, membrane->force_N);
  if (depth_m > layer.thickness_m)
    warnings.push_back(describedLayer(profile, i) + ": its membrane ruptures at " +
                       shortNumber(membrane->force_N) + " N only " + shortNumber(depth_m * 1e3) +
                       " mm deep, below the layer; make it stiffer or weaker");
}

/// Only models with a wall follow the layers' cutting forces, with a spring of K_t.
void warnAboutLayers(const pb::Profile& profile, std::vector<std::string>& warnings) {
  // a structure has no thickness of its own, and no order of depth
  if (profile.has_volume()) return;
  const auto scene = sceneSpecOf(profile);
  if (!scene) return;
  double force_before_N = 0;
  for (int i = 0; i < profile.layers_size(); ++i) {
    const pb::Layer& layer = profile.layers(i);
    warnAboutRupture(profile, scene->layers[static_cast<std::size_t>(i)], i, warnings);
    // where no needle enters the bone, the tissue above continues
    if (layer.tissue() == pb::Layer::BONE && lists(profile, pb::Profile::BONE)) continue;
    if (axialEntryOf(profile).follows_layers && lists(profile, pb::Profile::CUTTING)) {
      const double stiffness = layer.has_wall_stiffness_n_per_m()
                                   ? layer.wall_stiffness_n_per_m()
                                   : profile.tracking_wall().stiffness_n_per_m();
      const double phi = fidelity(force_before_N, layer.cutting_force_n(), stiffness, layer.thickness_m());
      if (phi < kMinFidelity) {
        warnings.push_back(describedLayer(profile, i) + ": too thin to be felt, fidelity " +
                           shortNumber(phi) + " is below 0.5: the cutting force rises from " +
                           shortNumber(force_before_N) + " to " + shortNumber(layer.cutting_force_n()) +
                           " N, for which a wall of " + shortNumber(stiffness) + " N/m needs " +
                           shortNumber((layer.cutting_force_n() - force_before_N) / stiffness * 1e3) + " mm");
      }
    }
    force_before_N = layer.cutting_force_n();
  }
}

/// What the listed effects' rows remark.
void warnAboutEffects(const pb::Profile& profile, std::vector<std::string>& warnings) {
  const auto scene = sceneSpecOf(profile);
  if (!scene.ok()) return;
  for (const EffectEntry* entry : effectEntries()) {
    if (entry->remark == nullptr || (scene->effects & bitOf(entry->effect)) == 0) continue;
    if (const std::string remark = entry->remark(*scene); !remark.empty())
      warnings.push_back(fmt::format("effects: {} is listed, {}", entry->name, remark));
  }
}

void warnAboutModel(const pb::Profile& profile, std::vector<std::string>& warnings) {
  const AxialEntry& axial = axialEntryOf(profile);
  const std::string name(axialModelName(axial.model));
  const bool attracts = (axial.renders & bitOf(Effect::kAttracted)) != 0;
  if (!attracts && lists(profile, pb::Profile::ATTRACTED))
    warnings.push_back("effects: ATTRACTED is listed, axial_model " + name + " has no attracted force");
  warnAboutEffects(profile, warnings);
  if (!attracts && !lists(profile, pb::Profile::CUTTING))
    warnings.push_back("effects: CUTTING is not listed, without it axial_model " + name + " gives no force");
  if (axial.model == AxialModel::kStatistical) {
    std::string names;
    for (const std::string& synthetic : profile.statistical().synthetic())
      names += (names.empty() ? "" : ", ") + synthetic;
    if (!names.empty())
      warnings.push_back("statistical: synthetic, without data behind it: " + names);
    else if (profile.statistical().source().empty())
      warnings.push_back(
          "statistical: has no source and names nothing as synthetic; take its numbers as synthetic");
  }
  if (axial.model == AxialModel::kPrecomputed && profile.precomputed().source().empty())
    warnings.push_back("precomputed: says no source for its table");
}

/// Warns when the place of the tip's opening is unknown.
void warnAboutNeedle(const pb::Profile& profile, std::vector<std::string>& warnings) {
  const pb::Needle& needle = profile.needle();
  const bool has_diameter = needle.has_gauge() || needle.has_outer_diameter_m();
  if ((needle.has_tip() || needle.has_bevel_angle_rad()) && !has_diameter)
    warnings.push_back(
        "needle: its tip is described but neither gauge nor outer_diameter_m is given; injections are placed "
        "at the tip itself");
}

}  // namespace

double fidelity(double force_before_N, double force_N, double wall_stiffness_N_per_m, double thickness_m) {
  const double rise_N = force_N - force_before_N;
  if (rise_N <= kNoticeableShare * force_N) return 1;
  return std::max(0.0, 1 - (rise_N - kNoticeableShare * force_N) / (wall_stiffness_N_per_m * thickness_m));
}

std::vector<std::string> profileWarnings(const pb::Profile& profile) {
  std::vector<std::string> warnings;
  warnAboutNeedle(profile, warnings);
  warnAboutLayers(profile, warnings);
  warnAboutModel(profile, warnings);
  return warnings;
}

}  // namespace needlelab
