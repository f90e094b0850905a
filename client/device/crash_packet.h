/// The packet without force that a device with a thread of its own sends when the program crashes: the signal
/// handler itself sends it, since nothing else of the program may be alive by then.
#pragma once

#include <sys/types.h>

namespace needlelab {

/// Sends the packet without force to the device behind the open file. Called in a signal handler, also while
/// the device's own thread still runs: async-signal-safe, takes at most about 100 ms. False: the packet was
/// not taken.
using CrashPacketSender = bool (*)(int file) noexcept;

/// From now on `sender` sends the packet to `file`, and the calling thread counts as the device's own. One
/// device is registered at a time: the newest.
void registerCrashPacket(CrashPacketSender sender, int file) noexcept;
/// Before the file is closed.
void unregisterCrashPacket() noexcept;

/// The thread that registered; 0: none. Async-signal-safe.
[[nodiscard]] pid_t crashPacketThread() noexcept;
/// False when no device is registered, or the packet was not taken. Async-signal-safe.
bool sendCrashPacket() noexcept;

}  // namespace needlelab
