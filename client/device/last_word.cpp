#include "client/device/last_word.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>

namespace needlelab {
namespace {

// never freed: a handler may read them at any instant. A file that was closed meanwhile and is another one by
// now refuses a device's request.
std::atomic<LastWord> last_word{nullptr};
std::atomic<int> last_word_file{-1};
std::atomic<pid_t> last_word_thread{0};
static_assert(std::atomic<LastWord>::is_always_lock_free && std::atomic<int>::is_always_lock_free &&
              std::atomic<pid_t>::is_always_lock_free);

}  // namespace

void offerLastWord(LastWord say, int file) noexcept {
  withdrawLastWord();
  last_word_file.store(file);
  last_word_thread.store(static_cast<pid_t>(::syscall(SYS_gettid)));
  last_word.store(say);
}

void withdrawLastWord() noexcept {
  last_word.store(nullptr);
  last_word_thread.store(0);
  last_word_file.store(-1);
}

pid_t lastWordThread() noexcept {
  return last_word_thread.load();
}

bool sayLastWord() noexcept {
  const LastWord say = last_word.load();
  const int file = last_word_file.load();
  return say != nullptr && file >= 0 && say(file);
}

}  // namespace needlelab
