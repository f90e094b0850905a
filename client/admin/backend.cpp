#include "client/admin/backend.h"

#include <fcntl.h>
#include <pwd.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "client/net/link/blocking_client.h"
#include "common/wire/certificates.h"
#include "common/wire/protocol.h"
#include "db/audit/audit_head.h"
#include "db/service/start/bootstrap.h"
#include "db/sessions/acknowledged.h"
#include "db/store/store_address.h"

namespace needlelab {
namespace {

/// Remembers what is missing from a data folder before a command that may create it, and how to remove that
/// again. Foreign names and what existed before always stay.
class NewFolder {
 public:
  explicit NewFolder(const std::filesystem::path& given) {
    // DIR/ means DIR
    const auto folder = given.has_filename() ? given : given.parent_path();
    std::error_code error;
    for (auto part = folder; !part.empty() && !std::filesystem::exists(part, error);
         part = part.parent_path())
      folders_.push_back(part);
    for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
      // a database, part of one, or a restore that Store::open completes
      const std::string name = entry.path().filename();
      has_data_ |= name.starts_with("needlelab.db") || name == "restore.pending" || name == kStoreFile;
    }
    database_ = folder / "needlelab.db";
    lock_ = folder / "lock";
    const TlsFiles tls = tlsFilesIn(folder / "tls");
    for (const auto& file : {database_, std::filesystem::path(database_.string() + "-wal"),
                             std::filesystem::path(database_.string() + "-shm"),
                             std::filesystem::path(database_.string() + "-journal"), tls.ca_certificate,
                             tls.ca_key, tls.certificate, tls.key, folder / "tls", folder / kAuditKeyFile,
                             folder / kAuditHeadFile, folder / kStoreFile, folder / kAcknowledgedFile, lock_})
      if (!std::filesystem::exists(file, error)) files_.push_back(file);
  }
  [[nodiscard]] bool hasData() const { return has_data_; }
  /// Call only while the lock is held and nothing was stored.
  void remove() const {
    if (has_data_) return;
    // a folder is removed only if it is empty
    std::error_code error;
    for (const auto& file : files_) std::filesystem::remove(file, error);
    for (const auto& part : folders_) std::filesystem::remove(part, error);
  }
  /// For a failed Store::open; another program may be using the folder now.
  void removeUnopened() const {
    std::error_code error;
    const int fd = ::open(lock_.c_str(), O_RDWR | O_CLOEXEC);
    // less than a page is not a database; with a page, the next command completes it
    const bool is_free =
        fd < 0 ? errno == ENOENT || errno == ENAMETOOLONG : ::flock(fd, LOCK_EX | LOCK_NB) == 0;
    const auto bytes = std::filesystem::file_size(database_, error);
    if (is_free && (error || bytes < 512)) remove();
    if (fd >= 0) ::close(fd);
  }

 private:
  bool has_data_ = false;
  std::filesystem::path database_, lock_;
  std::vector<std::filesystem::path> files_, folders_;  // the missing ones; folders: the deepest first
};

class FolderBackend : public Backend {
 public:
  FolderBackend(std::unique_ptr<Store> store, NewFolder made)
      : store_(std::move(store)), made_(std::move(made)) {}
  Result<pb::Reply> call(const pb::Request& request) override {
    Outcome outcome = store_->service().execute(who_, request);
    if (outcome.error) return *outcome.error;
    return std::move(outcome.reply);
  }
  [[nodiscard]] bool local() const override { return true; }
  void discardIfNew() override {
    if (made_.hasData()) return;
    // every change has a line in the audit log
    pb::Request request;
    request.mutable_list_audit()->set_limit(1);
    const auto audit = call(request);
    if (!audit.ok() || audit->audit().entries_size() > 0) return;
    made_.remove();
  }

 private:
  std::unique_ptr<Store> store_;
  const NewFolder made_;
  const Principal who_{localName(), pb::ADMINISTRATOR};
};

class ServerBackend : public Backend {
 public:
  explicit ServerBackend(BlockingClient client) : client_(std::move(client)) {}
  Result<pb::Reply> call(const pb::Request& request) override {
    // these requests may read the whole database
    const bool slow = request.has_backup() || request.has_check() || request.has_run_retention() ||
                      request.has_rescore_all();
    return client_.call(request, slow ? std::chrono::hours(12) : std::chrono::minutes(5));
  }
  [[nodiscard]] bool local() const override { return false; }

 private:
  BlockingClient client_;
};

}  // namespace

std::string localName() {
  const passwd* entry = ::getpwuid(::getuid());
  return "local:" + (entry != nullptr && entry->pw_name != nullptr ? std::string(entry->pw_name)
                                                                   : std::to_string(::getuid()));
}

Status checkFolderUser(const std::filesystem::path& folder, uid_t user) {
  constexpr uid_t kRoot = 0;
  struct stat info {};
  if (user != kRoot ||
      (::stat((folder / "needlelab.db").c_str(), &info) != 0 && ::stat(folder.c_str(), &info) != 0) ||
      info.st_uid == kRoot)
    return {};
  const passwd* entry = ::getpwuid(info.st_uid);
  const std::string owner = entry != nullptr && entry->pw_name != nullptr
                                ? std::string(entry->pw_name)
                                : "'#" + std::to_string(info.st_uid) + "'";
  return Error{ErrorCode::kInvalidInput,
               "--data " + folder.string() + ": belongs to " + owner +
                   ", who could not read what root leaves there, so that the server would not start: run "
                   "this as sudo -u " +
                   owner + " needlelab-admin …"};
}

Result<std::unique_ptr<Backend>> openFolder(const std::filesystem::path& folder, bool create,
                                            const std::filesystem::path& backup_key,
                                            const std::string& store_url) {
  const NewFolder made(folder);
  // also if an exception leaves this function
  const auto clean = [](const NewFolder* of) { of->removeUnopened(); };
  std::unique_ptr<const NewFolder, decltype(clean)> guard(create ? &made : nullptr, clean);
  Store::Options options;
  options.holder = "needlelab-admin";
  options.create = create;
  options.backup_key = backup_key;
  options.store_url = store_url;
  options.writer.window = std::chrono::milliseconds(0);  // no other writer: no need to wait
  auto store = Store::open(folder, options);
  if (!store) {
    // the user named the folder, so a wrong one is wrong input
    const bool missing = store.error().code == ErrorCode::kNotFound;
    return Error{missing ? ErrorCode::kInvalidInput : store.error().code, store.error().message};
  }
  static_cast<void>(guard.release());
  return std::unique_ptr<Backend>(std::make_unique<FolderBackend>(std::move(*store), made));
}

Result<std::unique_ptr<Backend>> connectServer(const ServerAddress& address) {
  ClientConfig config;
  config.setServers(address.servers);
  config.ca_file = address.ca_file;
  config.program = programText("admin");
  config.login = personLogin(address.user, address.password);
  config.connect_timeout = kConnectOnceTimeout;
  ASSIGN_OR_RETURN(auto client, BlockingClient::connect(config));
  return std::unique_ptr<Backend>(std::make_unique<ServerBackend>(std::move(client)));
}

}  // namespace needlelab
