#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "client/admin/command.h"
#include "common/base/files/files.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

Status importCurriculum(CommandContext& context, const std::string& file) {
  ASSIGN_OR_RETURN(const auto text, readWholeFile(file, kMaxProfileBytes));
  RETURN_IF_ERROR(parseCurriculum(text, file));
  pb::Request request;
  request.mutable_import_curriculum()->set_json(text);
  const auto reply = context.backend.call(request);
  if (!reply) return Error{reply.error().code, file + ": " + reply.error().message};
  context.output.done(fmt::format("curriculum '{}' is revision {}", reply->curriculum().id(),
                                  reply->curriculum().revision()));
  return {};
}

Status exportCurriculum(CommandContext& context, const std::string& id, const std::string& file) {
  pb::Request request;
  request.mutable_get_curriculum()->set_id(id);
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  std::string text = reply.curriculum().json();
  if (file.empty() && !text.empty() && text.back() == '\n') text.pop_back();
  RETURN_IF_ERROR(writeText(context.output, file, text));
  if (!file.empty()) context.output.done("wrote " + file);
  return {};
}

Status listCurricula(CommandContext& context) {
  pb::Request request;
  request.mutable_list_curricula();
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  Json rows = Json::array();
  for (const auto& curriculum : reply.curricula().curricula()) {
    std::string exercises;
    for (const auto& id : curriculum.exercise_ids()) exercises += (exercises.empty() ? "" : ", ") + id;
    rows.push_back({{"id", curriculum.id()},
                    {"revision", curriculum.revision()},
                    {"name", curriculum.name()},
                    {"exam", curriculum.exam()},
                    {"exercise_ids", std::vector<std::string>(curriculum.exercise_ids().begin(),
                                                              curriculum.exercise_ids().end())},
                    {"exercises", exercises}});
  }
  return context.output.list({{"id", "ID"},
                              {"revision", "REVISION"},
                              {"name", "NAME"},
                              {"exam", "EXAM"},
                              {"exercises", "EXERCISES"}},
                             rows, "no curriculum yet");
}

Status listAssignments(CommandContext& context, const std::string& trainee) {
  Json rows = Json::array();
  const auto done = eachPage(
      context.backend,
      [&](pb::Request& request, const std::string& page) {
        request.mutable_list_assignments()->set_trainee(trainee);
        request.mutable_list_assignments()->set_page(page);
      },
      [&](const pb::Reply& reply) {
        for (const auto& assignment : reply.assignments().assignments()) {
          rows.push_back({{"id", assignment.id()},
                          {"trainee", assignment.trainee()},
                          {"exercise_id", assignment.exercise_id()},
                          {"course_id", assignment.course_id()},
                          {"group_id", assignment.group_id()},
                          {"due_unix_ns", assignment.due_unix_ns()},
                          {"by", assignment.by()},
                          {"created_unix_ns", assignment.created_unix_ns()}});
        }
        return reply.assignments().next_page();
      });
  if (!done) return done;
  return context.output.list({{"id", "NUMBER"},
                              {"trainee", "TRAINEE"},
                              {"group_id", "GROUP"},
                              {"exercise_id", "EXERCISE"},
                              {"course_id", "COURSE"},
                              {"due_unix_ns", "DUE", Column::Kind::kTime},
                              {"by", "BY"},
                              {"created_unix_ns", "SINCE", Column::Kind::kTime}},
                             rows, "nothing is assigned");
}

}  // namespace

void addCurriculumCommands(CLI::App& app, ChosenCommand& chosen) {
  struct Values {
    std::string file, id, out, trainee, exercise, group, course, due;
    std::uint64_t number = 0;
  };
  const auto values = std::make_shared<Values>();

  auto* curriculum = app.add_subcommand("curriculum", "courses and their exercises");
  curriculum->require_subcommand(1);
  auto* import_command =
      curriculum->add_subcommand("import", "store a course; its exercises replace the previous ones");
  import_command->add_option("file", values->file)->required()->type_name("FILE");
  import_command->callback([&chosen, values] {
    chosen.may_create = true;
    // an invalid file must not create a folder
    chosen.check = [values]() -> Status {
      RETURN_IF_ERROR(loadCurriculum(values->file));
      return {};
    };
    chosen.run = [values](CommandContext& context) { return importCurriculum(context, values->file); };
  });
  auto* export_command = curriculum->add_subcommand("export", "write a course as JSON");
  export_command->add_option("id", values->id)->required();
  addNewFile(export_command, chosen, values->out);
  runs(export_command, chosen,
       [values](CommandContext& context) { return exportCurriculum(context, values->id, values->out); });
  runs(curriculum->add_subcommand("list", "list courses and their exercises"), chosen, listCurricula);

  auto* assign = app.add_subcommand("assign", "assign an exercise or a course to a trainee or a group");
  assign->add_option("trainee", values->trainee, "or --group");
  assign->add_option("exercise,--exercise", values->exercise, "or --course");
  assign->add_option("--group", values->group, "a group instead of a trainee");
  assign->add_option("--course", values->course, "a course instead of an exercise");
  assign->add_option("--due", values->due, "due date, e.g. 2026-12-01T18:00+01:00");
  assign->callback([&chosen, values] {
    chosen.check = [values]() -> Status {
      if (values->trainee.empty() == values->group.empty())
        return Error{ErrorCode::kInvalidInput, "assign: give a trainee or --group"};
      if (values->exercise.empty() == values->course.empty())
        return Error{ErrorCode::kInvalidInput, "assign: give an exercise or --course"};
      if (values->due.empty()) return {};
      const auto due = momentOf("--due", values->due);
      return due ? Status() : Status(due.error());
    };
    chosen.run = [values](CommandContext& context) -> Status {
      pb::Request request;
      auto* call = request.mutable_assign();
      call->set_trainee(values->trainee);
      call->set_exercise_id(values->exercise);
      call->set_group_id(values->group);
      call->set_course_id(values->course);
      if (!values->due.empty()) call->set_due_unix_ns(*momentOf("--due", values->due));
      RETURN_IF_ERROR(context.backend.call(request));
      context.output.done("assigned '" + (values->course.empty() ? values->exercise : values->course) +
                          "' to '" + (values->group.empty() ? values->trainee : values->group) + "'");
      return {};
    };
  });
  auto* unassign = app.add_subcommand("unassign", "withdraw an assignment");
  unassign->add_option("number", values->number, "as `assignments` shows it")
      ->required()
      ->check(CLI::NonNegativeNumber);  // -1 would be read as the greatest number
  runs(unassign, chosen, [values](CommandContext& context) -> Status {
    pb::Request request;
    request.mutable_remove_assignment()->set_id(values->number);
    RETURN_IF_ERROR(context.backend.call(request));
    context.output.done(fmt::format("took assignment {} back", values->number));
    return {};
  });
  auto* assignments = app.add_subcommand("assignments", "list the assignments");
  assignments->add_option("--trainee", values->trainee, "default: all trainees");
  runs(assignments, chosen,
       [values](CommandContext& context) { return listAssignments(context, values->trainee); });
}

}  // namespace needlelab
