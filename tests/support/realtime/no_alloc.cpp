#include "tests/support/realtime/no_alloc.h"

#include <cerrno>
#include <cstdlib>

#include "tests/support/sanitized.h"

namespace {

// trivial types only: these are used inside malloc, before anything is constructed
thread_local bool watching = false;
thread_local std::uint64_t calls_seen = 0;

void noteCall() noexcept {
  if (watching) ++calls_seen;
}

}  // namespace

#ifdef NEEDLELAB_SANITIZED

extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*malloc_hook)(const volatile void*,
                                                                             std::size_t),
                                                         void (*free_hook)(const volatile void*));
namespace {
void mallocHook(const volatile void*, std::size_t) {
  noteCall();
}
void freeHook(const volatile void*) {
  noteCall();
}
[[maybe_unused]] const int kInstalled = __sanitizer_install_malloc_and_free_hooks(mallocHook, freeHook);
}  // namespace

#else

// glibc lets a program define the malloc family itself and keeps its own under these names
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);

void* malloc(std::size_t size) noexcept {
  noteCall();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
  noteCall();
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) noexcept {
  noteCall();
  return __libc_realloc(block, size);
}
void* memalign(std::size_t alignment, std::size_t size) noexcept {
  noteCall();
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  noteCall();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t size) noexcept {
  noteCall();
  void* block = __libc_memalign(alignment, size);
  if (block == nullptr) return ENOMEM;
  *out = block;
  return 0;
}
void free(void* block) noexcept {
  noteCall();
  __libc_free(block);
}
}  // extern "C"

#endif

namespace needlelab::test {

NoAllocScope::NoAllocScope() noexcept {
  calls_seen = 0;
  watching = true;
}
NoAllocScope::~NoAllocScope() {
  watching = false;
}
std::uint64_t NoAllocScope::calls() const noexcept {
  return calls_seen;
}

}  // namespace needlelab::test
