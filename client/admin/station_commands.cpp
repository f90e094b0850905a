#include <fcntl.h>
#include <unistd.h>

#include <filesystem>
#include <memory>

#include "admin/command.h"
#include "base/atomic_file.h"
#include "base/text_rules.h"

namespace needlelab {
namespace {

std::string hexText(const std::string& bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const char c : bytes) {
    text += kDigits[static_cast<unsigned char>(c) >> 4];
    text += kDigits[static_cast<unsigned char>(c) & 15];
  }
  return text;
}

/// The key is shown once only: find out before it is made whether it can be written down.
Status checkWritable(const std::filesystem::path& file) {
  std::error_code ignored;
  if (std::filesystem::exists(std::filesystem::symlink_status(file, ignored))) {
    return Error{ErrorCode::kInvalidInput,
                 "--out: " + file.string() + " is there already; a key file is never overwritten"};
  }
  const auto folder = file.parent_path().empty() ? std::filesystem::path(".") : file.parent_path();
  if (::access(folder.c_str(), W_OK | X_OK) != 0) {
    return Error{ErrorCode::kInvalidInput,
                 "--out: " + folder.string() + " is no folder that can be written to"};
  }
  return {};
}

Status addStation(CommandContext& context, const std::string& name, const std::string& file) {
  pb::Request request;
  request.mutable_add_station()->set_name(name);
  const auto reply = context.backend.call(request);
  if (!reply) return reply.error();
  const std::string line = name + ":" + hexText(reply->station_key().key()) + "\n";
  if (auto done = writeFileAtomically(file, viewOf(line), 0600); !done) {
    return Error{done.error().code, done.error().message + "; station '" + name +
                                        "' was added, but its key is lost: revoke it and add it again"};
  }
  context.output.done("added station '" + name + "'; its key is in " +
                      std::filesystem::absolute(file).string() +
                      ": move it to the station and keep it secret");
  return {};
}

Status listStations(CommandContext& context) {
  pb::Request request;
  request.mutable_list_stations();
  const auto reply = context.backend.call(request);
  if (!reply) return reply.error();
  Json rows = Json::array();
  for (const auto& station : reply->stations().stations()) {
    Json row = {{"name", station.name()},
                {"revoked", station.revoked()},
                {"created_unix_ns", station.created_unix_ns()},
                {"online", nullptr},
                {"trainee", nullptr},
                {"exercise_id", nullptr},
                {"spool_left", nullptr}};
    // a folder does not know who is connected
    if (!context.backend.local()) {
      row["online"] = station.online();
      if (station.online()) {
        row["trainee"] = station.status().trainee();
        row["exercise_id"] = station.status().exercise_id();
        row["spool_left"] = station.status().spool_left();
      }
    }
    rows.push_back(std::move(row));
  }
  return context.output.list({{"name", "NAME"},
                              {"revoked", "REVOKED"},
                              {"online", "ONLINE"},
                              {"trainee", "TRAINEE"},
                              {"exercise_id", "EXERCISE"},
                              {"created_unix_ns", "SINCE", Column::Kind::kTime}},
                             rows, "no stations yet");
}

}  // namespace

void addStationCommands(CLI::App& app, ChosenCommand& chosen) {
  auto* station = app.add_subcommand("station", "the machines on which trainees practise");
  station->require_subcommand(1);
  struct Values {
    std::string name, out;
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
      if (auto valid = checkName("station name", values->name); !valid) return valid;
      return checkWritable(values->out);
    };
    chosen.run = [values](CommandContext& context) { return addStation(context, values->name, values->out); };
  });

  station->add_subcommand("list", "all stations")->callback([&chosen] { chosen.run = listStations; });

  auto* revoke = station->add_subcommand("revoke", "its key opens nothing any more; its sessions stay");
  revoke->add_option("name", values->name)->required();
  revoke->callback([&chosen, values] {
    chosen.run = [values](CommandContext& context) -> Status {
      pb::Request request;
      request.mutable_revoke_station()->set_name(values->name);
      if (const auto reply = context.backend.call(request); !reply) return reply.error();
      context.output.done("revoked station '" + values->name + "'");
      return {};
    };
  });
}

}  // namespace needlelab
