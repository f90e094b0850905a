/// Shared by all programs: exit codes, files embedded in the binary, and the name of the machine.
#pragma once

#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

// exit codes of every binary
inline constexpr int kExitDone = 0;  ///< done; an offline station with its spool safe counts as done
/// The work failed: FAULT, verification failed, log-in refused, port taken.
inline constexpr int kExitFailed = 1;
inline constexpr int kExitInvalid = 2;  ///< wrong usage or invalid input

inline int exitCodeOf(const Error& error) {
  return error.code == ErrorCode::kInvalidInput ? kExitInvalid : kExitFailed;
}

/// Flushes the standard streams. Returns `code`, or kExitFailed with a line on standard error when `code`
/// means success but standard output could not be written. Call it last in `main`.
int afterOutput(int code, const char* program);

/// Ends the program: flushes the standard streams, but calls neither atexit handlers nor destructors of
/// static objects, including those of libraries. For programs whose libraries keep threads running to the end
/// (a window's driver, the mathematics of a reference model). Call it last in `main`, after all of the
/// program's own objects are destroyed. Thread: the one that ends the program.
[[noreturn]] void endProgram(int code);

/// A text file embedded in the binary at build time (deploy/cmake/NeedlelabEmbed.cmake).
struct EmbeddedFile {
  std::string_view name;  ///< without folder
  std::string_view text;
};

/// The version of every program, recording, score and export: "1.0.0~git20261129.4bd1e890" with the date and
/// hash of the last commit, "+changed" behind it if the sources differ from that commit. The build writes it
/// (deploy/cmake/NeedlelabVersion.cmake).
std::string programVersion();

/// Names the machine; printed beside every measured figure. Processor, cores, system, e.g.
/// "Intel(R) Xeon(R) …, 2 cores, Linux 6.1.0 x86_64". Reads /proc/cpuinfo: not for the haptic thread.
std::string machineText();

}  // namespace needlelab
