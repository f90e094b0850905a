#include <fcntl.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <filesystem>
#include <memory>
#include <utility>

#include "client/admin/command.h"
#include "client/net/link/credentials.h"
#include "common/base/files/files.h"
#include "common/base/secret.h"
#include "common/base/text/text.h"
#include "common/wire/certificates.h"

namespace needlelab {
namespace {

/// The server shows the key only once, so check that the file is writable before creating the key.
Status checkWritable(const std::filesystem::path& file) {
  std::error_code ignored;
  if (std::filesystem::exists(std::filesystem::symlink_status(file, ignored))) {
    return Error{ErrorCode::kInvalidInput,
                 "--out: " + file.string() + " is there already; a key file is never overwritten"};
  }
  const auto folder = file.parent_path().empty() ? std::filesystem::path(".") : file.parent_path();
  if (::access(folder.c_str(), W_OK | X_OK) != 0) {
    return Error{ErrorCode::kInvalidInput,
                 "--out: " + folder.string() + " is not a folder that can be written to"};
  }
  return {};
}

Result<std::string> makeKey(CommandContext& context, const std::string& name) {
  pb::Request request;
  request.mutable_add_station()->set_name(name);
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  return reply.station_key().key();
}

/// The file of a new key could not be written, so the key is lost. `again`: the command that creates another.
Error keyLost(const Error& error, const std::string& name, const std::string& again) {
  return {error.code, error.message + "; station '" + name +
                          "' was added, but its key is lost: revoke it and " + again + " it again"};
}

Status addStation(CommandContext& context, const std::string& name, const std::string& file) {
  ASSIGN_OR_RETURN(const auto key, makeKey(context, name));
  std::string line = name + ":" + hexDigitsOf(key) + "\n";
  const WipeAtEnd wiped(line);
  if (auto done = writeFileAtomically(file, viewOf(line), 0600); !done) {
    return keyLost(done.error(), name, "add");
  }
  context.output.done("added station '" + name + "'; its key is in " +
                      std::filesystem::absolute(file).string() +
                      ": move it to the station and keep it secret");
  return {};
}

enum class StationState : std::uint8_t { kUnknown, kRevoked, kActive };

Result<StationState> stateOf(CommandContext& context, const std::string& name) {
  StationState state = StationState::kUnknown;
  RETURN_IF_ERROR(eachPage(
      context.backend,
      [](pb::Request& request, const std::string& page) { request.mutable_list_stations()->set_page(page); },
      [&](const pb::Reply& reply) {
        for (const auto& station : reply.stations().stations()) {
          if (station.name() == name)
            state = station.revoked() ? StationState::kRevoked : StationState::kActive;
        }
        return state == StationState::kUnknown ? reply.stations().next_page() : std::string();
      }));
  return state;
}

/// The names that this folder's certificate must cover. If the stations know several servers, one name is
/// enough, because each server has its own certificate.
std::vector<std::string> ownHosts(const TlsFiles& files, const Endpoints& servers) {
  std::vector<std::string> hosts;
  for (const Endpoint& server : servers) hosts.push_back(server.host);
  const auto certificate = readCertificate(files.certificate);
  if (!certificate.ok()) return hosts;
  for (const std::string& host : hosts)
    for (const std::string& known : certificate->hosts)
      if (lowerCase(known) == lowerCase(host)) return {host};
  return hosts;
}

/// Returns the certificate authority for the station to trust: the folder's, created with the server's
/// certificate if missing, or the one with which this program reaches the server.
Result<std::string> authorityFor(const CommandContext& context, const Endpoints& servers) {
  std::filesystem::path file = context.global.ca;
  if (context.backend.local()) {
    const TlsFiles files = tlsFilesIn(std::filesystem::path(context.global.data) / "tls");
    // the certificate must cover the name that the station will connect to
    if (auto made = ensureTlsFiles(files, {ownHosts(files, servers)}); !made) return made.error();
    file = files.ca_certificate;
  }
  return readWholeFile(file, 1u << 20);
}

Status enrolStation(CommandContext& context, const std::string& name, const std::string& server,
                    const std::string& file) {
  Enrolment enrolment;
  enrolment.station = name;
  enrolment.servers = *parseEndpoints(server);
  // do everything that can fail before creating the key, because it is shown only once; a refused name
  // creates no TLS files
  ASSIGN_OR_RETURN(const auto state, stateOf(context, name));
  if (state == StationState::kUnknown) RETURN_IF_ERROR(checkNewName("station name", name));
  if (state == StationState::kActive) {
    // AddStation reports the refusal; it succeeds if someone has just revoked the station
    ASSIGN_OR_RETURN(enrolment.key, makeKey(context, name));
  }
  auto ca_pem = authorityFor(context, enrolment.servers);
  if (!ca_pem) return enrolment.key.empty() ? ca_pem.error() : keyLost(ca_pem.error(), name, "enrol");
  enrolment.ca_pem = *std::move(ca_pem);
  if (enrolment.key.empty()) {
    ASSIGN_OR_RETURN(enrolment.key, makeKey(context, name));
  }
  if (auto done = writeFileAtomically(file, viewOf(bundleText(enrolment)), 0600); !done)
    return keyLost(done.error(), name, "enrol");
  context.output.done("added station '" + name + "'; move " + std::filesystem::absolute(file).string() +
                      " to it, keep it secret, and say there: needlelab-station --enrol " +
                      std::filesystem::path(file).filename().string());
  return {};
}

Status listStations(CommandContext& context) {
  Json rows = Json::array();
  bool has_servers = false;
  const auto add = [&](const pb::StationInfo& station) {
    Json row = {{"name", station.name()},
                {"revoked", station.revoked()},
                {"created_unix_ns", station.created_unix_ns()},
                {"online", nullptr},
                {"trainee", nullptr},
                {"exercise_id", nullptr},
                {"spool_left", nullptr}};
    // a folder has no connection state
    if (!context.backend.local()) {
      row["online"] = station.online();
      if (station.online()) {
        row["trainee"] = station.status().trainee();
        row["exercise_id"] = station.status().exercise_id();
        row["spool_left"] = station.status().spool_left();
        if (const std::string& server = station.status().server(); !server.empty()) {
          row["server"] = server;
          has_servers = true;
        }
      }
    }
    rows.push_back(std::move(row));
  };
  const auto done = eachPage(
      context.backend,
      [](pb::Request& request, const std::string& page) { request.mutable_list_stations()->set_page(page); },
      [&](const pb::Reply& reply) {
        for (const auto& station : reply.stations().stations()) add(station);
        return reply.stations().next_page();
      });
  if (!done) return done;
  std::vector<Column> columns = {
      {"name", "NAME"},       {"revoked", "REVOKED"},      {"online", "ONLINE"},
      {"trainee", "TRAINEE"}, {"exercise_id", "EXERCISE"}, {"created_unix_ns", "SINCE", Column::Kind::kTime}};
  // for a lab with several servers
  if (has_servers) columns.insert(columns.begin() + 3, {"server", "SERVER"});
  return context.output.list(columns, rows, "no stations yet");
}

}  // namespace

void addStationCommands(CLI::App& app, ChosenCommand& chosen) {
  auto* station = app.add_subcommand("station", "the machines on which trainees practise");
  station->require_subcommand(1);
  struct Values {
    std::string name, out, server;
  };
  const auto values = std::make_shared<Values>();

  auto* add = station->add_subcommand("add", "add a station, or give a revoked one a new key");
  add->add_option("name", values->name)->required();
  add->add_option("--out", values->out, "where its key is written (readable by you only)")
      ->required()
      ->type_name("KEYFILE");
  add->callback([&chosen, values] {
    chosen.may_create = true;
    chosen.check = [values]() -> Status {
      RETURN_IF_ERROR(checkName("station name", values->name));
      return checkWritable(values->out);
    };
    chosen.run = [values](CommandContext& context) { return addStation(context, values->name, values->out); };
  });

  auto* enrol = station->add_subcommand(
      "enrol", "add a station, and write all that it needs into one file for needlelab-station --enrol");
  enrol->add_option("name", values->name)->required();
  enrol
      ->add_option("--server-name", values->server,
                   "HOST or HOST:PORT by which the station reaches the server; the certificate must be for "
                   "HOST. Several servers, of which any will do: A:7750,B:7750")
      ->required()
      ->type_name("HOST[:PORT][,…]");
  enrol->add_option("--out", values->out, "the file to write (readable by you only: it holds the key)")
      ->required()
      ->type_name("FILE");
  enrol->callback([&chosen, values] {
    chosen.may_create = true;
    chosen.check = [values]() -> Status {
      RETURN_IF_ERROR(checkName("station name", values->name));
      if (auto valid = parseEndpoints(values->server); !valid)
        return Error{ErrorCode::kInvalidInput, "--server-name " + valid.error().message};
      return checkWritable(values->out);
    };
    chosen.run = [values](CommandContext& context) {
      return enrolStation(context, values->name, values->server, values->out);
    };
  });

  station->add_subcommand("list", "list the stations")->callback([&chosen] { chosen.run = listStations; });

  auto* revoke = station->add_subcommand("revoke", "make a station's key invalid; its sessions stay");
  revoke->add_option("name", values->name)->required();
  runs(revoke, chosen, [values](CommandContext& context) -> Status {
    pb::Request request;
    request.mutable_revoke_station()->set_name(values->name);
    RETURN_IF_ERROR(context.backend.call(request));
    context.output.done("revoked station '" + values->name + "'");
    return {};
  });
}

}  // namespace needlelab
