/// The zero-force packet that a device with its own thread sends when the program crashes. The signal handler
/// sends it, because no other part of the program may still work.
#pragma once

#include <sys/types.h>

namespace needlelab {

/// Sends the zero-force packet to the device behind the open file. Runs in a signal handler, possibly while
/// the device's own thread still runs: async-signal-safe, takes at most about 100 ms. Returns false when the
/// device did not accept the packet.
using CrashPacketSender = bool (*)(int file) noexcept;

/// Registers `sender` and `file` for the packet, and the calling thread as the device's own. Replaces an
/// earlier registration.
void registerCrashPacket(CrashPacketSender sender, int file) noexcept;
/// Call it before closing the file.
void unregisterCrashPacket() noexcept;

/// Returns the thread that registered; 0: none. Async-signal-safe.
[[nodiscard]] pid_t crashPacketThread() noexcept;
/// Returns false when no device is registered, or the device did not accept the packet. Async-signal-safe.
bool sendCrashPacket() noexcept;

}  // namespace needlelab
