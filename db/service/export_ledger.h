/// Exports that go on over pages: whose they are, and what of them is written down. Private to this folder.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/service/requests.h"

namespace needlelab {

/// A page of an export is only good for who began it, by the same request, at this program: so each export
/// begins with its first page, and that is in the audit log. Thread: any.
class ExportLedger {
 public:
  /// With a key of its own: pages are good until the program ends.
  ExportLedger();

  /// `what`: the request, with all that decides about what it gives out. `place`: where it goes on.
  [[nodiscard]] std::string seal(const Principal& who, std::string_view what, std::string_view place) const;
  /// The place; empty for an empty page, the first. kInvalidInput: a page that was not made by seal() of the
  /// same request of the same person.
  [[nodiscard]] Result<std::string> open(const Principal& who, std::string_view what,
                                         std::string_view page) const;

  /// Whether to write down that `who` reads `what` now: once an hour, for what is read in many requests.
  bool isNew(const Principal& who, std::string_view what, std::int64_t now_unix_ns);

 private:
  [[nodiscard]] std::string seal16(const Principal& who, std::string_view what, std::string_view place) const;
  std::array<unsigned char, 32> key_{};
  std::mutex mutex_;
  std::map<std::string, std::int64_t> noted_;  ///< guarded by mutex_: when
};

}  // namespace needlelab
