/// NEEDLELAB_SANITIZED is defined in ASan and TSan builds, because they replace functions of the C library.
#pragma once

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define NEEDLELAB_SANITIZED 1
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define NEEDLELAB_SANITIZED 1
#endif

namespace needlelab::test {
#ifdef NEEDLELAB_SANITIZED
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif
}  // namespace needlelab::test
