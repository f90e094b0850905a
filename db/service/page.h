/// Lists that are longer than a message come in pages (control.proto). Private to this folder.
#pragma once

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <string>

#include "common/base/result.h"
#include "db/service/handlers.h"

namespace needlelab::handlers {

/// Counts the bytes of a page's rows.
class PageRoom {
 public:
  /// False: the page is full, `row_bytes` more do not fit. The first row always does.
  bool take(std::size_t row_bytes) {
    const bool fits = bytes_ == 0 || bytes_ + row_bytes <= kMaxReplyBytes;
    if (fits) bytes_ += row_bytes + 8;
    return fits;
  }

 private:
  std::size_t bytes_ = 0;
};

/// A page that is a number: a position in a list, or an id. 0 for the first page. kInvalidInput.
inline Result<std::uint64_t> numberOfPage(const std::string& page) {
  std::uint64_t number = 0;
  if (page.empty()) return number;
  const auto [end, error] = std::from_chars(page.data(), page.data() + page.size(), number);
  if (error == std::errc() && end == page.data() + page.size()) return number;
  return Error{ErrorCode::kInvalidInput, "page: give back the next_page of the reply before"};
}

}  // namespace needlelab::handlers
