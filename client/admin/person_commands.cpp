// A person's data, consent, studies, and the export of all records.
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <memory>
#include <string>
#include <vector>

#include "client/admin/command.h"
#include "client/admin/session_export.h"
#include "common/base/files/files.h"
#include "db/service/records/record_end.h"

namespace needlelab {
namespace {

/// Writes pages of records to a file (atomically, readable only by its owner) or to the output.
/// `place`: kRecords has a last line with the count and hash of those before it (recordsEnd).
Status writeRecords(CommandContext& context, ExportPlace place, const std::string& file,
                    const std::function<void(pb::Request&, const std::string&)>& ask,
                    const std::string& what) {
  const ExportFormat* const format = formatsAt(place).front();
  std::string text;
  std::uint64_t count = 0;
  const auto done = eachPage(context.backend, ask, [&](const pb::Reply& reply) {
    for (const std::string& record : reply.records().records()) {
      format->record(text, record);
      ++count;
    }
    return reply.records().next_page();
  });
  if (!done) return done;
  if (place == ExportPlace::kRecords) text += recordsEnd(count, text) + "\n";
  if (file.empty()) {
    if (!text.empty()) text.pop_back();
    context.output.document(text);
    return {};
  }
  RETURN_IF_ERROR(writeFileAtomically(file, viewOf(text), 0600));
  context.output.done(fmt::format("wrote {} records of {} to {}", count, what, file));
  return {};
}

std::string recordsHelp(ExportPlace place, std::string_view as) {
  return fmt::format("{}{}{}", formatsAt(place).front()->words, as, formatList(place, &ExportFormat::title));
}

void addConsentCommands(CLI::App& app, ChosenCommand& chosen) {
  struct Values {
    std::string name, note;
  };
  const auto values = std::make_shared<Values>();
  auto* consent = app.add_subcommand("consent", "people's consent to studies");
  consent->require_subcommand(1);
  for (const bool given : {true, false}) {
    auto* command = given ? consent->add_subcommand("give", "record a person's consent")
                          : consent->add_subcommand(
                                "withdraw", "withdraw a person's consent: later exports leave them out");
    command->add_option("name", values->name)->required();
    command->add_option("--note", values->note, "e.g. where the signed paper is");
    runs(command, chosen, [values, given](CommandContext& context) -> Status {
      pb::Request request;
      request.mutable_set_consent()->set_name(values->name);
      request.mutable_set_consent()->set_given(given);
      request.mutable_set_consent()->set_note(values->note);
      RETURN_IF_ERROR(context.backend.call(request));
      context.output.done("'" + values->name + (given ? "' consents" : "' consents no more"));
      return {};
    });
  }
  auto* list = consent->add_subcommand("list", "list a person's decisions");
  list->add_option("name", values->name)->required();
  runs(list, chosen, [values](CommandContext& context) -> Status {
    pb::Request request;
    request.mutable_list_consents()->set_name(values->name);
    ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
    Json rows = Json::array();
    for (const auto& one : reply.consents().consents())
      rows.push_back(
          {{"given", one.given()},
           {"unix_ns", one.unix_ns()},
           {"recorded_by", one.recorded_by()},
           {"how", one.recorded_by() == values->name ? "by the person" : "on paper, by " + one.recorded_by()},
           {"note", one.note()}});
    return context.output.list(
        {{"unix_ns", "WHEN", Column::Kind::kTime}, {"given", "CONSENTS"}, {"how", "HOW"}, {"note", "NOTE"}},
        rows, "never asked");
  });
}

void addMentionCommands(CLI::App& person, ChosenCommand& chosen) {
  struct Values {
    std::string name, text, where;
  };
  const auto values = std::make_shared<Values>();
  auto* list = person.add_subcommand(
      "mentions", "list remarks, titles and other texts that name a person; an erasure does not change them");
  auto* redact = person.add_subcommand("redact", "remove a person's names from one of these texts");
  for (CLI::App* const command : {list, redact}) {
    command->add_option("name", values->name)->required();
    command->add_option("--text", values->text, "also look for these words, such as a nickname")
        ->type_name("WORDS");
  }
  redact->add_option("--where", values->where, "as 'mentions' shows it, such as \"remark 12\"")
      ->required()
      ->type_name("WHERE");
  runs(list, chosen, [values](CommandContext& context) -> Status {
    Json rows = Json::array();
    RETURN_IF_ERROR(eachPage(
        context.backend,
        [&](pb::Request& request, const std::string& page) {
          request.mutable_list_mentions()->set_name(values->name);
          request.mutable_list_mentions()->set_text(values->text);
          request.mutable_list_mentions()->set_page(page);
        },
        [&](const pb::Reply& reply) {
          for (const pb::Mention& one : reply.mentions().mentions())
            rows.push_back({{"where", one.where()},
                            {"about", one.about()},
                            {"times", one.times()},
                            {"text", one.text()}});
          return reply.mentions().next_page();
        }));
    return context.output.list({{"where", "WHERE"}, {"about", "IN"}, {"times", "TIMES"}, {"text", "TEXT"}},
                               rows, "no text names them");
  });
  runs(redact, chosen, [values](CommandContext& context) -> Status {
    pb::Request request;
    request.mutable_redact()->set_name(values->name);
    request.mutable_redact()->set_text(values->text);
    request.mutable_redact()->set_where(values->where);
    RETURN_IF_ERROR(context.backend.call(request));
    context.output.done("redacted: " + values->where);
    return {};
  });
}

void addOnePersonCommands(CLI::App& app, ChosenCommand& chosen) {
  struct Values {
    std::string name, out, confirm, reason;
    bool with_open = false, with_waiting = false;
  };
  const auto values = std::make_shared<Values>();
  auto* person = app.add_subcommand("person", "all of a person's data");
  person->require_subcommand(1);
  auto* out = person->add_subcommand("export", recordsHelp(ExportPlace::kRecords, ", as "));
  out->add_option("name", values->name)->required();
  addNewFile(out, chosen, values->out);
  runs(out, chosen, [values](CommandContext& context) {
    return writeRecords(
        context, ExportPlace::kRecords, values->out,
        [&](pb::Request& request, const std::string& page) {
          request.mutable_export_person()->set_name(values->name);
          request.mutable_export_person()->set_page(page);
        },
        "'" + values->name + "'");
  });
  addMentionCommands(*person, chosen);
  auto* erase = person->add_subcommand("erase", "erase a person's data forever");
  erase->add_option("name", values->name)->required();
  erase->add_option("--confirm", values->confirm, "the name again")->required()->type_name("NAME");
  erase->add_option("--reason", values->reason, "for the record of erasures");
  erase->add_flag("--with-open-sessions", values->with_open,
                  "include open sessions: samples still arriving are discarded");
  erase->add_flag("--with-waiting", values->with_waiting,
                  "include sessions that wait for a manager under this name: they may be another person's");
  runs(erase, chosen, [values](CommandContext& context) -> Status {
    pb::Request request;
    auto* call = request.mutable_erase_person();
    call->set_name(values->name);
    call->set_confirm(values->confirm);
    call->set_reason(values->reason);
    call->set_with_open_sessions(values->with_open);
    call->set_with_waiting_sessions(values->with_waiting);
    ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
    const auto& erasure = reply.erasure();
    if (auto done = context.output.one({{"pseudonym", "known as"},
                                        {"sessions", "sessions"},
                                        {"recordings", "recordings removed"},
                                        {"scores", "scores removed"},
                                        {"remarks_kept", "remarks kept"},
                                        {"waiting_sessions", "sessions that wait under the name, left"},
                                        {"state", "the erasure"}},
                                       {{"pseudonym", erasure.pseudonym()},
                                        {"sessions", erasure.sessions()},
                                        {"recordings", erasure.recordings()},
                                        {"scores", erasure.scores()},
                                        {"remarks_kept", erasure.remarks_kept()},
                                        {"waiting_sessions", erasure.waiting_sessions()},
                                        {"state", erasure.pending() ? "pending: see below" : "complete here"},
                                        {"pending", erasure.pending()},
                                        {"text", erasure.text()}});
        !done)
      return done;
    context.output.remark(erasure.text());
    return {};
  });
}

}  // namespace

void addPersonCommands(CLI::App& app, ChosenCommand& chosen) {
  addOnePersonCommands(app, chosen);
  addConsentCommands(app, chosen);
  struct Values {
    std::string study, out, exercise, session, format;
    bool remarks = false, setup = false, passwords = false;
  };
  const auto values = std::make_shared<Values>();
  auto* study =
      app.add_subcommand("study", "for researchers: data of people who consented, under pseudonyms");
  study->require_subcommand(1);
  auto* out = study->add_subcommand("export", recordsHelp(ExportPlace::kStudyExport, " as "));
  out->add_option("study", values->study, "the study's name; another study has other pseudonyms")->required();
  addFormat(out, values->format, ExportPlace::kStudyExport,
            formatList(ExportPlace::kStudyExport, &ExportFormat::name) +
                " (a folder with every recording); else what the file's name says");
  addNewFile(out, chosen, values->out);
  out->add_option("--exercise", values->exercise, "default: all");
  out->add_flag("--with-remarks", values->remarks,
                "include instructors' remarks; names in them are replaced");
  out->add_flag("--with-setup", values->setup,
                "include device, placement and tool; they tell stations apart");
  runs(out, chosen, [values](CommandContext& context) -> Status {
    ASSIGN_OR_RETURN(const auto* const format,
                     formatFor(ExportPlace::kStudyExport, values->format, values->out));
    const auto ask = [&](pb::Request& request, const std::string& page) {
      auto* call = request.mutable_export_study();
      call->set_with_setup(values->setup);
      call->set_study(values->study);
      call->set_exercise_id(values->exercise);
      call->set_with_remarks(values->remarks);
      call->set_page(page);
    };
    if (format->form == ExportForm::kBids)
      return exportStudyFolder(context.backend, context.output, values->study, values->out, ask);
    return writeRecords(context, ExportPlace::kStudyExport, values->out, ask,
                        "study '" + values->study + "'");
  });
  auto* recording = study->add_subcommand(
      "recording", "write the samples of one of the study's sessions; times begin at 0");
  recording->add_option("study", values->study)->required();
  recording->add_option("session", values->session, "as study export names it")->required();
  addFormat(recording, values->format, ExportPlace::kStudyRecording, "");
  addNewFile(recording, chosen, values->out, "the new file")->required();
  runs(recording, chosen, [values](CommandContext& context) -> Status {
    ASSIGN_OR_RETURN(const auto* const format,
                     formatFor(ExportPlace::kStudyRecording, values->format, values->out));
    return exportStudyRecording(context.backend, context.output, values->study, values->session, *format,
                                values->out);
  });
  auto* all = app.add_subcommand("export-all", recordsHelp(ExportPlace::kRecords, ", as "));
  addNewFile(all, chosen, values->out);
  all->add_flag("--with-passwords", values->passwords,
                "include the hashes of passwords and of stations' keys");
  runs(all, chosen, [values](CommandContext& context) {
    return writeRecords(
        context, ExportPlace::kRecords, values->out,
        [&](pb::Request& request, const std::string& page) {
          request.mutable_export_all()->set_with_passwords(values->passwords);
          request.mutable_export_all()->set_page(page);
        },
        "everything");
  });
}

}  // namespace needlelab
