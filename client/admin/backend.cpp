#include "client/admin/backend.h"

#include <pwd.h>
#include <unistd.h>

#include <chrono>
#include <optional>

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

class FolderBackend : public Backend {
 public:
  explicit FolderBackend(std::unique_ptr<Store> store) : store_(std::move(store)) {}
  Result<pb::Reply> call(const pb::Request& request) override {
    Outcome outcome = store_->service().execute(who_, request);
    if (outcome.error) return *outcome.error;
    return std::move(outcome.reply);
  }
  [[nodiscard]] bool local() const override { return true; }

 private:
  std::unique_ptr<Store> store_;
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
  return std::unique_ptr<Backend>(std::make_unique<FolderBackend>(std::move(*store)));
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
