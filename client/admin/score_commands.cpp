// Scores: of one session, of everyone as a table, recomputed with newer definitions; the reference experts.
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <memory>

#include "client/admin/command.h"
#include "common/base/files/files.h"
#include "common/base/text/strict_json.h"
#include "common/scoring/measures/measures.h"

namespace needlelab {
namespace {

/// Returns the rows of a list in a reply; an empty list if the text is invalid.
Json rowsOfText(const std::string& json) {
  Json rows = readShallowJson<Json>(json.empty() ? "[]" : json);
  return rows.is_array() ? rows : Json::array();
}

struct ScoreChoice {
  std::string course, group, format, out, exercise;
  std::uint32_t version = 0;
  bool dry_run = false;
  std::vector<std::string> sessions;
};

Status exportScores(CommandContext& context, const ScoreChoice& choice) {
  ASSIGN_OR_RETURN(const auto* const format,
                   formatFor(ExportPlace::kScoresExport, choice.format, choice.out));
  ASSIGN_OR_RETURN(auto file, GrowingFile::create(choice.out));
  const auto writer = format->scores();
  std::string text;
  writer->begin(text);
  std::uint64_t scores = 0;
  Status fault;
  const auto done = eachPage(
      context.backend,
      [&](pb::Request& request, const std::string& page) {
        auto* call = request.mutable_list_scores();
        call->set_course_id(choice.course);
        call->set_group_id(choice.group);
        call->set_page(page);
      },
      [&](const pb::Reply& reply) {
        for (const pb::ScoreRow& row : reply.scores().scores()) {
          fault = writer->add(text, row);
          if (!fault) return std::string();
          ++scores;
        }
        fault = file.append(viewOf(text));
        text.clear();
        return fault ? reply.scores().next_page() : std::string();
      });
  if (!done) return done;
  if (!fault) return fault;
  writer->end(text);
  RETURN_IF_ERROR(file.append(viewOf(text)));
  RETURN_IF_ERROR(file.finish());
  context.output.done(fmt::format("{} scores in {}", scores, choice.out));
  return {};
}

Status rescoreAll(CommandContext& context, const ScoreChoice& choice) {
  pb::Request request;
  request.mutable_rescore_all()->set_exercise_id(choice.exercise);
  request.mutable_rescore_all()->set_dry_run(choice.dry_run);
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  const auto& report = reply.rescore_report();
  Json rows = Json::array();
  for (const auto& fault : report.faults()) {
    Uuid id{};
    if (fault.session_id().size() == id.size())
      std::copy(fault.session_id().begin(), fault.session_id().end(), id.begin());
    rows.push_back({{"session_id", uuidText(id)}, {"text", fault.text()}});
  }
  if (auto done = context.output.list({{"session_id", "LEFT ALONE"}, {"text", ""}}, rows,
                                      "no session was left alone");
      !done)
    return done;
  context.output.done(fmt::format(
      "{}{} sessions, by definition version {}; {} left alone{}",
      report.dry_run() ? "would be scored: " : "scored: ", report.rescored(), report.definition_version(),
      report.left_alone(),
      report.stopped() ? "; interrupted because the server stopped, the next run continues" : ""));
  return {};
}

Status showReference(CommandContext& context, const pb::Reference& reference) {
  Json rows = Json::array();
  for (const auto& band : reference.bands()) {
    rows.push_back({{"measure", band.measure()},
                    {"unit", band.unit()},
                    {"n", band.n()},
                    {"mean", band.mean()},
                    {"sd", band.has_sd() ? Json(band.sd()) : Json()},
                    {"p10", band.has_p10() ? Json(band.p10()) : Json()},
                    {"median", band.median()},
                    {"p90", band.has_p90() ? Json(band.p90()) : Json()}});
  }
  for (const std::string& measure : reference.pending())
    context.output.remark(fmt::format("the band of {} is not computed yet: ask again", measure));
  return context.output.list({{"measure", "MEASURE"},
                              {"unit", "UNIT"},
                              {"n", "N"},
                              {"mean", "MEAN"},
                              {"sd", "SD"},
                              {"p10", "P10"},
                              {"median", "MEDIAN"},
                              {"p90", "P90"}},
                             rows, "no session of experts was chosen yet");
}

/// Replaces the previous choice.
Status setReference(CommandContext& context, const ScoreChoice& choice) {
  pb::Request now;
  now.mutable_get_reference()->set_exercise_id(choice.exercise);
  ASSIGN_OR_RETURN(const auto before, context.backend.call(now));
  pb::Request request;
  auto* call = request.mutable_set_reference();
  call->set_exercise_id(choice.exercise);
  call->set_base_revision(before.reference().revision());
  for (const std::string& text : choice.sessions) {
    ASSIGN_OR_RETURN(const auto id, parseUuid(text));
    call->add_session_ids(id.data(), id.size());
  }
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  context.output.done(fmt::format("the reference of '{}' is revision {}, of {} sessions", choice.exercise,
                                  reply.reference().revision(), reply.reference().session_ids_size()));
  return {};
}

void addReferenceCommands(CLI::App& app, ChosenCommand& chosen) {
  const auto choice = std::make_shared<ScoreChoice>();
  auto* reference = app.add_subcommand("reference", "the experts' sessions that others are compared with");
  reference->require_subcommand(1);
  auto* set = reference->add_subcommand("set", "choose the experts' sessions; none: no comparison");
  set->add_option("exercise", choice->exercise)->required();
  set->add_option("sessions", choice->sessions, "their UUIDs");
  runs(set, chosen, [choice](CommandContext& context) { return setReference(context, *choice); });
  auto* show = reference->add_subcommand("show", "show the experts' range of each measure");
  show->add_option("exercise", choice->exercise)->required();
  runs(show, chosen, [choice](CommandContext& context) -> Status {
    pb::Request request;
    request.mutable_get_reference()->set_exercise_id(choice->exercise);
    const auto reply = context.backend.call(request);
    return reply ? showReference(context, reply->reference()) : Status(reply.error());
  });
}

}  // namespace

void addScoreCommands(CLI::App& app, ChosenCommand& chosen) {
  addReferenceCommands(app, chosen);
  const auto choice = std::make_shared<ScoreChoice>();
  auto* scores = app.add_subcommand("scores", "scores of sessions");
  scores->require_subcommand(1);

  const ExportFormat& usual = *formatsAt(ExportPlace::kScoresExport).front();
  auto* out = scores->add_subcommand("export", std::string(usual.words));
  addFormat(out, choice->format, ExportPlace::kScoresExport,
            formatList(ExportPlace::kScoresExport, &ExportFormat::name))
      ->default_str(std::string(usual.name));
  addNewFile(out, chosen, choice->out, "the new file")->required();
  out->add_option("--course", choice->course, "only exercises of this course");
  out->add_option("--group", choice->group, "only people of this group");
  runs(out, chosen, [choice](CommandContext& context) { return exportScores(context, *choice); });

  auto* again = scores->add_subcommand(
      "rescore", "score all sessions again whose score is from older definitions; the old scores stay");
  again->add_option("--exercise", choice->exercise, "only sessions of this exercise");
  again->add_flag("--dry-run", choice->dry_run, "only count them");
  runs(again, chosen, [choice](CommandContext& context) { return rescoreAll(context, *choice); });
}

std::string measureTable(const Json& measures) {
  Json rows = measures;
  for (Json& row : rows) {
    const auto value = row.find("value");
    if (value == row.end() || !value->is_number()) continue;
    const auto unit = row.find("unit");
    *value = measureText(row.value("measure", ""), value->get<double>(),
                         unit != row.end() && unit->is_string() ? unit->get<std::string>() : "");
  }
  return tableText({{"measure", "MEASURE"},
                    {"value", "VALUE"},
                    {"passed", "VERDICT", Column::Kind::kVerdict},
                    {"words", ""}},
                   rows);
}

Status showSessionScore(CommandContext& context, const Uuid& id, std::uint32_t version) {
  pb::Request request;
  request.mutable_get_score()->set_session_id(id.data(), id.size());
  request.mutable_get_score()->set_definition_version(version);
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  const pb::Score& score = reply.score();
  Json row = {{"session_id", uuidText(id)},
              {"definition_version", score.definition_version()},
              {"passed", score.has_passed() ? Json(score.passed()) : Json()},
              {"first", score.first()},
              {"made_unix_ns", score.made_unix_ns()},
              {"engine_version", score.engine_version()},
              {"measures", rowsOfText(score.measures_json())},
              {"comparison", rowsOfText(score.comparison_json())}};
  if (auto done = context.output.one({{"session_id", "session"},
                                      {"definition_version", "definitions"},
                                      {"passed", "verdict", Column::Kind::kVerdict},
                                      {"first", "the first one"},
                                      {"made_unix_ns", "made", Column::Kind::kTime}},
                                     row);
      !done || context.output.json())
    return done;
  context.output.text("\n" + measureTable(row["measures"]));
  if (!row["comparison"].empty())
    context.output.text(
        "\n" + tableText({{"measure", "MEASURE"}, {"place", "PLACE"}, {"words", ""}}, row["comparison"]));
  return {};
}

}  // namespace needlelab
