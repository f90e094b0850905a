// Groups, results, progress, scores.
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/admin/command.h"
#include "common/base/files/files.h"
#include "common/base/text/csv.h"
#include "common/scoring/measures/measures.h"

namespace needlelab {
namespace {

Result<pb::Group> groupNamed(Backend& backend, const std::string& id) {
  pb::Request request;
  request.mutable_get_group()->set_id(id);
  ASSIGN_OR_RETURN(const auto reply, backend.call(request));
  return reply.group();
}

/// Changes to a group, which is loaded, or created if `create` is set.
struct GroupEdit {
  std::string id, name;
  std::vector<std::string> join, leave;
  bool create = false;
};

Status editGroup(CommandContext& context, const GroupEdit& edit) {
  auto group = groupNamed(context.backend, edit.id);
  if (!group && (!edit.create || group.error().code != ErrorCode::kNotFound)) return group.error();
  pb::Request request;
  auto* put = request.mutable_put_group();
  if (group) *put->mutable_group() = *group;
  put->mutable_group()->set_id(edit.id);
  put->set_base_revision(group ? group->revision() : 0);
  if (!edit.name.empty() || !group) put->mutable_group()->set_name(edit.name.empty() ? edit.id : edit.name);
  std::set<std::string> members(put->group().members().begin(), put->group().members().end());
  members.insert(edit.join.begin(), edit.join.end());
  for (const std::string& name : edit.leave) {
    if (members.erase(name) == 0)
      return Error{ErrorCode::kNotFound, "'" + name + "' is not in group '" + edit.id + "'"};
  }
  put->mutable_group()->clear_members();
  for (const std::string& name : members) put->mutable_group()->add_members(name);
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  context.output.done(fmt::format("group '{}' has {} members, revision {}", edit.id,
                                  reply.group().members_size(), reply.group().revision()));
  return {};
}

Json groupRow(const pb::Group& group) {
  std::string members;
  for (const auto& name : group.members()) members += (members.empty() ? "" : ", ") + name;
  return {{"id", group.id()},
          {"name", group.name()},
          {"count", group.members_size()},
          {"members", std::vector<std::string>(group.members().begin(), group.members().end())},
          {"names", members},
          {"revision", group.revision()},
          {"changed_by", group.changed_by()},
          {"changed_unix_ns", group.changed_unix_ns()}};
}

Status listGroups(CommandContext& context) {
  Json rows = Json::array();
  const auto done = eachPage(
      context.backend,
      [](pb::Request& request, const std::string& page) { request.mutable_list_groups()->set_page(page); },
      [&](const pb::Reply& reply) {
        for (const auto& group : reply.groups().groups()) rows.push_back(groupRow(group));
        return reply.groups().next_page();
      });
  if (!done) return done;
  return context.output.list({{"id", "ID"},
                              {"name", "NAME"},
                              {"count", "MEMBERS"},
                              {"revision", "REVISION"},
                              {"changed_by", "BY"},
                              {"changed_unix_ns", "CHANGED", Column::Kind::kTime}},
                             rows, "no group yet");
}

/// "passed, 2 attempts", "not passed, 3 attempts, 1 left", "tried, 1 attempt", "locked", "-"
std::string cellText(const pb::ResultCell& cell) {
  std::string text = cell.has_passed()           ? verdictName(cell.passed())
                     : cell.attempts() > 0       ? "tried"
                     : cell.locked_by_size() > 0 ? "locked"
                                                 : "-";
  if (cell.attempts() > 0)
    text += fmt::format(", {} attempt{}", cell.attempts(), cell.attempts() == 1 ? "" : "s");
  if (cell.has_attempts_left() && !cell.passed()) text += fmt::format(", {} left", cell.attempts_left());
  if (cell.overdue()) text += ", overdue";
  return text;
}

/// Selects the results; `most` 0: all. `out` empty: no file.
struct ResultChoice {
  std::string course, group, trainee, out, separator = std::string(kCsvSeparators[0]);
  std::uint32_t most = 0;
};

/// Requests page by page while `take` returns true. Reports if not all trainees were included.
Status eachResult(CommandContext& context, const ResultChoice& choice,
                  const std::function<bool(const pb::Results&)>& take) {
  constexpr std::uint32_t kAtOnce = 250;
  std::uint32_t taken = 0, trainees = 0;
  RETURN_IF_ERROR(eachPage(
      context.backend,
      [&](pb::Request& request, const std::string& page) {
        auto& ask = *request.mutable_get_results();
        ask.set_course_id(choice.course);
        ask.set_group_id(choice.group);
        ask.set_trainee(choice.trainee);
        ask.set_limit(choice.most == 0 ? kAtOnce : std::min(kAtOnce, choice.most - taken));
        ask.set_page(page);
        ask.set_with_measures(!choice.out.empty());
      },
      [&](const pb::Reply& reply) {
        const pb::Results& results = reply.results();
        if (results.has_trainees()) trainees = results.trainees();
        taken += static_cast<std::uint32_t>(results.rows_size());
        const bool goes_on = take(results) && (choice.most == 0 || taken < choice.most);
        return goes_on ? results.next_page() : std::string();
      }));
  if (taken < trainees)
    context.output.remark(fmt::format("the first {} of {} trainees, by name", taken, trainees));
  return {};
}

Status exportResults(CommandContext& context, const ResultChoice& choice) {
  ASSIGN_OR_RETURN(const auto style, csvStyleOf(choice.separator));
  ASSIGN_OR_RETURN(const auto* const format, formatFor(ExportPlace::kResults, "", choice.out));
  ASSIGN_OR_RETURN(auto file, GrowingFile::create(choice.out));
  const auto table = format->results(style);
  std::size_t people = 0, rows = 0;
  bool begun = false;
  Status fault;
  RETURN_IF_ERROR(eachResult(context, choice, [&](const pb::Results& page) {
    std::string text;
    if (!std::exchange(begun, true)) table->begin(text, page);
    for (const pb::ResultRow& person : page.rows()) {
      ++people;
      for (const pb::ResultCell& cell : person.cells()) {
        fault = table->add(text, person, cell);
        if (!fault) return false;
        ++rows;
      }
    }
    fault = file.append(viewOf(text));
    return fault.ok();
  }));
  if (!fault) return fault;
  std::string end;
  table->end(end);
  RETURN_IF_ERROR(file.append(viewOf(end)));
  RETURN_IF_ERROR(file.finish());
  context.output.done(fmt::format("{} rows of {} people in {}", rows, people, choice.out));
  return {};
}

Status showResults(CommandContext& context, const ResultChoice& choice) {
  if (!choice.out.empty()) return exportResults(context, choice);
  Json rows = Json::array();
  std::vector<std::string> exercises;
  RETURN_IF_ERROR(eachResult(context, choice, [&](const pb::Results& page) {
    exercises.assign(page.exercise_ids().begin(), page.exercise_ids().end());
    for (const auto& row : page.rows()) {
      Json line{{"trainee", row.trainee()}, {"full_name", row.full_name()}};
      for (const auto& cell : row.cells()) line[cell.exercise_id()] = cellText(cell);
      rows.push_back(std::move(line));
    }
    return true;
  }));
  std::vector<Column> columns{{"trainee", "TRAINEE"}};
  for (const std::string& exercise : exercises) columns.push_back({exercise, exercise});
  return context.output.list(columns, rows, "no one has this course yet");
}

Status showProgress(CommandContext& context, const std::string& trainee, const std::string& exercise) {
  Json rows = Json::array();
  const auto done = eachPage(
      context.backend,
      [&](pb::Request& request, const std::string& page) {
        request.mutable_get_progress()->set_trainee(trainee);
        request.mutable_get_progress()->set_exercise_id(exercise);
        request.mutable_get_progress()->set_page(page);
      },
      [&](const pb::Reply& reply) {
        for (const auto& attempt : reply.progress().attempts()) {
          Uuid id{};
          std::copy_n(attempt.session_id().begin(), std::min(id.size(), attempt.session_id().size()),
                      id.begin());
          rows.push_back(
              {{"exercise_id", attempt.exercise_id()},
               {"number", attempt.number()},
               {"session", uuidText(id)},
               {"started_unix_ns", attempt.started_unix_ns()},
               {"verdict", attempt.has_passed() ? verdictName(attempt.passed()) : "-"},
               {"excused", attempt.excused()},
               {"beyond", attempt.beyond()},
               {"late", attempt.late()},
               {"measures", storedJson(attempt.score_json().empty() ? "[]" : attempt.score_json())}});
        }
        return reply.progress().next_page();
      });
  if (!done) return done;
  return context.output.list({{"exercise_id", "EXERCISE"},
                              {"number", "ATTEMPT"},
                              {"session", "SESSION"},
                              {"started_unix_ns", "BEGUN", Column::Kind::kTime},
                              {"verdict", "VERDICT"},
                              {"excused", "EXCUSED"},
                              {"late", "LATE"}},
                             rows, "no attempt yet");
}

void addGroupCommands(CLI::App& app, ChosenCommand& chosen) {
  struct Values {
    std::string id, name;
    std::vector<std::string> people;
  };
  const auto values = std::make_shared<Values>();
  auto* group = app.add_subcommand("group", "groups of people");
  group->require_subcommand(1);
  group->add_subcommand("list", "list the groups")->callback([&chosen] { chosen.run = listGroups; });

  auto* set = group->add_subcommand("set", "make or rename a group");
  set->add_option("id", values->id)->required();
  set->add_option("--name", values->name, "default: the id");
  runs(set, chosen, [values](CommandContext& context) {
    return editGroup(context,
                     {.id = values->id, .name = values->name, .join = {}, .leave = {}, .create = true});
  });
  for (const bool join : {true, false}) {
    auto* command = join ? group->add_subcommand("join", "add people to a group")
                         : group->add_subcommand("leave", "remove people from a group");
    command->add_option("id", values->id)->required();
    command->add_option("people", values->people)->required();
    runs(command, chosen, [values, join](CommandContext& context) {
      GroupEdit edit{.id = values->id, .name = {}, .join = {}, .leave = {}};
      (join ? edit.join : edit.leave) = values->people;
      return editGroup(context, edit);
    });
  }
  auto* show = group->add_subcommand("show", "show a group's members");
  show->add_option("id", values->id)->required();
  runs(show, chosen, [values](CommandContext& context) -> Status {
    ASSIGN_OR_RETURN(const auto found, groupNamed(context.backend, values->id));
    return context.output.one(
        {{"id", "id"}, {"name", "name"}, {"revision", "revision"}, {"names", "members"}}, groupRow(found));
  });
  auto* remove = group->add_subcommand("remove", "remove a group and its assignments; its people stay");
  remove->add_option("id", values->id)->required();
  runs(remove, chosen, [values](CommandContext& context) -> Status {
    ASSIGN_OR_RETURN(const auto found, groupNamed(context.backend, values->id));
    pb::Request request;
    request.mutable_remove_group()->set_id(values->id);
    request.mutable_remove_group()->set_base_revision(found.revision());
    RETURN_IF_ERROR(context.backend.call(request));
    context.output.done("removed group '" + values->id + "'");
    return {};
  });
}

}  // namespace

void addTeachingCommands(CLI::App& app, ChosenCommand& chosen) {
  addGroupCommands(app, chosen);
  struct Values {
    std::string trainee, exercise, session, reason;
    bool undo = false;
    ResultChoice results;
  };
  const auto values = std::make_shared<Values>();
  auto* results = app.add_subcommand("results", "show who passed what in a course");
  results->add_option("course", values->results.course)->required();
  results->add_option("--group", values->results.group,
                      "default: all who have the course, or tried an exercise of it");
  results->add_option("--trainee", values->results.trainee, "only this trainee");
  results->add_option("--limit", values->results.most, "the most trainees to list, by name")
      ->check(CLI::Range(1u, 1'000'000u));
  auto* out = addNewFile(results, chosen, values->results.out,
                         fmt::format("a table for a spreadsheet ({}) into this new file: {}",
                                     formatList(ExportPlace::kResults, &ExportFormat::title),
                                     formatsAt(ExportPlace::kResults).front()->words));
  results
      ->add_option("--separator", values->results.separator,
                   "of the table's columns: comma, semicolon (with decimal commas) or tab")
      ->check(CLI::IsMember(std::vector<std::string>(kCsvSeparators.begin(), kCsvSeparators.end())))
      ->capture_default_str()
      ->needs(out);
  runs(results, chosen, [values](CommandContext& context) { return showResults(context, values->results); });
  auto* progress = app.add_subcommand("progress", "show a trainee's attempts; with --json their measures");
  progress->add_option("trainee", values->trainee)->required();
  progress->add_option("--exercise", values->exercise, "default: all");
  runs(progress, chosen, [values](CommandContext& context) {
    return showProgress(context, values->trainee, values->exercise);
  });
  auto* excuse = app.add_subcommand("excuse", "do not count an attempt, e.g. after a fault of the station");
  excuse->add_option("session", values->session, "its id, or its beginning, or newest")->required();
  excuse->add_option("--reason", values->reason, "for the audit log");
  excuse->add_flag("--undo", values->undo, "count it again");
  runs(excuse, chosen, [values](CommandContext& context) -> Status {
    ASSIGN_OR_RETURN(const auto id, sessionIdOf(context, values->session));
    pb::Request request;
    request.mutable_excuse_attempt()->set_session_id(id.data(), id.size());
    request.mutable_excuse_attempt()->set_excused(!values->undo);
    request.mutable_excuse_attempt()->set_reason(values->reason);
    ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
    context.output.done(fmt::format("attempt {} of '{}' at '{}{}", reply.attempt().number(),
                                    reply.attempt().trainee(), reply.attempt().exercise_id(),
                                    values->undo ? "' counts again" : "' does not count"));
    return {};
  });
  auto* rescore = app.add_subcommand(
      "rescore", "score a session again by the current definitions; the first score stays");
  rescore->add_option("session", values->session, "its id, or its beginning, or newest")->required();
  runs(rescore, chosen, [values](CommandContext& context) -> Status {
    ASSIGN_OR_RETURN(const auto id, sessionIdOf(context, values->session));
    pb::Request request;
    request.mutable_rescore_session()->set_session_id(id.data(), id.size());
    ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
    context.output.done(fmt::format("scored by definition version {}", reply.score().definition_version()));
    return {};
  });
}

}  // namespace needlelab
