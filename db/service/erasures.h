/// Erasures that a start makes up for (repeated_erasures.cpp), and what they share with the request to erase
/// (erasures.cpp). Private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"
#include "db/db_writer.h"
#include "db/erasure.h"
#include "db/erasure_list.h"
#include "db/service/files_of_erased.h"
#include "db/service/retention.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// The person is erased. What is left to do, in this order, each in steps: the chunks go; the log is emptied;
/// the files are looked at for the reply.
struct ErasureUnderWay {
  pb::Reply reply;
  ErasedRows erased;
  std::filesystem::path folder, backups;  ///< of the database; of its backups
  bool is_reported = false;               ///< the reply says where the name is left
  LeftoversSoFar chunks;
  std::string text_on_chunks;        ///< about those that stay; empty: none do
  std::optional<LookAtFiles> files;  ///< nothing: the log is not emptied yet
};

/// kNoRoom unless the disk has room for what the erasure's transaction writes to the person's sessions. For
/// what others wrote of the person ErasureStore asks as it goes on.
Status checkRoomToErase(Connection& connection, const std::string& name);

/// The writer gave `why` for the transaction that ends the erasure `line`. Where only the answer to its
/// COMMIT was lost, the person is erased all the same: asks the table of erasures in a new transaction.
/// Returns what the reply says then. Errors, `why` in each: the person is not erased, and DIR/erasures is as
/// `before`; or nobody can tell, and the line stays there, so that a start compares. Not from the writer's
/// thread.
Result<std::string> settleErasure(DbWriter& writer, const std::filesystem::path& folder,
                                  const ErasureLine& line, const std::vector<ErasureLine>& before,
                                  const Error& why);

/// ErasureStore::completeList. False: an erasure is under way in this program, and nothing was done. Any
/// connection.
Result<bool> completeErasures(Connection& connection);

/// Before anybody is served: repeats the erasures of DIR/erasures that this database, a restored backup, does
/// not know. Returns how many were repeated.
/// Errors: the database's; kNoRoom; kFailed when something is thrown, for want of memory: nothing is
/// half-written. Writer's connection, outside a transaction. `free_room`: for tests.
Result<std::size_t> eraseBeforeServing(Connection& writer, std::int64_t now_unix_ns,
                                       const ErasureStore::FreeRoom& free_room = {});

}  // namespace needlelab
