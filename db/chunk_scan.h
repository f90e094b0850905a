/// Steps through the chunks of a recording in order, and over those that cannot be read. Private to db.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// Where a session's recording stands (migrations/0003_retention.sql), and what was noted of it.
struct StoredRecording {
  enum class Kind {
    kOriginal = 1,
    kThinned = 2,
    kDeleted = 3,  ///< nothing to read: no chunks
  };
  Kind kind = Kind::kOriginal;
  std::int64_t session = 0;  ///< sessions.number
  std::uint64_t chunks = 0;
  [[nodiscard]] std::string_view table() const {
    return kind == Kind::kThinned ? "derived_chunks" : "chunks";
  }
};

/// Each chunk once, checked (CRC at its end, CRC and sample count in its row). A row that is not there, does
/// not agree or lies on a page that SQLite cannot read is a fault of that chunk; the next one is tried all
/// the same. Thread: as the connection, which must outlive it.
class ChunkScan {
 public:
  /// `name`: "session …", for messages. Chunks `from` to `to` − 1, at most those noted.
  ChunkScan(Connection& connection, std::string name, const StoredRecording& recording, std::uint64_t from,
            std::uint64_t to);

  struct Item {
    std::uint64_t seq = 0;
    std::uint64_t samples = 0;
    ByteView bytes;              ///< until the next call of next()
    std::optional<Error> fault;  ///< kCorrupt, names session and chunk; then there are no bytes
  };
  /// Nothing at the end. An error: the database could not be looked at.
  Result<std::optional<Item>> next();

 private:
  Error faultOf(const std::string& what) const;

  Connection& connection_;
  const std::string name_;
  const StoredRecording recording_;
  std::uint64_t next_;
  const std::uint64_t to_;
  std::optional<Statement> rows_;
  bool row_there_ = false;  ///< rows_ stands on a row that was not yet delivered
  bool at_end_ = false;     ///< rows_ has no more rows
};

}  // namespace needlelab
