#include "db/store/store_address.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <iterator>
#include <sstream>
#include <utility>

#include "common/base/files/files.h"
#include "common/base/planted_bug.h"
#include "common/base/text/uuid.h"
#include "db/engine/open_postgres.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxStoreFileBytes = 16'384;
constexpr std::string_view kServerLine = "name = ";
constexpr std::size_t kMaxServerName = 64;
/// A server that is stopped within a transaction blocks the others for this long.
constexpr std::chrono::milliseconds kMaxIdleTogether{3000};
/// After a network cut, stations wait for their server no longer than for another one to take over.
constexpr std::chrono::milliseconds kTcpPatienceTogether{4000};
/// A person gives up if a log-in takes longer.
constexpr std::chrono::milliseconds kSideConnectTimeout{3'000}, kSideAnswerTimeout{5'000};

bool isOfVersionOrRights(const Error& error) {
  return error.code == ErrorCode::kDenied || error.code == ErrorCode::kVersion;
}

PostgresOptions optionsOf(const StoreAddress& address) {
  PostgresOptions options{
      .url = address.url, .server = address.server, .before_statement = address.before_statement};
  if (!address.server.empty()) options.tcp_patience = kTcpPatienceTogether;
  return options;
}

}  // namespace

Error wrongStore(Error error) {
  if (isOfVersionOrRights(error)) error.code = ErrorCode::kInvalidInput;
  return error;
}

Error storeAway(Error error) {
  if (isOfVersionOrRights(error) || error.code == ErrorCode::kInvalidInput)
    error.code = ErrorCode::kUnavailable;
  return error;
}

Result<Connection> openAt(const StoreAddress& address, Connection::Mode mode, bool create) {
  if (!address.isPostgres()) return Connection::open(address.path, {.mode = mode, .create = create});
  PostgresOptions options = optionsOf(address);
  options.read_only = mode != Connection::Mode::kWriter;
  options.lab = address.lab;
  options.local_commits = address.is_side_connection;
  if (address.is_side_connection) {
    options.connect_timeout = kSideConnectTimeout;
    options.answer_timeout = kSideAnswerTimeout;
    options.max_idle = kMaxIdleTogether;
  }
  ASSIGN_OR_RETURN(auto engine, openPostgres(options));
  return Connection(std::move(engine), address.path);
}

Result<Connection> openFromOutside(const std::filesystem::path& path, const std::string& url,
                                   const std::function<Status()>& before) {
  RETURN_IF_ERROR(checkAddressFromOutside(url));
  RETURN_IF_ERROR(before());
  return openAt(StoreAddress(path, url), Connection::Mode::kReader);
}

Result<Connection> openToServe(const StoreAddress& address, Durability least) {
  const auto open = [&]() -> Result<Connection> {
    if (!address.isPostgres())
      return Connection::open(address.path, {.mode = Connection::Mode::kWriter, .create = true});
    PostgresOptions options = optionsOf(address);
    options.least = least;
    options.others = PostgresOptions::Others::kNone;
    if (!address.server.empty()) {
      options.others = PostgresOptions::Others::kShared;
      options.only_one_named = address.server;
      options.max_idle = kMaxIdleTogether;
    }
    ASSIGN_OR_RETURN(auto engine, openPostgres(options));
    return Connection(std::move(engine), address.path);
  };
  ASSIGN_OR_RETURN(auto opened, open());
  if (opened.durability() >= least) return opened;
  return Error{
      ErrorCode::kInvalidInput,
      fmt::format("--durability: an ack must survive {}, and would survive {} ({})", durabilityText(least),
                  durabilityText(opened.durability()), opened.durabilityReason())};
}

Result<std::optional<StoreFile>> readStoreFile(const std::filesystem::path& folder, const char* name) {
  const auto path = folder / name;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return std::optional<StoreFile>();
  ASSIGN_OR_RETURN(const std::string text, readWholeFile(path, kMaxStoreFileBytes));
  StoreFile file;
  std::size_t number = 0;
  const auto wrong = [&](const char* what) {
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}, line {}: {}; write the two lines url = postgresql://USER@HOST/DATABASE and "
                             "lab = ID, or remove the file and start with --store",
                             path.string(), number, what)};
  };
  const std::pair<std::string_view, std::string*> values[] = {
      {"url = ", &file.url}, {"lab = ", &file.lab}, {"kept = ", &file.kept}};
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (line.empty() || line.starts_with('#')) continue;
    const auto* const value = std::find_if(std::begin(values), std::end(values), [&](const auto& one) {
      return line.starts_with(one.first) && one.second->empty();
    });
    if (value == std::end(values)) return wrong("is not understood");
    *value->second = line.substr(value->first.size());
  }
  if (file.url.empty()) return wrong("url is missing");
  if (file.lab.empty()) return wrong("lab is missing");
  return std::optional(std::move(file));
}

Status writeStoreFile(const std::filesystem::path& folder, const StoreFile& file) {
  const std::string text = fmt::format(
      "# The database of this folder is not in it. needlelab-server --store wrote this.\n"
      "url = {}\nlab = {}\n{}",
      file.url, file.lab, file.kept.empty() ? "" : "kept = " + file.kept + "\n");
  return replaceFileAtomically(folder / kStoreFile, viewOf(text));
}

Result<std::string> serverNameOf(const std::filesystem::path& folder) {
  const auto path = folder / kServerFile;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return std::string(kFirstServer);
  ASSIGN_OR_RETURN(const std::string text, readWholeFile(path, kMaxStoreFileBytes));
  std::string name;
  if (text.starts_with(kServerLine) && text.ends_with('\n'))
    name = text.substr(kServerLine.size(), text.size() - kServerLine.size() - 1);
  constexpr std::string_view kLetters = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz-";
  const bool is_name =
      !name.empty() && name.size() <= kMaxServerName && name.find_first_not_of(kLetters) == std::string::npos;
  if (is_name) return name;
  return Error{
      ErrorCode::kInvalidInput,
      fmt::format("{}: is not as needlelab-admin server join writes it (the line \"{}NAME\"): put the "
                  "right one back",
                  path.string(), kServerLine)};
}

std::string serverFileText(const std::string& name) {
  return fmt::format("{}{}\n", kServerLine, name);
}

Result<StoreAddress> addressOf(const std::filesystem::path& folder, const std::string& url) {
  const auto path = folder / "needlelab.db";
  ASSIGN_OR_RETURN(const auto file, readStoreFile(folder));
  const std::string& chosen = !url.empty() ? url : file ? file->url : url;
  if (chosen.empty()) return StoreAddress(path);
  if (chosen.find('\n') != std::string::npos)
    return Error{ErrorCode::kInvalidInput, "--store: has a line's end in it"};
  std::error_code error;
  if (std::filesystem::exists(path, error))
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}: this folder has a database of its own: start without --store{}, or give "
                             "--data another folder",
                             path.string(), file ? ", and without the file store beside it" : "")};
  return StoreAddress(path, chosen);
}

Result<std::string> claimStore(Connection& connection, const StoreAddress& address) {
  const auto folder = address.path.parent_path();
  ASSIGN_OR_RETURN(const auto file, readStoreFile(folder));
  std::string lab;
  {
    ASSIGN_OR_RETURN(auto transaction, Transaction::begin(connection, Transaction::Kind::kWrite));
    MetaStore meta(connection);
    ASSIGN_OR_RETURN(const auto found, meta.get(kLabKey));
    ASSIGN_OR_RETURN(const auto created, meta.get("created_unix_ns"));
    lab = found.value_or("");
    if (!lab.empty() && !file && created)
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("--store: this database is in use by a lab whose keys are in another folder: "
                               "start with that folder as --data. If it is lost, write into {} the lines "
                               "\"url = {}\" and \"lab = {}\"",
                               (folder / kStoreFile).string(), address.url, lab)};
    if (file && file->lab != lab)
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("--store: {} belongs to the lab {}, and this database {}{}: check the address",
                               folder.string(), file->lab, lab.empty() ? "is new" : "to the lab ", lab)};
    if (lab.empty()) {
      lab = uuidText(makeUuidV7());
      RETURN_IF_ERROR(meta.set(kLabKey, lab));
    }
    RETURN_IF_ERROR(transaction.commit());
  }
  if (!file || file->url != address.url) RETURN_IF_ERROR(writeStoreFile(folder, {address.url, lab}));
  return lab;
}

ReaderPool::Lease::~Lease() {
  // not after a disk error, nor if its server lacks memory, which closing the connection frees
  if (connection_ == nullptr || !connection_->isReusable()) return;
  const std::lock_guard lock(pool_->mutex_);
  if (pool_->idle_.size() < pool_->max_idle_) pool_->idle_.push_back(std::move(connection_));
}

Result<ReaderPool::Lease> ReaderPool::borrow() {
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      auto connection = std::move(idle_.back());
      idle_.pop_back();
      connection->noteShortRead();
      if (planted(PlantedBug::kSecondCheckpointer)) (void)connection->checkpointPassive();
      return Lease(*this, std::move(connection));
    }
  }
  auto connected = openAt(address_, mode_);
  if (!connected) return address_.isPostgres() ? storeAway(connected.error()) : connected.error();
  Connection opened = std::move(connected).value();
  if (planted(PlantedBug::kSecondCheckpointer)) (void)opened.checkpointPassive();
  return Lease(*this, std::make_unique<Connection>(std::move(opened)));
}

}  // namespace needlelab
