/// The base of the subcommands. Each *_commands.cpp adds its own to the command line.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <string>

#include "client/admin/backend.h"
#include "client/admin/output.h"
#include "common/base/files/files.h"
#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "common/export/export_formats.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace needlelab {

/// Options before or after the subcommand.
struct GlobalOptions {
  std::string data;    ///< --data DIR
  std::string store;   ///< --store URL, for a new folder
  std::string server;  ///< --server HOST:PORT
  std::string ca;
  std::string user;
  std::string password_file;  ///< --password-file before the subcommand: the log-in password
};

struct CommandContext {
  Backend& backend;
  Output& output;
  const GlobalOptions& global;
};

/// The chosen command.
struct ChosenCommand {
  std::function<Status()> check;  ///< optional: checks the arguments without a database
  std::function<Status(CommandContext&)> run;
  /// Replaces `run` for commands that only need the files of --data, without opening the database.
  std::function<Status(const std::filesystem::path& folder, Output&)> run_on_files;
  /// Likewise for commands that need only the files they name.
  std::function<Status(Output&)> run_without_folder;
  NamedFile new_file;                  ///< the file that --out writes; empty: standard output
  bool replace = false;                ///< --replace: `new_file` may already exist
  bool may_create = false;             ///< with --data: creates a missing folder
  std::filesystem::path encrypt_with;  ///< for `backup` with --data: the key's file; empty: no encryption
  std::string new_password_file;       ///< for `user add` and `user passwd`
};

/// Sets the function of `command`.
void runs(CLI::App* command, ChosenCommand& chosen, std::function<Status(CommandContext&)> run);

/// Adds --out FILE and --replace to `command`. `file` must live as long as `chosen`.
CLI::Option* addNewFile(CLI::App* command, ChosenCommand& chosen, std::string& file,
                        const std::string& help = "default: standard output");

/// Adds --format to `command`: one of the formats of `place`. Without it, `name` stays empty (formatFor).
CLI::Option* addFormat(CLI::App* command, std::string& name, ExportPlace place, const std::string& help);

void addUserCommands(CLI::App& app, const GlobalOptions& global, ChosenCommand& chosen);
void addStationCommands(CLI::App& app, ChosenCommand& chosen);
void addStoreCommands(CLI::App& app, const GlobalOptions& global, ChosenCommand& chosen);
void addProfileCommands(CLI::App& app, ChosenCommand& chosen);
void addCurriculumCommands(CLI::App& app, ChosenCommand& chosen);
void addSessionCommands(CLI::App& app, ChosenCommand& chosen);
void addCertificateCommands(CLI::App& app, ChosenCommand& chosen);
void addUpkeepCommands(CLI::App& app, const GlobalOptions& global, ChosenCommand& chosen);
void addAuditCommands(CLI::App& app, ChosenCommand& chosen);
void addRetentionCommands(CLI::App& app, ChosenCommand& chosen);
void addTeachingCommands(CLI::App& app, ChosenCommand& chosen);
void addScoreCommands(CLI::App& app, ChosenCommand& chosen);
void addPersonCommands(CLI::App& app, ChosenCommand& chosen);
void addServerCommands(CLI::App& app, ChosenCommand& chosen);

/// Requests a list page by page (control.proto): `ask` sets a page's name in the request; `take` stores a
/// reply's rows and returns the next page's name, or an empty one to stop.
Status eachPage(Backend& backend, const std::function<void(pb::Request&, const std::string&)>& ask,
                const std::function<std::string(const pb::Reply&)>& take);

/// A score with its comparison; `version` of the definitions, 0: the newest.
Status showSessionScore(CommandContext& context, const Uuid& id, std::uint32_t version);

/// A session from the command line: its id, the beginning of it (at least 4 characters) that no other
/// session's id has, or `newest`. Errors: kInvalidInput, with the sessions that are meant if there are
/// several; kNotFound.
Result<Uuid> sessionIdOf(CommandContext& context, const std::string& text);

/// A score's measures as a table, each value in its unit for people.
std::string measureTable(const Json& measures);

/// Writes the text to a file, atomically, or to `output` when `file` is empty.
Status writeText(Output& output, const std::string& file, const std::string& text);

/// A time with its zone: "2026-12-01T18:00Z", "2026-12-01T18:00:30+01:00" as ns since 1970 (UTC). Refuses a
/// text without a zone, because it would be ambiguous. Errors: kInvalidInput.
Result<std::int64_t> momentOf(const std::string& field, const std::string& text);

// Passwords and codes come from a file (client/net/link/credentials.h) or the terminal, never from an
// argument: all users of the machine can see those.

/// Asks on the terminal without echo. Errors: kInvalidInput without a terminal; the message suggests
/// `option`.
Result<std::string> askPassword(const std::string& prompt, const std::string& option);

/// Asks twice for a new secret; `what`: "password" or "code".
Result<std::string> promptNewSecret(const std::string& what, const std::string& name,
                                    const std::string& option);

// --- the admin program as a function, for tests

/// Returns 0 (done), 1 (failed or refused) or 2 (wrong usage or input). Results go to `out`, everything else
/// to `err`.
int runAdmin(int argc, const char* const* argv, std::ostream& out, std::ostream& err);

}  // namespace needlelab
