#include <fmt/core.h>

#include <algorithm>
#include <span>
#include <string>
#include <variant>

#include "common/base/range.h"
#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/scene_spec.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

constexpr NumberRange kDuration{0, 10, true};
constexpr NumberRange kShare{0, 1};
/// Directions and segments shorter than this have no meaning after rounding.
constexpr double kShortestVector = 1e-6;

void checkLimb(const Limb& limb, SpecChecker& check) {
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) {
    check.enter("limb.plane.");
    check.point("point_m", plane->point_m);
    check.point("normal", plane->normal);
    check.require(norm(plane->normal) >= kShortestVector, "normal",
                  "is not a direction: give a vector that is not zero, pointing out of the tissue");
  } else if (const auto* sphere = std::get_if<SphereLimb>(&limb)) {
    check.enter("limb.sphere.");
    check.point("center_m", sphere->center_m);
    check.number("radius_m", sphere->radius_m, kLength);
  } else if (const auto* capsule = std::get_if<CapsuleLimb>(&limb)) {
    check.enter("limb.capsule.");
    check.point("a_m", capsule->a_m);
    check.point("b_m", capsule->b_m);
    check.require(norm(capsule->b_m - capsule->a_m) >= kShortestVector, "b_m",
                  "is the same point as a_m: a capsule needs a segment (use a sphere otherwise)");
    check.number("radius_m", capsule->radius_m, kLength);
  } else if (const auto* body = std::get_if<BodyLimb>(&limb)) {
    check.enter("");
    check.require(body->body != nullptr, "volume", "is missing");
  }
}

std::string modelsThatFollowLayers() {
  std::string names;
  for (const AxialEntry* entry : axialEntries())
    if (entry->follows_layers)
      names.append(names.empty() ? "" : " and ").append(axialModelName(entry->model));
  return names;
}

void checkLayer(const LayerSpec& layer, AxialModel model, bool attracted_live, SpecChecker& check) {
  check.number("thickness_m", layer.thickness_m, kLength);
  for (const EffectEntry* entry : effectEntries())
    if (entry->checkLayer != nullptr) entry->checkLayer(layer, check);
  check.number("rejection_force_n", layer.rejection_force_N, kForce);
  if (layer.wall_stiffness_N_per_m) {
    check.number("wall_stiffness_n_per_m", *layer.wall_stiffness_N_per_m, kStiffness);
    check.require(
        axialEntry(model).follows_layers, "wall_stiffness_n_per_m",
        fmt::format("is of {}, not of {}: leave it out", modelsThatFollowLayers(), axialModelName(model)));
  }

  // the force that remains in a stop cannot exceed the wall's limit in either direction
  const double greatest =
      attracted_live ? std::min(layer.cutting_force_N, layer.attracted_force_N) : layer.cutting_force_N;
  check.require(
      layer.rejection_force_N <= greatest, "rejection_force_n",
      numberText(layer.rejection_force_N) + " is above " + numberText(greatest) +
          ", the least of cutting_force_n and (where ATTRACTED is live) attracted_force_n of this layer");
}

void checkLayers(const SceneSpec& spec, SpecChecker& check) {
  check.enter("");
  check.require(!spec.layers.empty() && spec.layers.size() <= kMaxLayers, "layers",
                fmt::format("{} layers given, allowed are 1 to {}", spec.layers.size(), kMaxLayers));
  const bool attracted_live = (spec.effects & bitOf(Effect::kAttracted)) != 0 &&
                              std::any_of(spec.layers.begin(), spec.layers.end(),
                                          [](const LayerSpec& l) { return l.attracted_force_N > 0; });
  for (std::size_t i = 0; i < spec.layers.size(); ++i) {
    check.enter(fmt::format("layers[{}].", i));
    checkLayer(spec.layers[i], spec.axial_model, attracted_live, check);
  }
}

// accessors return a mutable reference, so pass a mutable scene
double numberOf(const EffectField& field, const SceneSpec& spec) {
  return field.of(const_cast<SceneSpec&>(spec));
}

bool hasAnyNumber(const EffectEntry& effect, const SceneSpec& spec) {
  return std::any_of(effect.fields.begin(), effect.fields.end(),
                     [&](const EffectField& field) { return numberOf(field, spec) != 0.0; });
}

void checkSections(const SceneSpec& spec, SpecChecker& check) {
  const TrackingWallSpec& wall = spec.tracking_wall;
  check.enter("tracking_wall.");
  check.number("stiffness_n_per_m", wall.stiffness_N_per_m, kStiffness);
  check.number("stop_speed_m_s", wall.stop_speed_mps, {0, 0.1, true});
  check.number("stop_dwell_s", wall.stop_dwell_s, kDuration);
  check.number("stop_duration_s", wall.stop_duration_s, kDuration);
  check.require(wall.stop_mode == StopMode::kRamp || wall.stop_mode == StopMode::kExponential, "stop_mode",
                "is neither RAMP nor EXPONENTIAL");
  check.number("relax_time_s", wall.relax_time_s, {0, 60, true});
  check.number("relax_residual", wall.relax_residual, kShare);

  for (const EffectEntry* entry : effectEntries()) {
    check.enter(std::string(entry->section) + (entry->section.empty() ? "" : "."));
    // without its section, a later effect's numbers are zero and it is not live
    if (!isPlaced(entry->effect) && !hasAnyNumber(*entry, spec)) continue;
    for (const EffectField& field : entry->fields)
      check.number(field.name, numberOf(field, spec), field.range);
    if (entry->check != nullptr) entry->check(spec, check);
  }
}

// flags and seeds have no range
void checkFields(std::span<const AxialField> fields, const SceneSpec& spec, std::size_t i,
                 SpecChecker& check) {
  for (const AxialField& field : fields) {
    const SpecNumber number = field.of(const_cast<SceneSpec&>(spec), i);
    if (const auto* real = std::get_if<double*>(&number)) check.number(field.name, **real, field.range);
    if (const auto* whole = std::get_if<std::int32_t*>(&number))
      check.number(field.name, **whole, field.range);
  }
}

void checkModelSection(const AxialSection& section, const SceneSpec& spec, SpecChecker& check) {
  const std::string name(section.name);
  if (section.inLayers()) {
    for (std::size_t i = 0; i < spec.layers.size(); ++i) {
      const std::string layer = fmt::format("layers[{}].", i);
      const bool is_in = section.isIn(spec.layers[i]);
      check.enter(layer);
      check.require(is_in, name,
                    fmt::format("is missing, and axial_model is {}", axialModelName(spec.axial_model)));
      check.enter(layer + name + ".");
      if (is_in) checkFields(section.fields, spec, i, check);
    }
    return;
  }
  check.enter(name + ".");
  checkFields(section.fields, spec, 0, check);
  if (section.table.empty()) return;
  const std::size_t rows = section.rows(spec);
  if (section.max_rows > 0)
    check.require(rows > 0 && rows <= section.max_rows, section.table,
                  fmt::format("{} rows given, allowed are 1 to {}", rows, section.max_rows));
  for (std::size_t i = 0; i < rows; ++i) {
    check.enter(fmt::format("{}.{}[{}].", name, section.table, i));
    checkFields(section.row_fields, spec, i, check);
  }
}

void checkModel(const SceneSpec& spec, SpecChecker& check) {
  const AxialEntry& axial = axialEntry(spec.axial_model);
  const AxialSection& section = axial.section;
  check.enter("");
  check.require(axial.needs_shells.empty() || !std::holds_alternative<BodyLimb>(spec.limb), "axial_model",
                fmt::format("is {}, which does not work in a volume: {}", axialModelName(spec.axial_model),
                            axial.needs_shells));
  for (const EffectEntry* entry : effectEntries())
    check.require(
        (spec.effects & axial.replaces & bitOf(entry->effect)) == 0, "effects",
        fmt::format("lists {}, which axial_model {} has its own of ({}{}{}{}): take it out", entry->name,
                    axialModelName(spec.axial_model), section.inLayers() ? "layers[]." : "", section.name,
                    section.table.empty() ? "" : ".", section.table));
  checkModelSection(section, spec, check);
  if (axial.check != nullptr) axial.check(spec, check);
}

}  // namespace

Status validate(const SceneSpec& spec) {
  SpecChecker check;
  check.enter("needle.");
  check.number("length_m", spec.needle_length_m, kLength);
  check.number("outer_diameter_m", spec.needle_diameter_m, {0, 0.005});
  checkLimb(spec.limb, check);
  checkLayers(spec, check);
  checkSections(spec, check);
  checkModel(spec, check);
  check.enter("");
  check.number("max_force_n", spec.max_force_N, kPositiveForce);
  check.require((spec.effects & ~kAllEffects) == 0, "effects", "has bits beyond the known effects");
  return check.take();
}

}  // namespace needlelab
