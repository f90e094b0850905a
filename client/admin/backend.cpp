#include "client/admin/backend.h"

#include <pwd.h>
#include <unistd.h>

#include <chrono>
#include <optional>
#include <set>
#include <utility>

#include "client/net/blocking_client.h"
#include "common/wire/protocol.h"
#include "db/service/bootstrap.h"

namespace needlelab {
namespace {

/// The audit log's name for a person who works directly on the folder.
std::string localName() {
  const passwd* entry = ::getpwuid(::getuid());
  return "local:" + (entry != nullptr && entry->pw_name != nullptr ? std::string(entry->pw_name)
                                                                   : std::to_string(::getuid()));
}

/// What a folder holds; nothing if it does not exist.
struct FolderState {
  bool exists = false;
  std::set<std::filesystem::path> entries;
};

FolderState stateOf(const std::filesystem::path& folder) {
  FolderState state;
  std::error_code error;
  state.exists = std::filesystem::is_directory(folder, error);
  for (const auto& entry : std::filesystem::directory_iterator(folder, error))
    state.entries.insert(entry.path().filename());
  return state;
}

class FolderBackend : public Backend {
 public:
  FolderBackend(std::unique_ptr<Store> store, std::filesystem::path folder, FolderState before)
      : store_(std::move(store)), folder_(std::move(folder)), before_(std::move(before)) {}
  Result<pb::Reply> call(const pb::Request& request) override {
    Outcome outcome = store_->service().execute(who_, request);
    if (outcome.error) return *outcome.error;
    return std::move(outcome.reply);
  }
  [[nodiscard]] bool local() const override { return true; }
  void discardIfNew() override {
    if (before_.entries.contains("needlelab.db")) return;
    // each change has a line in the audit log
    pb::Request request;
    request.mutable_list_audit()->set_limit(1);
    const auto audit = call(request);
    if (!audit.ok() || audit->audit().entries_size() > 0) return;
    // while the lock is still held
    std::error_code error;
    for (const auto& name : stateOf(folder_).entries)
      if (!before_.entries.contains(name)) std::filesystem::remove_all(folder_ / name, error);
    if (!before_.exists) std::filesystem::remove(folder_, error);
  }

 private:
  std::unique_ptr<Store> store_;
  const std::filesystem::path folder_;
  const FolderState before_;
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

Result<std::unique_ptr<Backend>> openFolder(const std::filesystem::path& folder, bool create) {
  FolderState before = stateOf(folder);
  Store::Options options;
  options.holder = "needlelab-admin";
  options.create = create;
  options.writer.window = std::chrono::milliseconds(0);  // no other writer: no need to wait
  auto store = Store::open(folder, options);
  if (!store) {
    // the user named the folder, so a wrong one is wrong input
    const bool missing = store.error().code == ErrorCode::kNotFound;
    return Error{missing ? ErrorCode::kInvalidInput : store.error().code, store.error().message};
  }
  return std::unique_ptr<Backend>(
      std::make_unique<FolderBackend>(std::move(*store), folder, std::move(before)));
}

Result<std::unique_ptr<Backend>> connectServer(const ServerAddress& address) {
  ClientConfig config;
  config.server = address.endpoint;
  config.ca_file = address.ca_file;
  config.program = programText("admin");
  config.login = personLogin(address.user, address.password);
  ASSIGN_OR_RETURN(auto client, BlockingClient::connect(config));
  return std::unique_ptr<Backend>(std::make_unique<ServerBackend>(std::move(client)));
}

}  // namespace needlelab
