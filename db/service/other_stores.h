/// Other databases on PostgreSQL that may have this lab's people: one in which a copy of the lab's database
/// was begun, or that the lab has left (store_move.h). No erasure reaches them, and nothing but the file
/// DIR/other_stores knows of them. They are remembered until a person says that they are gone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// In the data folder, where it stays whichever database the folder works with.
inline constexpr const char* kOtherStoresFile = "other_stores";

struct OtherStore {
  enum class Kind {
    kCopy,  ///< a copy was begun there
    kLeft,  ///< the lab worked with it
    kUsed,  ///< the lab works with it, as long as its database is on PostgreSQL
  };
  std::string url;           ///< as `store copy` was given it; never with a password
  std::int64_t unix_ns = 0;  ///< when the copy was begun, or when the lab left it
  Kind kind = Kind::kCopy;
};

/// Those that are remembered and are not the one that the folder works with, the oldest first. kInvalidInput,
/// with the line, for a file of something else.
Result<std::vector<OtherStore>> readOtherStores(const std::filesystem::path& folder);
/// Remembers it, in the place of what was known of that address. On the disk when it returns. Under the
/// folder's lock.
Status rememberOtherStore(const std::filesystem::path& folder, const OtherStore& store);
/// The folder works with `url`. Where that is remembered, it is named again when the folder works with
/// needlelab.db (somebody has undone the move), also if DIR/store has another address of it by then. Under
/// the folder's lock.
Status noteStoreInUse(const std::filesystem::path& folder, std::string_view url);
/// Forgets that address, and removes the kept files store.replaced-* that have it. False: there was neither.
/// Under the folder's lock.
Result<bool> forgetOtherStore(const std::filesystem::path& folder, std::string_view url);

/// "URL (a copy was begun there on TIME)", separated by commas; others that `most_bytes` have no room for are
/// counted.
std::string otherStoresInText(const std::vector<OtherStore>& stores, std::size_t most_bytes);

/// For `check`: those that may have a person who was erased since, that is up to a day before the copy was
/// begun or the lab left it, because a clock may be behind. Empty: there is none. A file that cannot be read
/// is said, too.
std::string otherStoresOfErasedText(const std::filesystem::path& folder);

}  // namespace needlelab
