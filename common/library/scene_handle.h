/// A scene behind the C interface, as libneedlelab-haptics makes it and libneedlelab asks for it. Both are
/// built together, so this is no interface for others.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <exception>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/scene_spec.h"
#include "common/library/include/needlelab/haptics.h"

namespace needlelab {

/// A compiled scene that may have a law of the user's own.
struct LibraryModel : SceneModel {
  nl_law law = nullptr;
  void* user = nullptr;
};

/// Writes a message, cut to the room for it.
inline void putError(const std::string& message, char* error, std::size_t error_size) {
  if (error == nullptr || error_size == 0) return;
  const std::size_t size = std::min(message.size(), error_size - 1);
  std::memcpy(error, message.data(), size);
  error[size] = '\0';
}

/// Runs `make`, which returns a Result of a pointer, at the border to C: no exception crosses it.
template <typename Make>
auto atBorder(char* error, std::size_t error_size, Make&& make) noexcept
    -> decltype(make().value().release()) {
  try {
    auto made = make();
    if (made.ok()) return made.value().release();
    putError(made.error().message, error, error_size);
  } catch (const std::exception& failure) {
    putError(failure.what(), error, error_size);
  }
  return nullptr;
}

inline Vec3 vec3Of(const double p[3]) {
  return {p[0], p[1], p[2]};
}
inline Pose poseOf(const nl_pose& pose) {
  return {vec3Of(pose.p_m), {pose.q[0], pose.q[1], pose.q[2], pose.q[3]}};
}

/// As nl_scene_with_law. Errors: kInvalidInput for a body, and for a slope outside [0, 10000] N/m.
Result<std::unique_ptr<nl_scene>> sceneWithLaw(const nl_scene& scene, nl_law law, void* user,
                                               double steepest_N_per_m);

}  // namespace needlelab

struct nl_scene {
  std::shared_ptr<const needlelab::SceneSpec> spec;
  std::shared_ptr<const needlelab::LibraryModel> model;
};

/// The scene of a spec; exported for libneedlelab only. Null with a message if it is not valid.
extern "C" NL_API nl_scene* nl_private_scene_of_spec(const needlelab::SceneSpec* spec, double rate_hz,
                                                     char* error, std::size_t error_size);
