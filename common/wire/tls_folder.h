/// What writers of DIR/tls share: a lock that ends with its process, and the temporary files that a killed
/// writer leaves.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/wire/certificates.h"

namespace needlelab {

/// Held while files of the folder are written, so that nobody takes their temporary files for leftovers: a
/// shared lock (flock) on the folder itself, without a file. Without the folder nothing is held. Waits only
/// for removeTlsLeftovers(). Thread: one.
class TlsFolderUse {
 public:
  explicit TlsFolderUse(const TlsFiles& files);
  TlsFolderUse(const TlsFolderUse&) = delete;
  TlsFolderUse& operator=(const TlsFolderUse&) = delete;
  ~TlsFolderUse();

 private:
  int fd_;
};

/// Removes the temporary files that a killed writer left beside `files` (isTemporaryNameOf in
/// common/base/files.h); they may hold a private key. Other names, folders and links stay.
/// Does nothing while somebody writes. Returns what was removed, sorted. Errors: kFailed, the file in the
/// message. Thread: any; also beside other processes.
Result<std::vector<std::string>> removeTlsLeftovers(const TlsFiles& files);

}  // namespace needlelab
