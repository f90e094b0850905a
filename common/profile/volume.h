/// A profile's volume as a field.
#pragma once

#include <optional>

#include "common/anatomy/field.h"
#include "common/anatomy/tube_axes.h"
#include "common/base/result.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// The author's values of a volume, in the profile's frame. Valid only if checkVolume says so.
FieldSpec fieldSpecOf(const pb::Volume& volume);

/// Compiles a volume. Errors: those of checkVolume.
Result<Field> fieldOf(const pb::Volume& volume);

/// The tubes of the group that a structure's first rule names; nullopt without a rule, or if that group has
/// other shapes.
std::optional<TubeAxes> tubeAxesOf(const pb::Volume& volume, const pb::Volume::Structure& structure);

/// Checks what the fields' own options cannot: references, names, shapes. Errors: kInvalidInput,
/// `volume.PATH: words`.
Status checkVolume(const pb::Volume& volume);

}  // namespace needlelab
