// The console's editor reads the effects from client/web/app/profile/effects.js. This test generates that
// file from the table of effects: NEEDLELAB_WRITE_EFFECTS=1 bin/haptics_test --gtest_filter='Console*'
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <cctype>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "common/haptics/effects/effect_entry.h"

namespace needlelab::test {
namespace {

std::string title(const EffectEntry& effect) {
  std::string words = effectWords(effect);
  words[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(words[0])));
  return words;
}

std::string effectsModule() {
  std::string text =
      "// The effects of a scene, as the editor shows them. Made by haptics_test from the rows in\n"
      "// common/haptics/effects; not to be edited "
      "(tests/unit/common/haptics/effects/console_effects_test.cpp).\n"
      "// prettier-ignore\nexport const kEffects = [\n";
  for (const EffectEntry* effect : effectEntries()) {
    text +=
        fmt::format("  {{ name: '{}', label: '{}', title: '{}'", effect->name, effect->label, title(*effect));
    if (!effect->section.empty()) {
      std::string fields, begin;
      for (const EffectField& field : effect->fields) {
        fields += fmt::format("{}['{}', '{}']", fields.empty() ? "" : ", ", field.name, field.label);
        begin += fmt::format("{}{}: {}", begin.empty() ? "" : ", ", field.name, field.begins_with);
      }
      text += fmt::format(",\n    section: '{}', fields: [{}]", effect->section, fields);
      if (const EffectChoice& choice = effect->choice; !choice.name.empty()) {
        std::string options;
        for (const EffectChoice::Option& option : choice.options)
          options += fmt::format("{}['{}', '{}']", options.empty() ? "" : ", ", option.name, option.label);
        text += fmt::format(",\n    choice: {{ name: '{}', label: '{}', options: [{}] }}", choice.name,
                            choice.label, options);
        begin += fmt::format(", {}: '{}'", choice.name, choice.begins_with);
      }
      text += fmt::format(",\n    begin: {{ {} }}", begin);
    }
    if (const OnDevice& on_device = effect->on_device; !on_device.words.empty()) {
      text += fmt::format(",\n    lowered: {{ words: '{}', turns: {}", on_device.words,
                          on_device.turning_Nm_per_rad != nullptr);
      if (!on_device.was_without.empty()) text += fmt::format(", without: '{}'", on_device.was_without);
      text += " }";
    }
    text += " },\n";
  }
  return text + "];\n";
}

TEST(ConsoleEffects, areThoseOfTheRows) {
  const std::string path = std::string(NEEDLELAB_SOURCE_DIR) + "/client/web/app/profile/effects.js";
  if (std::getenv("NEEDLELAB_WRITE_EFFECTS") != nullptr) std::ofstream(path) << effectsModule();
  std::stringstream found;
  found << std::ifstream(path).rdbuf();
  EXPECT_EQ(found.str(), effectsModule()) << "make it again, see above";
}

}  // namespace
}  // namespace needlelab::test
