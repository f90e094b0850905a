#include "common/haptics/axial_entry.h"

#include <array>
#include <string>

#include "common/haptics/spec_checker.h"

namespace needlelab {

// To add a model: add a file here that makes its entry, an enumerator in axial_model.h, and a line in each of
// these two lists.
extern const AxialEntry kTrackingWallEntry, kPlainWallEntry, kDirectEntry, kVoigtEntry, kGodObjectEntry,
    kFirstOrderEntry, kStatisticalEntry, kPrecomputedEntry, kFemEntry, kOkamuraEntry, kDahlEntry;

namespace {

constexpr std::array<const AxialEntry*, kAxialModelCount> kAxialEntries = {
    &kTrackingWallEntry, &kPlainWallEntry,  &kDirectEntry,      &kVoigtEntry,
    &kGodObjectEntry,    &kFirstOrderEntry, &kStatisticalEntry, &kPrecomputedEntry,
    &kFemEntry,          &kOkamuraEntry,    &kDahlEntry};

// stands for a model that is not in this build: `validate` refuses such a scene by name, so that no other
// model renders it silently
constinit const AxialEntry kNotBuiltEntry = {
    .model = {},
    .label = {},
    .short_name = {},
    .steps = nullptr,
    .renders = 0,
    .check =
        [](const SceneSpec& spec, SpecChecker& check) {
          check.enter("");
          check.require(false, "axial_model",
                        "number " + std::to_string(static_cast<int>(spec.axial_model)) +
                            " is not built into this version");
        },
    .compile = [](const SceneSpec&, SceneModel&) {}};

}  // namespace

std::span<const AxialEntry* const, kAxialModelCount> axialEntries() {
  return kAxialEntries;
}

const AxialEntry& axialEntry(AxialModel model) {
  const auto index = static_cast<std::size_t>(model);
  return index < kAxialEntries.size() ? *kAxialEntries[index] : kNotBuiltEntry;
}

}  // namespace needlelab
