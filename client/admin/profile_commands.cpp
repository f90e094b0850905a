#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <memory>
#include <string>
#include <vector>

#include "client/admin/command.h"
#include "common/base/files/files.h"
#include "common/profile/layer_names.h"
#include "common/profile/profile.h"
#include "common/profile/warnings.h"
#include "common/scoring/targets/reachable.h"

namespace needlelab {
namespace {

/// Warnings about the profile itself, and about targets that its needle cannot reach.
std::vector<std::string> allWarnings(const pb::Profile& profile) {
  std::vector<std::string> warnings = profileWarnings(profile);
  for (std::string& target : unreachableTargets(profile, profile.needle().length_m()))
    warnings.push_back(std::move(target));
  return warnings;
}

Status importProfile(CommandContext& context, const std::string& file) {
  ASSIGN_OR_RETURN(const auto text, readWholeFile(file, kMaxProfileBytes));
  // check here as well, so that the message names the file
  ASSIGN_OR_RETURN(const auto profile, parseProfile(text, file));
  for (const std::string& warning : allWarnings(profile))
    context.output.remark(file + ": warning: " + warning);
  pb::Request request;
  request.mutable_import_profile()->set_json(text);
  const auto reply = context.backend.call(request);
  if (!reply) return Error{reply.error().code, file + ": " + reply.error().message};
  context.output.done(
      fmt::format("profile '{}' is revision {}", reply->profile().id(), reply->profile().revision()));
  for (const std::string& warning : reply->profile().warnings())
    context.output.remark(file + ": warning: " + warning);
  return {};
}

Result<pb::ProfileText> getProfile(CommandContext& context, const std::string& id, std::uint32_t revision) {
  pb::Request request;
  request.mutable_get_profile()->set_id(id);
  request.mutable_get_profile()->set_revision(revision);
  ASSIGN_OR_RETURN(auto reply, context.backend.call(request));
  return std::move(*reply.mutable_profile());
}

Status exportProfile(CommandContext& context, const std::string& id, std::uint32_t revision,
                     const std::string& file) {
  ASSIGN_OR_RETURN(const auto profile, getProfile(context, id, revision));
  std::string text = profile.json();
  if (file.empty() && !text.empty() && text.back() == '\n') text.pop_back();
  RETURN_IF_ERROR(writeText(context.output, file, text));
  if (!file.empty()) context.output.done("wrote " + file);
  return {};
}

Status listProfiles(CommandContext& context) {
  pb::Request request;
  request.mutable_list_profiles();
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  Json rows = Json::array();
  for (const auto& profile : reply.profiles().profiles()) {
    rows.push_back({{"id", profile.id()},
                    {"revision", profile.revision()},
                    {"name", profile.name()},
                    {"author", profile.author()},
                    {"created_unix_ns", profile.created_unix_ns()}});
  }
  return context.output.list({{"id", "ID"},
                              {"revision", "REVISION"},
                              {"name", "NAME"},
                              {"author", "AUTHOR"},
                              {"created_unix_ns", "SINCE", Column::Kind::kTime}},
                             rows, "no profiles yet");
}

Status showProfile(CommandContext& context, const std::string& id, std::uint32_t revision) {
  ASSIGN_OR_RETURN(const auto stored, getProfile(context, id, revision));
  ASSIGN_OR_RETURN(const auto profile, parseProfile(stored.json(), "profile '" + id + "'"));
  Json row = {{"id", stored.id()},
              {"revision", stored.revision()},
              {"author", stored.author()},
              {"created_unix_ns", stored.created_unix_ns()},
              {"name", profile.name()},
              {"description", profile.description()},
              {"sources", profile.sources()},
              {"profile", Json::parse(stored.json())},
              {"warnings", allWarnings(profile)}};
  if (auto done = context.output.one({{"id", "id"},
                                      {"revision", "revision"},
                                      {"name", "name"},
                                      {"description", "description"},
                                      {"sources", "sources"},
                                      {"author", "author"},
                                      {"created_unix_ns", "since", Column::Kind::kTime}},
                                     row);
      !done || context.output.json()) {
    return done;
  }
  Json layers = Json::array();
  if (profile.has_volume())
    for (const Json& structure : row["profile"]["volume"]["structures"]) layers.push_back(structure["layer"]);
  else
    layers = row["profile"]["layers"];
  const std::vector<std::string> names = layerNames(profile);
  for (std::size_t i = 0; i < names.size(); ++i) {
    Json& layer = layers[i];
    layer["name"] = names[i];
    if (layer.contains("thickness_m")) layer["thickness_mm"] = layer["thickness_m"].get<double>() * 1e3;
    if (layer.contains("puncture")) layer["puncture_n"] = layer["puncture"]["force_n"];
  }
  context.output.text("\n" + tableText({{"name", "NAME"},
                                        {"tissue", "TISSUE"},
                                        {"thickness_mm", "THICKNESS mm"},
                                        {"cutting_force_n", "CUTTING N"},
                                        {"attracted_force_n", "ATTRACTED N"},
                                        {"rejection_force_n", "REJECTION N"},
                                        {"lateral_stiffness_n_per_m2", "LATERAL N/m2"},
                                        {"friction_n_per_m", "FRICTION N/m"},
                                        {"puncture_n", "PUNCTURE N"}},
                                       layers));
  for (const auto& warning : row["warnings"]) context.output.text("warning: " + warning.get<std::string>());
  return {};
}

}  // namespace

void addProfileCommands(CLI::App& app, ChosenCommand& chosen) {
  auto* profile = app.add_subcommand("profile", "patients");
  profile->require_subcommand(1);
  struct Values {
    std::vector<std::string> files;
    std::string id, out;
    std::uint32_t revision = 0;
  };
  const auto values = std::make_shared<Values>();

  auto* import_command =
      profile->add_subcommand("import", "store profiles; one that differs becomes a new revision");
  import_command->add_option("file", values->files)->required()->type_name("FILE...");
  import_command->callback([&chosen, values] {
    chosen.may_create = true;
    // read all files before a folder is created and the first one is stored
    chosen.check = [values]() -> Status {
      for (const std::string& file : values->files) {
        RETURN_IF_ERROR(loadProfile(file));
      }
      return {};
    };
    chosen.run = [values](CommandContext& context) -> Status {
      for (const std::string& file : values->files) {
        RETURN_IF_ERROR(importProfile(context, file));
      }
      return {};
    };
  });

  auto* export_command = profile->add_subcommand("export", "write a profile as JSON");
  export_command->add_option("id", values->id)->required();
  export_command->add_option("--revision", values->revision, "default: the newest");
  addNewFile(export_command, chosen, values->out);
  runs(export_command, chosen, [values](CommandContext& context) {
    return exportProfile(context, values->id, values->revision, values->out);
  });

  runs(profile->add_subcommand("list", "list the profiles"), chosen, listProfiles);

  auto* show = profile->add_subcommand("show", "show a profile's layers and warnings");
  show->add_option("id", values->id)->required();
  show->add_option("--revision", values->revision, "default: the newest");
  runs(show, chosen,
       [values](CommandContext& context) { return showProfile(context, values->id, values->revision); });
}

}  // namespace needlelab
