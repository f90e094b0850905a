#include "client/device/crash_packet.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>

namespace needlelab {
namespace {

// Never freed: a handler may read them at any instant. A file descriptor closed and reused meanwhile refuses
// a device's request.
std::atomic<CrashPacketSender> packet_sender{nullptr};
std::atomic<int> packet_file{-1};
std::atomic<pid_t> packet_thread{0};
static_assert(std::atomic<CrashPacketSender>::is_always_lock_free && std::atomic<int>::is_always_lock_free &&
              std::atomic<pid_t>::is_always_lock_free);

}  // namespace

void registerCrashPacket(CrashPacketSender sender, int file) noexcept {
  unregisterCrashPacket();
  packet_file.store(file);
  packet_thread.store(static_cast<pid_t>(::syscall(SYS_gettid)));
  packet_sender.store(sender);
}

void unregisterCrashPacket() noexcept {
  packet_sender.store(nullptr);
  packet_thread.store(0);
  packet_file.store(-1);
}

pid_t crashPacketThread() noexcept {
  return packet_thread.load();
}

bool sendCrashPacket() noexcept {
  const CrashPacketSender sender = packet_sender.load();
  const int file = packet_file.load();
  return sender != nullptr && file >= 0 && sender(file);
}

}  // namespace needlelab
