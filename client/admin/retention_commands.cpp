// Retention: thinning and deletion of old recordings.
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>

#include "client/admin/command.h"
#include "common/base/text/uuid.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

Json policyRow(const pb::RetentionPolicy& policy) {
  Json row = {{"exercise_id", policy.exercise_id().empty() ? Json() : Json(policy.exercise_id())},
              {"exercise", policy.exercise_id().empty() ? "(all others)" : policy.exercise_id()},
              {"thin_after_days", nullptr},
              {"thin_rate_hz", nullptr},
              {"thin_coarser", nullptr},
              {"delete_after_days", nullptr},
              {"without_backup", policy.without_backup()},
              {"by", policy.by()},
              {"changed_unix_ns", policy.changed_unix_ns()}};
  if (policy.has_thin_after_days()) {
    row["thin_after_days"] = policy.thin_after_days();
    row["thin_rate_hz"] = policy.thin_rate_hz();
    row["thin_coarser"] = policy.thin_coarser();
  }
  if (policy.has_delete_after_days()) row["delete_after_days"] = policy.delete_after_days();
  return row;
}

Status showRetention(CommandContext& context) {
  pb::Request request;
  request.mutable_list_retention();
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  const auto& retention = reply.retention();
  Json rows = Json::array();
  bool has_default = false;
  for (const auto& policy : retention.policies()) {
    rows.push_back(policyRow(policy));
    has_default = has_default || policy.exercise_id().empty();
  }
  if (auto done = context.output.list({{"exercise", "EXERCISE"},
                                       {"thin_after_days", "THIN_AFTER_DAYS"},
                                       {"thin_rate_hz", "TO_HZ"},
                                       {"thin_coarser", "COARSER"},
                                       {"delete_after_days", "DELETE_AFTER_DAYS"},
                                       {"without_backup", "WITHOUT_BACKUP"},
                                       {"by", "BY"},
                                       {"changed_unix_ns", "SINCE", Column::Kind::kTime}},
                                      rows, "no policy: every recording is kept for ever");
      !done)
    return done;
  if (!has_default && !rows.empty()) context.output.text("all other exercises: kept for ever");
  const std::string line = fmt::format(
      "{} sessions thinned, {} deleted; database {}, of it free for new recordings {}; last run {}",
      retention.thinned_sessions(), retention.deleted_sessions(), bytesText(retention.database_bytes()),
      bytesText(retention.free_bytes()), localTime(retention.last_run_unix_ns(), TimeForm::kZoned));
  context.output.done(line);
  return {};
}

const char* actionName(pb::RetentionStep::Action action) {
  switch (action) {
    case pb::RetentionStep::THIN:
      return "thin";
    case pb::RetentionStep::DELETE:
      return "delete";
    case pb::RetentionStep::WAITS_FOR_BACKUP:
      return "waits for a backup";
    case pb::RetentionStep::LEFT_ALONE:
      return "left alone";
    default:
      return "?";
  }
}

Status runNow(CommandContext& context, bool dry_run) {
  pb::Request request;
  request.mutable_run_retention()->set_dry_run(dry_run);
  ASSIGN_OR_RETURN(const auto reply, context.backend.call(request));
  const auto& report = reply.retention_report();
  Json rows = Json::array();
  for (const auto& step : report.steps()) {
    Uuid id{};
    if (step.session_id().size() == id.size())
      std::copy(step.session_id().begin(), step.session_id().end(), id.begin());
    rows.push_back({{"session_id", uuidText(id)},
                    {"exercise_id", step.exercise_id()},
                    {"action", actionName(step.action())},
                    {"bytes_before", step.bytes_before()},
                    {"bytes_after", dry_run ? Json() : Json(step.bytes_after())},
                    {"text", step.text()}});
  }
  if (auto done = context.output.list({{"session_id", "SESSION"},
                                       {"action", "ACTION"},
                                       {"bytes_before", "BEFORE", Column::Kind::kBytes},
                                       {"bytes_after", "AFTER", Column::Kind::kBytes},
                                       {"text", ""}},
                                      rows, "nothing is due");
      !done)
    return done;
  const bool cut = static_cast<std::uint64_t>(rows.size()) <
                   report.thinned() + report.deleted() + report.waiting_for_backup() + report.left_alone();
  context.output.done(fmt::format(
      "{}{} thinned, {} deleted, {} wait for a backup, {} left alone{}; {}{} of the database are free{}",
      dry_run ? "would be: " : "", report.thinned(), report.deleted(), report.waiting_for_backup(),
      report.left_alone(), cut ? fmt::format(" (the first {} are listed)", rows.size()) : "",
      dry_run ? "" : bytesText(report.bytes_before()) + " became " + bytesText(report.bytes_after()) + ", ",
      bytesText(report.free_bytes()),
      report.stopped() ? "; interrupted because the server stopped, the next run continues" : ""));
  return {};
}

}  // namespace

void addRetentionCommands(CLI::App& app, ChosenCommand& chosen) {
  struct Values {
    std::string exercise;
    bool is_default = false, keep = false, as_default = false, without_backup = false, dry_run = false;
    std::optional<std::uint32_t> thin_after, delete_after;
    double rate = 0, coarser = 0;
  };
  const auto values = std::make_shared<Values>();
  auto* retention =
      app.add_subcommand("retention", "what happens to old recordings; they are kept unless a policy is set");
  retention->require_subcommand(1);
  runs(retention->add_subcommand("show", "show the policies and what they have done"), chosen, showRetention);

  auto* run = retention->add_subcommand("run", "apply the policies now; the server does so each day");
  run->add_flag("--dry-run", values->dry_run, "only list what would change");
  runs(run, chosen, [values](CommandContext& context) { return runNow(context, values->dry_run); });

  auto* set = retention->add_subcommand("set", "set the policy of an exercise, or of all others");
  set->add_option("exercise", values->exercise, "an exercise's id")->type_name("EXERCISE");
  set->add_flag("--default", values->is_default,
                "instead of EXERCISE: for all exercises without their own policy");
  set->add_flag("--keep", values->keep, "keep recordings forever");
  set->add_flag("--as-default", values->as_default, "remove its own policy: the default applies");
  set->add_option("--thin-after", values->thin_after,
                  "days after the session closed until samples are thinned")
      ->type_name("DAYS");
  set->add_option("--rate", values->rate, "samples a second that are kept")->type_name("HZ");
  set->add_option("--coarser", values->coarser,
                  "round values K times as coarsely as the original; default: 1")
      ->type_name("K");
  set->add_option("--delete-after", values->delete_after,
                  "days after the session closed until samples are deleted")
      ->type_name("DAYS");
  set->add_flag("--without-backup", values->without_backup,
                "include sessions that no verified backup covers");
  set->callback([&chosen, values] {
    chosen.check = [values]() -> Status {
      const auto bad = [](const char* text) {
        return Error{ErrorCode::kInvalidInput, std::string("retention set: ") + text};
      };
      const Values& v = *values;
      if (v.exercise.empty() != v.is_default) return bad("give either an exercise's id or --default");
      const bool acts = v.thin_after || v.delete_after;
      if (v.keep + v.as_default + acts != 1)
        return bad("give --keep, --as-default, or one or both of --thin-after and --delete-after");
      if (v.thin_after.has_value() != (v.rate != 0)) return bad("--thin-after and --rate go together");
      if (v.coarser != 0 && !v.thin_after) return bad("--coarser goes with --thin-after");
      if (v.without_backup && !acts) return bad("--without-backup goes with --thin-after or --delete-after");
      return {};
    };
    chosen.run = [values](CommandContext& context) -> Status {
      const Values& v = *values;
      pb::Request request;
      auto* call = request.mutable_set_retention();
      call->set_as_default(v.as_default);
      auto* policy = call->mutable_policy();
      policy->set_exercise_id(v.exercise);
      if (v.thin_after) policy->set_thin_after_days(*v.thin_after);
      policy->set_thin_rate_hz(v.rate);
      policy->set_thin_coarser(v.coarser);
      if (v.delete_after) policy->set_delete_after_days(*v.delete_after);
      policy->set_without_backup(v.without_backup);
      RETURN_IF_ERROR(context.backend.call(request));
      context.output.done("set; `retention run --dry-run` says what it means now");
      return {};
    };
  });
}

}  // namespace needlelab
