/// Executes requests on a running server, or directly on a stopped server's folder.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/wire/endpoint.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// Thread: one.
class Backend {
 public:
  Backend() = default;
  Backend(const Backend&) = delete;
  Backend& operator=(const Backend&) = delete;
  virtual ~Backend() = default;
  /// Blocks until the reply arrives (changes: until they are committed).
  virtual Result<pb::Reply> call(const pb::Request& request) = 0;
  /// Whether paths in requests are paths on this machine.
  [[nodiscard]] virtual bool local() const = 0;
  /// After a failed command: removes the data folder that it created, if nothing was stored there.
  virtual void discardIfNew() {}
};

/// kInvalidInput if `user` is root and the folder's database (without one, the folder) belongs to another
/// user: files created by root would have mode 0600, and the server could not read them. The message has the
/// correct command. A missing folder is fine.
Status checkFolderUser(const std::filesystem::path& folder, uid_t user);

/// The audit log's name for a person who works directly on the folder: "local:" and the system's user name.
std::string localName();

/// Opens DIR of a stopped server, as administrator. `create`: creates a missing folder. `backup_key`: the
/// file with the key that encrypts its backups; empty: no encryption. `store_url`: as in Store::Options.
/// Errors: as Store::open; kUnavailable if a server is running there.
Result<std::unique_ptr<Backend>> openFolder(const std::filesystem::path& folder, bool create,
                                            const std::filesystem::path& backup_key = {},
                                            const std::string& store_url = {});

struct ServerAddress {
  Endpoints servers;  ///< at least one
  std::filesystem::path ca_file;
  std::string user;
  std::string password;
};
/// Connects and logs in at the first server that answers. Errors: as connectClient.
Result<std::unique_ptr<Backend>> connectServer(const ServerAddress& address);

}  // namespace needlelab
