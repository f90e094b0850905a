/// Erasing a person while the server runs, and what a start makes up for.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "common/base/result.h"
#include "db/connection.h"
#include "db/service/retention.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// The person is erased. What is left to do, in steps: the chunks go, then the log is emptied.
struct ErasureUnderWay {
  pb::Reply reply;
  LeftoversSoFar chunks;
  std::string text_on_chunks;  ///< about those that stay; empty: none do
};

/// Makes DIR/erasures and the database agree: erases those of the list whom a restored backup brought back,
/// and adds to the list whom another server erased. Returns how many it erased. Before anything is served,
/// or with Duty::kErasure. Writer's connection, outside a transaction. Errors as ErasureStore::erase().
Result<std::size_t> agreeOnErasures(Connection& writer, std::int64_t now_unix_ns);
/// The second half alone; any connection.
Status completeErasures(Connection& connection);
/// Adds the list to the one in the folder of the backups, for a restore on another machine; empty: there is
/// no such folder.
Status writeErasuresBeside(Connection& connection, const std::filesystem::path& backups);

}  // namespace needlelab
