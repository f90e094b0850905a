#include "common/haptics/effects/effect_entry.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <iterator>

#include "common/base/text/text.h"

namespace needlelab {

// To add an effect: add a file here that makes its entry, an enumerator in scene_spec.h, and a line in each
// of these two lists.
extern const EffectEntry kCuttingEntry, kAttractedEntry, kClampingEntry, kOrientationLimitEntry,
    kShaftFrictionEntry, kPunctureEntry, kCutMemoryEntry, kBoneEntry, kHubEntry, kPalpationEntry;
extern const std::array<EffectEntry, kDummyEffectCount> kDummyEntries;  // only in tests/instructions

namespace {

constexpr auto kEntries = [] {
  std::array<const EffectEntry*, kEffectCount> entries = {
      &kCuttingEntry,       &kAttractedEntry, &kClampingEntry,  &kOrientationLimitEntry,
      &kShaftFrictionEntry, &kPunctureEntry,  &kCutMemoryEntry, &kBoneEntry,
      &kHubEntry,           &kPalpationEntry};
  std::size_t next = kEffectCount - kDummyEffectCount;
  for (const EffectEntry& dummy : kDummyEntries) entries[next++] = &dummy;
  return entries;
}();

}  // namespace

std::span<const EffectEntry* const, kEffectCount> effectEntries() {
  return kEntries;
}

std::span<const EffectEntry* const> effectsAsShown() {
  static const auto kShown = [] {
    std::vector<const EffectEntry*> sorted;
    std::copy_if(kEntries.begin(), kEntries.end(), std::back_inserter(sorted),
                 [](const EffectEntry* entry) { return entry->value != nullptr; });
    std::stable_sort(sorted.begin(), sorted.end(),
                     [](const EffectEntry* a, const EffectEntry* b) { return a->place < b->place; });
    return sorted;
  }();
  return kShown;
}

const EffectEntry& effectEntry(Effect effect) {
  assert(static_cast<std::size_t>(effect) < kEffectCount);
  assert(kEntries[static_cast<std::size_t>(effect)]->effect == effect && "the list has the order of Effect");
  return *kEntries[static_cast<std::size_t>(effect)];
}

void useUsualNumbers(const EffectEntry& entry, SceneSpec& spec) {
  for (const EffectField& field : entry.fields) field.of(spec) = field.begins_with;
}

std::vector<std::string> effectNames(EffectMask effects) {
  std::vector<std::string> names;
  for (const EffectEntry* entry : kEntries)
    if ((effects & bitOf(entry->effect)) != 0) names.emplace_back(entry->name);
  return names;
}

std::string effectWords(const EffectEntry& entry, char between) {
  std::string words;
  for (const char c : entry.name) words += c == '_' ? between : lowerCase(c);
  return words;
}

}  // namespace needlelab
