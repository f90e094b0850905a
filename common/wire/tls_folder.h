/// The files of DIR/tls, and helpers for their writers: a lock that ends with its process, and removal of
/// temporary files left by killed writers.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// The files of `DIR/tls`. Keys have mode 0600.
struct TlsFiles {
  std::filesystem::path ca_certificate;  ///< ca.crt: give this to stations and instructors
  std::filesystem::path ca_key;          ///< ca.key
  std::filesystem::path certificate;     ///< server.crt
  std::filesystem::path key;             ///< server.key
  /// ca-next.crt, ca-next.key: the new authority's, between prepareAuthority and switchAuthority
  std::filesystem::path next_ca_certificate, next_ca_key;
};

TlsFiles tlsFilesIn(const std::filesystem::path& folder);

/// Hold this while writing files of the folder, so that their temporary files are not mistaken for leftovers:
/// a shared lock (flock) on the folder itself, without a lock file. Holds nothing if the folder does not
/// exist. Waits only for removeTlsLeftovers(). Thread: one.
class TlsFolderUse {
 public:
  explicit TlsFolderUse(const TlsFiles& files);
  TlsFolderUse(const TlsFolderUse&) = delete;
  TlsFolderUse& operator=(const TlsFolderUse&) = delete;
  ~TlsFolderUse();

 private:
  int fd_;
};

/// Removes temporary files left beside `files` by a killed writer (isTemporaryNameOf in
/// common/base/files/files.h); they may hold a private key. Other names, folders and links stay.
/// Does nothing while another writer is active. Returns what was removed, sorted. Errors: kFailed, with the
/// file in the message. Thread: any; safe alongside other processes.
Result<std::vector<std::string>> removeTlsLeftovers(const TlsFiles& files);

}  // namespace needlelab
