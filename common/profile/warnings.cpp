#include <algorithm>
#include <cstdio>

#include "common/base/range.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

constexpr double kLeastFidelity = 0.5;
constexpr double kNoticeableShare = 0.1;

/// Three significant digits: enough for a sentence.
std::string shortNumber(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g", value);
  return text.data();
}

bool lists(const pb::Profile& profile, pb::Profile::Effect effect) {
  return std::find(profile.effects().begin(), profile.effects().end(), effect) != profile.effects().end();
}

std::string layerName(const pb::Profile& profile, int i) {
  return "layers[" + std::to_string(i) + "] (" + pb::Layer::Tissue_Name(profile.layers(i).tissue()) + ", " +
         shortNumber(profile.layers(i).thickness_m() * 1e3) + " mm)";
}

/// How far a membrane is pushed in when it ruptures: the positive root of k1 z + k2 z² = force, in the form
/// that does not lose digits when k2 is small.
double ruptureDepth(const pb::Puncture& puncture) {
  const double k1 = puncture.linear_n_per_m(), k2 = puncture.quadratic_n_per_m2(), force = puncture.force_n();
  return 2 * force / (k1 + std::sqrt(k1 * k1 + 4 * k2 * force));
}

/// FIRST_ORDER has its own surfaces; PUNCTURE's membranes act under every other model.
void warnAboutRupture(const pb::Profile& profile, int i, std::vector<std::string>& warnings) {
  const pb::Layer& layer = profile.layers(i);
  double depth_m = 0, force_N = 0;
  if (profile.axial_model() == pb::Profile::FIRST_ORDER && layer.has_first_order()) {
    force_N = layer.first_order().puncture_force_n();
    depth_m = force_N / layer.first_order().stiffness_n_per_m();
  } else if (layer.has_puncture() && lists(profile, pb::Profile::PUNCTURE)) {
    force_N = layer.puncture().force_n();
    depth_m = ruptureDepth(layer.puncture());
  }
  if (depth_m > layer.thickness_m())
    warnings.push_back(layerName(profile, i) + ": its membrane ruptures at " + shortNumber(force_N) +
                       " N only " + shortNumber(depth_m * 1e3) +
                       " mm deep, below the layer; make it stiffer or weaker");
}

/// Only the walls' force follows the layers' cutting forces by a spring of K_t.
void warnAboutLayers(const pb::Profile& profile, std::vector<std::string>& warnings) {
  const bool is_wall = profile.axial_model() <= pb::Profile::TRACKING_WALL;
  const double stiffness = profile.tracking_wall().stiffness_n_per_m();
  double force_before_N = 0;
  for (int i = 0; i < profile.layers_size(); ++i) {
    const pb::Layer& layer = profile.layers(i);
    warnAboutRupture(profile, i, warnings);
    if (is_wall && lists(profile, pb::Profile::CUTTING)) {
      const double phi = fidelity(force_before_N, layer.cutting_force_n(), stiffness, layer.thickness_m());
      if (phi < kLeastFidelity) {
        warnings.push_back(layerName(profile, i) + ": too thin to be felt, fidelity " + shortNumber(phi) +
                           " is below 0.5: the cutting force rises from " + shortNumber(force_before_N) +
                           " to " + shortNumber(layer.cutting_force_n()) + " N, for which a wall of " +
                           shortNumber(stiffness) + " N/m needs " +
                           shortNumber((layer.cutting_force_n() - force_before_N) / stiffness * 1e3) + " mm");
      }
    }
    force_before_N = layer.cutting_force_n();
  }
}

void warnAboutModel(const pb::Profile& profile, std::vector<std::string>& warnings) {
  const auto model = profile.axial_model();
  const bool attracts = model == pb::Profile::AXIAL_MODEL_UNSPECIFIED ||
                        model == pb::Profile::ENHANCED_TRACKING_WALL || model == pb::Profile::PRECOMPUTED;
  if (!attracts && lists(profile, pb::Profile::ATTRACTED))
    warnings.push_back("effects: ATTRACTED is listed, axial_model " + pb::Profile::AxialModel_Name(model) +
                       " has no attracted force");
  const bool cuts = model != pb::Profile::PRECOMPUTED && model > pb::Profile::ENHANCED_TRACKING_WALL;
  if (cuts && !lists(profile, pb::Profile::CUTTING))
    warnings.push_back("effects: CUTTING is not listed, without it axial_model " +
                       pb::Profile::AxialModel_Name(model) + " gives no force");
  if (model == pb::Profile::STATISTICAL) {
    std::string names;
    for (const std::string& name : profile.statistical().synthetic())
      names += (names.empty() ? "" : ", ") + name;
    if (!names.empty())
      warnings.push_back("statistical: synthetic, without data behind it: " + names);
    else if (profile.statistical().source().empty())
      warnings.push_back(
          "statistical: has no source and names nothing as synthetic; take its numbers as synthetic");
  }
  if (model == pb::Profile::PRECOMPUTED && profile.precomputed().source().empty())
    warnings.push_back("precomputed: says no source for its table");
}

/// A tip whose opening cannot be placed.
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
