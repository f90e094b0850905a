#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <memory>
#include <tuple>
#include <vector>

#include "client/admin/command.h"
#include "client/admin/session_export.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/scoring/measures/syringe_events.h"

namespace needlelab {
namespace {

Status listSessions(CommandContext& context, const pb::ListSessions& filter) {
  Json rows = Json::array();
  const auto done = eachPage(
      context.backend,
      [&](pb::Request& request, const std::string& page) {
        auto* call = request.mutable_list_sessions();
        *call = filter;
        if (filter.limit() != 0) call->set_limit(filter.limit() - static_cast<std::uint32_t>(rows.size()));
        call->set_page(page);
      },
      [&](const pb::Reply& reply) {
        for (const auto& session : reply.sessions().sessions()) {
          rows.push_back(sessionRow(session));
          if (filter.unknown_trainee())
            rows.back()["why"] = session.not_assigned()     ? "not assigned"
                                 : session.code_unchecked() ? "code not checked"
                                                            : "no such name";
        }
        return filter.limit() != 0 && rows.size() >= filter.limit() ? std::string()
                                                                    : reply.sessions().next_page();
      });
  if (!done) return done;
  std::vector<Column> columns = {{"session_id", "SESSION"},
                                 {"started_unix_ns", "STARTED", Column::Kind::kTime},
                                 {"station", "STATION"},
                                 {"trainee", "TRAINEE"},
                                 {"exercise_id", "EXERCISE"},
                                 {"state", "STATE"},
                                 {"verdict", "VERDICT", Column::Kind::kVerdict},
                                 {"recording", "RECORDING"},
                                 {"samples", "SAMPLES"},
                                 {"stored_bytes", "SIZE", Column::Kind::kBytes}};
  if (filter.unknown_trainee()) columns.push_back({"why", "WAITS BECAUSE"});
  return context.output.list(columns, rows, "no sessions");
}

/// Assigns each closed session that waits for its trainee's code to the person whose name it came with.
Status confirmSessions(CommandContext& context, const std::string& station, const std::string& trainee) {
  // collect all first: a confirmed session leaves the list
  std::vector<pb::SessionInfo> waiting;
  RETURN_IF_ERROR(eachPage(
      context.backend,
      [&](pb::Request& request, const std::string& page) {
        auto* call = request.mutable_list_sessions();
        call->set_station(station);
        call->set_trainee(trainee);
        call->set_unknown_trainee(true);
        call->set_page(page);
      },
      [&](const pb::Reply& reply) {
        for (const auto& session : reply.sessions().sessions())
          if (session.code_unchecked()) waiting.push_back(session);
        return reply.sessions().next_page();
      }));
  std::size_t confirmed = 0, open = 0;
  Json rows = Json::array();
  for (const pb::SessionInfo& session : waiting) {
    rows.push_back(sessionRow(session));
    std::string outcome = "still open";
    if (session.state() == pb::SESSION_OPEN) {
      ++open;
    } else {
      pb::Request request;
      auto* call = request.mutable_assign_session();
      call->set_session_id(session.description().session_id());
      call->set_trainee(session.description().trainee());
      call->set_was(session.description().trainee());
      call->set_reason("confirmed without a code");
      const auto reply = context.backend.call(request);
      outcome = reply ? "confirmed" : reply.error().message;
      confirmed += reply ? 1 : 0;
    }
    rows.back()["outcome"] = outcome;
  }
  RETURN_IF_ERROR(context.output.list({{"session_id", "SESSION"},
                                       {"started_unix_ns", "STARTED", Column::Kind::kTime},
                                       {"station", "STATION"},
                                       {"trainee", "TRAINEE"},
                                       {"exercise_id", "EXERCISE"},
                                       {"outcome", "OUTCOME"}},
                                      rows, "no session waits for a code"));
  if (waiting.empty()) return {};
  context.output.done(fmt::format("{} of {} confirmed, {} still open", confirmed, waiting.size(), open));
  const std::size_t failed = waiting.size() - confirmed - open;
  if (failed == 0) return {};
  return Error{ErrorCode::kFailed, fmt::format("{} sessions could not be confirmed: see above", failed)};
}

/// The syringe's events as rows of JSON; null while the session is open, or if they cannot be computed.
struct SessionEvents {
  Json rows;
  bool stored = false;
};
Result<SessionEvents> eventsOf(CommandContext& context, const Uuid& id) {
  std::vector<pb::SyringeEvent> events;
  bool stored = false;
  const auto done = eachPage(
      context.backend,
      [&](pb::Request& request, const std::string& page) {
        request.mutable_list_events()->set_session_id(id.data(), id.size());
        request.mutable_list_events()->set_page(page);
      },
      [&](const pb::Reply& reply) {
        events.insert(events.end(), reply.events().events().begin(), reply.events().events().end());
        stored = reply.events().stored();
        return reply.events().next_page();
      });
  if (!done) return done.error();
  return SessionEvents{Json::parse(eventsJson(events)), stored};
}

Status listEvents(CommandContext& context, const Uuid& id) {
  ASSIGN_OR_RETURN(const auto events, eventsOf(context, id));
  if (!events.stored)
    context.output.remark(
        "worked out now: the session was closed before events were stored, or could not be scored then");
  return context.output.list({{"event", "EVENT"}, {"begin_s", "BEGIN_S"}, {"end_s", "END_S"}, {"words", ""}},
                             events.rows, "no aspirations and no injections");
}

Status showSession(CommandContext& context, const Uuid& id) {
  const std::string bytes(id.begin(), id.end());
  pb::Request request;
  request.mutable_get_session()->set_session_id(bytes);
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  Json notes = Json::array();
  const auto listed = eachPage(
      context.backend,
      [&](pb::Request& call, const std::string& page) {
        call.mutable_list_annotations()->set_session_id(bytes);
        call.mutable_list_annotations()->set_page(page);
      },
      [&](const pb::Reply& page) {
        for (const auto& note : page.annotations().annotations()) {
          notes.push_back({{"tick", note.tick()},
                           {"text", note.text()},
                           {"author", note.author()},
                           {"created_unix_ns", note.created_unix_ns()}});
        }
        return page.annotations().next_page();
      });
  if (!listed) return listed;

  const auto& session = reply.session();
  Json row = sessionRow(session);
  row["profile"] = storedJson(session.description().profile_json());
  row["score"] = storedJson(session.score_json());
  // an open session has no events yet, and an unreadable profile gives none; show the rest
  const auto events = eventsOf(context, id);
  row["events"] = events ? events->rows : Json();
  row["annotations"] = std::move(notes);
  if (auto done = context.output.one({{"session_id", "session"},
                                      {"state", "state"},
                                      {"recording", "recording"},
                                      {"trainee", "trainee"},
                                      {"station", "station"},
                                      {"device", "device"},
                                      {"exercise_id", "exercise"},
                                      {"profile_id", "profile"},
                                      {"profile_revision", "profile revision"},
                                      {"engine_version", "engine"},
                                      {"rate_hz", "rate Hz"},
                                      {"started_unix_ns", "started", Column::Kind::kTime},
                                      {"closed_unix_ns", "closed", Column::Kind::kTime},
                                      {"samples", "samples"},
                                      {"chunks", "chunks"},
                                      {"stored_bytes", "size", Column::Kind::kBytes},
                                      {"hash", "hash"}},
                                     row);
      !done || context.output.json()) {
    return done;
  }
  if (session.begin_unsure())
    context.output.text(
        "\nits station's clock was wrong when it began: session assign --begin TIME says when it was, and "
        "without --begin accepts the station's time; until then it is not counted");
  else if (session.not_assigned())
    context.output.text(
        fmt::format("\nit was not assigned to '{}' when it came, and its course is only for those to whom it "
                    "is: session assign to the same person lets it count",
                    session.description().trainee()));
  else if (session.code_unchecked())
    context.output.text(
        fmt::format("\nnobody gave the code of '{}': session confirm says that it is theirs, session assign "
                    "gives it to another person",
                    session.description().trainee()));
  else if (session.unknown_trainee())
    context.output.text(
        fmt::format("\nnobody was named '{}' when it came: session assign gives it to the right "
                    "person",
                    session.description().trainee()));
  if (session.quarantined_chunks() > 0)
    context.output.text(fmt::format(
        "\n{} of its chunks cannot be decoded: they are kept as they came, but not shown, scored or Safe "
        "(session verify names the first)",
        session.quarantined_chunks()));
  if (session.has_given_trainee())
    context.output.text(
        session.given_trainee() == session.description().trainee()
            ? "\na manager confirmed it"
            : fmt::format("\nits station named '{}'; a manager assigned it", session.given_trainee()));
  if (session.has_removed_original()) {
    const auto& removed = session.removed_original();
    context.output.text(
        fmt::format("\nthe original ({} samples, {}, hash {}) was removed on {}: {}", removed.samples(),
                    bytesText(removed.stored_bytes()), hexDigitsOf(removed.hash()),
                    localTime(removed.removed_unix_ns(), TimeForm::kZoned), removed.reason()));
  }
  if (row["score"].is_array() && !row["score"].empty()) {
    context.output.text("\n" + measureTable(row["score"]));
  }
  if (row["events"].is_array() && !row["events"].empty())
    context.output.text("\n" + tableText({{"event", "EVENT"}, {"words", ""}}, row["events"]));
  if (!row["annotations"].empty()) {
    context.output.text(
        tableText({{"tick", "TICK"}, {"author", "AUTHOR"}, {"text", "REMARK"}}, row["annotations"]));
  }
  return {};
}

Status verifySession(CommandContext& context, const Uuid& id) {
  pb::Request request;
  request.mutable_verify_session()->set_session_id(id.data(), id.size());
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  const auto& verified = reply.verified();
  const Json row = {{"session_id", uuidText(id)},           {"ok", verified.ok()},
                    {"chunks", verified.chunks()},          {"samples", verified.samples()},
                    {"hash", hexDigitsOf(verified.hash())}, {"text", verified.text()}};
  if (auto done = context.output.one({{"session_id", "session"},
                                      {"ok", "sound"},
                                      {"chunks", "chunks"},
                                      {"samples", "samples"},
                                      {"hash", "hash"},
                                      {"text", "remark"}},
                                     row);
      !done) {
    return done;
  }
  if (!verified.ok()) return Error{ErrorCode::kCorrupt, "verification failed: " + verified.text()};
  return {};
}

}  // namespace

void addSessionCommands(CLI::App& app, ChosenCommand& chosen) {
  auto* session = app.add_subcommand("session", "recorded gestures");
  session->require_subcommand(1);
  struct Values {
    std::string id, station, trainee, exercise, from, to, verdict, search, format, out, text, recipient,
        reason, begin;
    bool unknown = false, every_tick = false;
    std::uint32_t limit = 100, version = 0;
    std::uint64_t tick = 0;
    ExportRange range;
  };
  const auto values = std::make_shared<Values>();

  auto* list = session->add_subcommand("list", "list sessions, newest first");
  list->add_option("--station", values->station, "only this station");
  list->add_option("--trainee", values->trainee, "only this trainee");
  list->add_option("--exercise", values->exercise, "only this exercise");
  list->add_option("--from", values->from, "started at this moment or later")->type_name("2026-12-01T18:00Z");
  list->add_option("--to", values->to, "started before this moment")->type_name("2026-12-01T18:00Z");
  list->add_option(
          "--verdict", values->verdict,
          "passed, not-passed (or failed, its code in JSON), or none: no score, or nothing is required")
      ->check(CLI::IsMember({"passed", "not-passed", "failed", "none"}));
  list->add_option("--search", values->search, "only trainees whose name or full name contains this");
  list->add_flag("--unknown-trainee", values->unknown,
                 "only sessions whose trainee was unknown on arrival, or whose code was not given: session "
                 "assign gives them to the right person");
  list->add_option("--limit", values->limit, "the most to list; 0: all")->capture_default_str();
  list->callback([&chosen, values] {
    const auto filter = std::make_shared<pb::ListSessions>();
    chosen.check = [values, filter]() -> Status {
      filter->set_station(values->station);
      filter->set_trainee(values->trainee);
      filter->set_exercise_id(values->exercise);
      filter->set_limit(values->limit);
      filter->set_search(values->search);
      filter->set_unknown_trainee(values->unknown);
      if (!values->verdict.empty())
        filter->set_verdict(values->verdict == "passed" ? pb::ListSessions::PASSED
                            : values->verdict == "none" ? pb::ListSessions::NONE
                                                        : pb::ListSessions::FAILED);
      for (const auto& [option, text, set] :
           {std::tuple("--from", &values->from, &pb::ListSessions::set_from_unix_ns),
            std::tuple("--to", &values->to, &pb::ListSessions::set_to_unix_ns)}) {
        if (text->empty()) continue;
        ASSIGN_OR_RETURN(const auto moment, momentOf(option, *text));
        ((*filter).*set)(moment);
      }
      return {};
    };
    chosen.run = [filter](CommandContext& context) { return listSessions(context, *filter); };
  });

  /// Subcommands with a session's id as first argument.
  const auto with_id = [&chosen, values](CLI::App* command, auto run) {
    command->add_option("id", values->id, "as session list shows it, or its beginning, or newest")
        ->required()
        ->type_name("ID");
    runs(command, chosen, [values, run](CommandContext& context) -> Status {
      ASSIGN_OR_RETURN(const auto id, sessionIdOf(context, values->id));
      return run(context, id);
    });
  };
  with_id(session->add_subcommand("show", "show a session's data, score and remarks"), showSession);
  auto* assign =
      session->add_subcommand("assign", "assign a waiting session to a person, as that person's attempt");
  assign->add_option("--to", values->recipient, "the person, or guest for no account")
      ->required()
      ->type_name("NAME");
  assign->add_option("--reason", values->reason, "for the audit log");
  assign->add_option("--begin", values->begin, "when the session began, if the station's clock was wrong")
      ->type_name("TIME");
  with_id(assign, [values](CommandContext& context, const Uuid& id) -> Status {
    pb::Request show, request;
    show.mutable_get_session()->set_session_id(id.data(), id.size());
    ASSIGN_OR_RETURN(const auto seen, context.backend.call(show));
    request.mutable_assign_session()->set_session_id(id.data(), id.size());
    request.mutable_assign_session()->set_was(seen.session().description().trainee());
    request.mutable_assign_session()->set_trainee(values->recipient);
    request.mutable_assign_session()->set_reason(values->reason);
    if (!values->begin.empty()) {
      ASSIGN_OR_RETURN(const auto begin_ns, momentOf("--begin", values->begin));
      request.mutable_assign_session()->set_started_unix_ns(begin_ns);
    }
    ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
    context.output.done(fmt::format("the session that its station gave as '{}' is {}'s now",
                                    reply.session().given_trainee(),
                                    reply.session().description().trainee()));
    return {};
  });
  auto* confirm = session->add_subcommand(
      "confirm", "confirm the trainee of all sessions that wait only for a missing code");
  confirm->add_option("--station", values->station, "only this station");
  confirm->add_option("--trainee", values->trainee, "only this trainee");
  runs(confirm, chosen, [values](CommandContext& context) {
    return confirmSessions(context, values->station, values->trainee);
  });
  with_id(session->add_subcommand("verify", "check a session's chunks and hash"), verifySession);
  with_id(session->add_subcommand("events", "list aspirations and injections with place and time"),
          listEvents);
  auto* score =
      session->add_subcommand("score", "show a session's measures beside those of the exercise's experts");
  score->add_option("--version", values->version, "version of the definitions; 0: the newest")
      ->capture_default_str();
  with_id(score, [values](CommandContext& context, const Uuid& id) {
    return showSessionScore(context, id, values->version);
  });
  auto* export_command = session->add_subcommand("export", "write a session's samples for other programs");
  addFormat(export_command, values->format, ExportPlace::kSessionExport,
            formatList(ExportPlace::kSessionExport, &ExportFormat::name) +
                " (common/gesture/FORMAT.md); else what the file's name says");
  addNewFile(export_command, chosen, values->out, "the new file")->required();
  export_command->add_option("--from", values->range.from_s, "begin this long after the first sample")
      ->type_name("SECONDS");
  export_command->add_option("--to", values->range.to_s, "end this long after the first sample")
      ->type_name("SECONDS");
  export_command->add_flag("--damaged", values->range.around_damage,
                           "skip damaged chunks: write the rest, name them, exit 1");
  export_command->add_flag("--every-tick", values->every_tick,
                           "CSV with all ticks and digits; else 250 rows a second for a spreadsheet");
  with_id(export_command, [values](CommandContext& context, const Uuid& id) -> Status {
    ASSIGN_OR_RETURN(const auto* format, formatFor(ExportPlace::kSessionExport, values->format, values->out));
    const bool is_csv = format->name == "csv";
    if (is_csv && values->every_tick) format = formatsAt(ExportPlace::kWebSamples).front();
    RETURN_IF_ERROR(exportSession(context.backend, context.output, id, *format, values->out, values->range));
    if (is_csv && !values->every_tick)
      context.output.remark(fmt::format("it has {}; --every-tick writes all", format->words));
    return {};
  });

  auto* annotate = app.add_subcommand("annotate", "add a remark to a moment of a session");
  annotate->add_option("--tick", values->tick, "the moment (the sample's tick)")
      ->check(CLI::NonNegativeNumber)  // -1 would be read as the greatest number
      ->capture_default_str();
  annotate->add_option("--text", values->text, "the remark")->required();
  with_id(annotate, [values](CommandContext& context, const Uuid& id) -> Status {
    pb::Request request;
    request.mutable_annotate()->set_session_id(id.data(), id.size());
    request.mutable_annotate()->set_tick(values->tick);
    request.mutable_annotate()->set_text(values->text);
    RETURN_IF_ERROR(context.backend.call(request));
    context.output.done("noted");
    return {};
  });
}

}  // namespace needlelab
