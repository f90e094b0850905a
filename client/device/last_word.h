/// What is left to a device with a thread of its own when the program crashes: a packet without force, sent
/// by the signal's handler itself. Nobody else may be alive who could.
#pragma once

#include <sys/types.h>

namespace needlelab {

/// Tells the device behind the open file that there is no force. Called within a signal's handler, also while
/// the device's own thread still works: async-signal-safe, at most about 100 ms. False: it was not taken.
using LastWord = bool (*)(int file) noexcept;

/// The calling thread is the one that talks with the device, and `say` tells it the last word, until that is
/// withdrawn. One device has it at a time: the newest.
void offerLastWord(LastWord say, int file) noexcept;
/// Before the file is closed.
void withdrawLastWord() noexcept;

/// The thread that offered it; 0: nobody. Async-signal-safe.
[[nodiscard]] pid_t lastWordThread() noexcept;
/// False when nobody offered it, or it was not taken. Async-signal-safe.
bool sayLastWord() noexcept;

}  // namespace needlelab
