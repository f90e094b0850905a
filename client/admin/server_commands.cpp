// Creates a data folder for another server on an existing server's database.
#include <fmt/core.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/admin/backend.h"
#include "client/admin/command.h"
#include "common/base/files/files.h"
#include "common/base/text/uuid.h"
#include "common/wire/certificates.h"
#include "db/audit/audit_chain.h"
#include "db/audit/audit_head.h"
#include "db/erasure/erasure.h"
#include "db/store/store_address.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

struct Join {
  fs::path folder, from;
  std::string name;                ///< its name among the servers; empty: it is generated
  std::vector<std::string> hosts;  ///< for its certificate; empty: its first start makes one
  bool with_authority = false;     ///< also copies ca.key
};

/// The folder is built here and then renamed. The next command removes what a killed one left.
fs::path growingOf(const fs::path& folder) {
  return folder.string() + ".joining";
}

Error invalid(const fs::path& path, const std::string& text) {
  return {ErrorCode::kInvalidInput, path.string() + ": " + text};
}

bool isThere(const fs::path& path) {
  std::error_code error;
  return fs::exists(path, error);
}

/// Checks that the folder is missing or empty, its parent exists, and it is not below the other server's.
Status checkPlace(const Join& join) {
  std::error_code error;
  const fs::path parent = join.folder.parent_path();
  if (!parent.empty() && !fs::is_directory(parent, error))
    return invalid(join.folder, "the folder above it is not there: make it first");
  if (isThere(join.folder)) {
    if (!fs::is_directory(join.folder, error)) return invalid(join.folder, "is not a folder");
    const bool is_empty = fs::is_empty(join.folder, error);
    if (error) return invalid(join.folder, "cannot be looked into: " + error.message());
    if (!is_empty)
      return invalid(join.folder,
                     "is not empty: a server that joins gets a folder of its own; give a new one");
  }
  const fs::path from = fs::weakly_canonical(join.from, error), to = fs::weakly_canonical(join.folder, error);
  if (std::mismatch(from.begin(), from.end(), to.begin(), to.end()).first == from.end())
    return invalid(join.folder, "lies in the other server's folder: give one beside it");
  return {};
}

/// Checks that the other server's folder has what this one needs.
Result<StoreFile> checkSource(const Join& join) {
  std::error_code error;
  if (!fs::is_directory(join.from, error)) return invalid(join.from, "is not a folder");
  ASSIGN_OR_RETURN(auto store, readStoreFile(join.from));
  if (!store && isThere(join.from / "needlelab.db"))
    return invalid(join.from,
                   "its database is an SQLite file, which one server has for itself: move it to "
                   "PostgreSQL first (needlelab-admin store copy)");
  if (!store) return invalid(join.from, "is not a server's data folder: it has no file store");
  if (!store->kept.empty())
    return invalid(join.from, "its move to PostgreSQL is not done: start its server once, then join");
  for (const char* const key : {kAuditKeyFile, "pseudonym.key"})
    if (!isThere(join.from / key))
      return invalid(join.from / key, "is not there: start that server once with --together, then join");
  const TlsFiles tls = tlsFilesIn(join.from / "tls");
  if (!isThere(tls.ca_certificate))
    return invalid(tls.ca_certificate, "is not there: start that server once, then join");
  if (isThere(tls.next_ca_certificate) || isThere(tls.next_ca_key))
    return invalid(
        tls.next_ca_certificate,
        "a new authority is prepared: end that (needlelab-admin certificate authority), then join");
  if (!isThere(tls.ca_key))
    return invalid(tls.ca_key,
                   "is not there, and the new server's certificate needs it: put it back (chmod "
                   "600) for this command");
  return std::move(*store);
}

Status copyFile(const fs::path& from, const fs::path& to, unsigned mode = 0600) {
  ASSIGN_OR_RETURN(const std::string bytes, readWholeFile(from, 64u << 20));
  return writeFileAtomically(to, viewOf(bytes), mode);
}

/// Writes the new folder's files into `growing`.
Status fill(const Join& join, const StoreFile& store, const fs::path& growing) {
  // keys, and the known state of the audit log
  for (const char* const name : {kAuditKeyFile, "pseudonym.key"})
    RETURN_IF_ERROR(copyFile(join.from / name, growing / name));
  if (isThere(join.from / kAuditHeadFile))
    RETURN_IF_ERROR(copyFile(join.from / kAuditHeadFile, growing / kAuditHeadFile));
  ASSIGN_OR_RETURN(const auto erasures, readErasures(join.from));
  if (!erasures.empty()) RETURN_IF_ERROR(writeErasures(growing, erasures));
  RETURN_IF_ERROR(writeStoreFile(growing, store));
  RETURN_IF_ERROR(writeFileAtomically(growing / kServerFile, viewOf(serverFileText(join.name))));

  const TlsFiles there = tlsFilesIn(join.from / "tls"), here = tlsFilesIn(growing / "tls");
  ASSIGN_OR_RETURN(const bool made, makePrivateFolder(growing / "tls"));
  static_cast<void>(made);
  constexpr unsigned kForAll = 0644;
  RETURN_IF_ERROR(copyFile(there.ca_certificate, here.ca_certificate, kForAll));
  RETURN_IF_ERROR(copyFile(there.ca_key, here.ca_key));
  if (!join.hosts.empty()) {
    // as each server's start requires it (certificateNames)
    ASSIGN_OR_RETURN(const bool signed_now,
                     ensureTlsFiles(here, {.hosts = join.hosts, .own = {"localhost", "127.0.0.1", "::1"}}));
    if (!signed_now)
      return Error{ErrorCode::kFailed,
                   "no certificate can be made now: " + clockFault(here) + ". Set this machine's clock"};
  }
  if (join.with_authority) return {};
  std::error_code error;
  fs::remove(here.ca_key, error);
  return error ? Status(systemError(here.ca_key, "remove")) : Status();
}

Status joinServer(Join join, Output& output) {
  // DIR/ means DIR
  for (fs::path* const path : {&join.folder, &join.from})
    if (!path->has_filename()) *path = path->parent_path();
  RETURN_IF_ERROR(checkFolderUser(join.from, ::geteuid()));
  RETURN_IF_ERROR(checkPlace(join));
  ASSIGN_OR_RETURN(const StoreFile store, checkSource(join));
  ASSIGN_OR_RETURN(const std::string other, serverNameOf(join.from));
  if (join.name.empty()) join.name = "server-" + uuidText(makeUuidV7()).substr(24);
  if (join.name == kFirstServer || join.name == other)
    return Error{ErrorCode::kInvalidInput,
                 "--name: '" + join.name + "' is another server's name: each has one of its own"};

  const fs::path growing = growingOf(join.folder);
  std::error_code error;
  fs::remove_all(growing, error);
  ASSIGN_OR_RETURN(const bool made, makePrivateFolder(growing));
  if (!made) return invalid(growing, "stands in the way: remove it");
  Status filled = fill(join, store, growing);
  // check the name with the function that the server's start uses
  if (filled.ok()) {
    const auto name = serverNameOf(growing);
    if (!name) filled = Error{ErrorCode::kInvalidInput, "--name: letters, digits and '-', at most 64"};
  }
  if (filled.ok()) filled = syncFolder(growing);
  // rename replaces an empty folder
  if (filled.ok() && ::rename(growing.c_str(), join.folder.c_str()) != 0)
    filled = systemError(join.folder, "put the new folder into its place");
  if (!filled.ok()) {
    fs::remove_all(growing, error);
    return filled;
  }
  RETURN_IF_ERROR(syncFolder(join.folder.parent_path()));
  output.done(fmt::format(
      "{} is the data folder of the server '{}' on the database of {}. Bring it to that server's machine, "
      "for its "
      "user only, and start it there: needlelab-server --data DIR --together; the servers that run must have "
      "--together, too",
      join.folder.string(), join.name, join.from.string()));
  if (join.with_authority)
    output.text(
        "It has the authority's key, tls/ca.key: move it to a medium in a safe once the server has its "
        "certificate (needlelab-admin certificate move-key).");
  return {};
}

}  // namespace

void addServerCommands(CLI::App& app, ChosenCommand& chosen) {
  auto* server = app.add_subcommand("server", "several servers on one database");
  server->require_subcommand(1);
  const auto join = std::make_shared<Join>();
  auto* command = server->add_subcommand(
      "join",
      "makes --data DIR, a new folder, for a further server on the database of another one on PostgreSQL: "
      "the "
      "lab's keys, a certificate, where the database is, who was erased. The other server may run");
  command->add_option("--from", join->from, "the data folder of a server of the lab")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--name", join->name,
                   "by which logs tell the server from others: letters, digits, '-'; without it one is made")
      ->type_name("NAME");
  command
      ->add_option(
          "--host-name", join->hosts,
          "a name or address at which stations and browsers reach the new server: its certificate is "
          "made here; may be repeated")
      ->type_name("HOST");
  command->add_flag("--with-authority", join->with_authority,
                    "takes the authority's key along, with which anyone can impersonate the servers: the new "
                    "server makes its certificates itself");
  command->callback([&chosen, join] {
    chosen.check = [join]() -> Status {
      if (!join->hosts.empty() || join->with_authority) return {};
      return Error{
          ErrorCode::kInvalidInput,
          "server join: give each --host-name at which the new server is reached, for its certificate; "
          "or --with-authority"};
    };
    chosen.run_on_files = [join](const fs::path& folder, Output& output) {
      join->folder = folder;
      return joinServer(*join, output);
    };
  });
}

}  // namespace needlelab
