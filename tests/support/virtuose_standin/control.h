/// Control of the stand-in from a test: looks up the control functions in the library that the backend loads.
#pragma once

#include <dlfcn.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "tests/support/virtuose_standin/standin.h"

namespace needlelab::test {

/// Paths of the stand-in and of a library with missing functions. Both are in the build tree.
inline const std::string kStandinLibrary = NEEDLELAB_STANDIN;
inline const std::string kIncompleteLibrary = NEEDLELAB_STANDIN_INCOMPLETE;

/// The constructor resets the stand-in: a fresh device at rest, switched on, held, on virtual time.
class Standin {
 public:
  Standin() : library_(::dlopen(kStandinLibrary.c_str(), RTLD_NOW | RTLD_LOCAL)) {
    if (library_ == nullptr) throw std::runtime_error(::dlerror());
    find<void()>("standin_reset")();
  }
  ~Standin() { ::dlclose(library_); }
  Standin(const Standin&) = delete;
  Standin& operator=(const Standin&) = delete;

  void useRealTime() const { find<void(int)>("standin_virtual_time")(0); }
  /// `time.who` must live until the next Standin is created or this one is no longer used.
  void useTime(const StandinTime& time) const { find<void(const StandinTime*)>("standin_time")(&time); }
  void advance(double seconds) const { find<void(double)>("standin_advance")(seconds); }
  void command(const std::string& text) const {
    if (find<int(const char*)>("standin_command")(text.c_str()) != 0)
      throw std::invalid_argument("stand-in: no command " + text);
  }
  void script(const std::string& text) const {
    if (const int line = find<int(const char*)>("standin_script")(text.c_str()); line != 0)
      throw std::invalid_argument("stand-in: script, line " + std::to_string(line));
  }
  [[nodiscard]] StandinState state() const {
    StandinState state{};
    find<void(StandinState*)>("standin_state")(&state);
    return state;
  }
  [[nodiscard]] double feltForce_N() const {
    const StandinState now = state();
    return std::hypot(now.felt[0], now.felt[1], now.felt[2]);
  }
  [[nodiscard]] std::string calls() const { return find<const char*()>("standin_calls")(); }
  [[nodiscard]] std::string complaints() const { return find<const char*()>("standin_complaints")(); }

 private:
  template <typename Function>
  [[nodiscard]] Function* find(const char* name) const {
    return reinterpret_cast<Function*>(::dlsym(library_, name));
  }
  void* library_;
};

}  // namespace needlelab::test
