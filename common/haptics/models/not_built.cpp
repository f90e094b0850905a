/// Stands for a model that this build does not have: `validate` refuses the scene by name, so that it is
/// never rendered by another model unnoticed.
#include <string>

#include "common/haptics/models/axial_entry.h"

namespace needlelab {

constinit const AxialEntry kNotBuiltEntry = {
    nullptr,
    [](const SceneSpec& spec, SpecChecker& check) {
      const auto index = static_cast<std::size_t>(spec.axial_model);
      check.enter("");
      check.require(false, "axial_model",
                    (index < kAxialModelCount ? std::string(kAxialModelNames[index])
                                              : "number " + std::to_string(index)) +
                        " is not built into this version");
    },
    [](const SceneSpec&) { return EffectMask{0}; }, [](const SceneSpec&, SceneModel&) {}};

}  // namespace needlelab
