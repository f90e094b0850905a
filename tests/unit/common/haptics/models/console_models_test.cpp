// The console's editor reads the axial models from client/web/app/profile/models.js. This test generates that
// file from the models' rows: NEEDLELAB_WRITE_MODELS=1 bin/haptics_test --gtest_filter='Console*'
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "common/haptics/axial_entry.h"

namespace needlelab::test {
namespace {

std::string modelsModule() {
  std::string text =
      "// The axial models, as the editor shows them. Made by haptics_test from the rows in\n"
      "// common/haptics/models; not to be edited "
      "(tests/unit/common/haptics/models/console_models_test.cpp).\n"
      "// prettier-ignore\nexport const kModels = [\n";
  for (const AxialEntry* model : axialEntries()) {
    const AxialSection& section = model->section;
    text += fmt::format("  {{ name: '{}', label: '{}'", axialModelName(model->model), model->label);
    if (model->follows_layers) text += ", follows_layers: true";
    if (!section.table.empty()) text += ", table: true";
    std::string fields;
    for (const AxialField& field : section.fields)
      if (!field.label.empty())
        fields += fmt::format("{}['{}', '{}']", fields.empty() ? "" : ", ", field.name, field.label);
    if (!fields.empty())
      text += fmt::format(",\n    {}: '{}', fields: [{}]", section.inLayers() ? "layer_section" : "section",
                          section.name, fields);
    text += " },\n";
  }
  return text + "];\n";
}

TEST(ConsoleModels, areThoseOfTheRows) {
  const std::string path = std::string(NEEDLELAB_SOURCE_DIR) + "/client/web/app/profile/models.js";
  if (std::getenv("NEEDLELAB_WRITE_MODELS") != nullptr) std::ofstream(path) << modelsModule();
  std::stringstream found;
  found << std::ifstream(path).rdbuf();
  EXPECT_EQ(found.str(), modelsModule()) << "make it again, see above";
}

}  // namespace
}  // namespace needlelab::test
