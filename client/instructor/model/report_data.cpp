#include "client/instructor/model/report_data.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/base/text.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

using ReplyJson = nlohmann::json;

std::string textIn(const ReplyJson& row, const char* key) {
  const auto found = row.find(key);
  return found != row.end() && found->is_string() ? printable(found->get<std::string>()) : std::string();
}

std::vector<double> numbersIn(const ReplyJson& row, const char* key) {
  std::vector<double> numbers;
  const auto found = row.find(key);
  if (found == row.end() || !found->is_array()) return numbers;
  for (const auto& each : *found)
    if (each.is_number()) numbers.push_back(each.get<double>());
  return numbers;
}

class Collector {
 public:
  Collector(const LabCall& call, ReportData& data) : call_(call), data_(data) {}

  Status run() {
    const auto& description = data_.gesture->info.description();
    auto remarks = readRemarks(call_, description.session_id());
    if (!remarks.ok()) return remarks.error();
    data_.remarks = *std::move(remarks);
    if (auto done = readScore(description.session_id()); !done.ok()) return done;
    if (description.exercise_id().empty()) return {};
    if (auto done = readExercise(description.exercise_id()); !done.ok()) return done;
    if (auto done = readReference(description.exercise_id()); !done.ok()) return done;
    if (description.trainee().empty()) return {};
    return readProgress(description.trainee(), description.exercise_id(), description.session_id());
  }

 private:
  /// What the server refuses is noted; a lost connection is an error.
  Result<std::optional<pb::Reply>> ask(const pb::Request& request, const char* what) {
    auto reply = call_(request);
    if (reply.ok()) return std::optional<pb::Reply>(*std::move(reply));
    if (reply.error().code == ErrorCode::kUnavailable || reply.error().code == ErrorCode::kFailed)
      return reply.error();
    data_.notes.push_back(std::string(what) + ": " + printable(reply.error().message));
    return std::optional<pb::Reply>();
  }

  Status readScore(const std::string& session) {
    pb::Request request;
    request.mutable_get_score()->set_session_id(session);
    auto reply = ask(request, "score");
    if (!reply.ok()) return reply.error();
    if (!*reply) return {};
    const pb::Score& score = (*reply)->score();
    if (auto measures = parseScore(score.measures_json()); measures.ok())
      data_.measures = *std::move(measures);
    else
      data_.notes.push_back("score: " + measures.error().message);
    data_.definition_version = score.definition_version();
    if (score.has_passed()) data_.passed = score.passed();
    data_.standings = standingRowsOf(score.comparison_json());
    return {};
  }

  Status readExercise(const std::string& exercise_id) {
    std::string page;
    do {
      pb::Request request;
      request.mutable_list_exercises()->set_page(page);
      auto reply = ask(request, "exercise");
      if (!reply.ok()) return reply.error();
      if (!*reply) return {};
      for (const auto& row : (*reply)->exercises().exercises()) {
        const auto exercise = parseExercise(row.json(), "exercise");
        if (!exercise.ok() || exercise->id() != exercise_id) continue;
        data_.exercise_name = printable(exercise->name());
        data_.exercise_text = printable(exercise->description());
        return {};
      }
      page = (*reply)->exercises().next_page();
    } while (!page.empty());
    return {};
  }

  Status readReference(const std::string& exercise_id) {
    pb::Request request;
    request.mutable_get_reference()->set_exercise_id(exercise_id);
    auto reply = ask(request, "reference");
    if (!reply.ok()) return reply.error();
    if (*reply)
      data_.bands.assign((*reply)->reference().bands().begin(), (*reply)->reference().bands().end());
    return {};
  }

  Status readProgress(const std::string& trainee, const std::string& exercise_id,
                      const std::string& session) {
    pb::Request request;
    request.mutable_get_progress()->set_trainee(trainee);
    request.mutable_get_progress()->set_exercise_id(exercise_id);
    auto reply = ask(request, "progress");
    if (!reply.ok()) return reply.error();
    if (!*reply) return {};
    for (const auto& attempt : (*reply)->progress().attempts())
      if (attempt.session_id() == session) data_.attempt = attempt.number();
    data_.progress = progressRowsOf((*reply)->progress().measures_json());
    return {};
  }

  const LabCall& call_;
  ReportData& data_;
};

}  // namespace

std::vector<StandingRow> standingRowsOf(const std::string& comparison_json) {
  std::vector<StandingRow> rows;
  const auto list = ReplyJson::parse(comparison_json, nullptr, false);
  if (!list.is_array()) return rows;
  for (const auto& row : list)
    if (row.is_object())
      rows.push_back({textIn(row, "measure"), textIn(row, "standing"), textIn(row, "words")});
  return rows;
}

std::vector<ProgressRow> progressRowsOf(const std::string& measures_json) {
  std::vector<ProgressRow> rows;
  const auto list = ReplyJson::parse(measures_json, nullptr, false);
  if (!list.is_array()) return rows;
  for (const auto& row : list) {
    if (!row.is_object()) continue;
    ProgressRow one{textIn(row, "measure"), textIn(row, "unit"), textIn(row, "words"),
                    numbersIn(row, "attempts"), numbersIn(row, "values")};
    for (double& attempt : one.attempts) attempt += 1;  // they count from 0 there
    const std::size_t n = std::min(one.attempts.size(), one.values.size());
    one.attempts.resize(n);
    one.values.resize(n);
    if (n > 0) rows.push_back(std::move(one));
  }
  return rows;
}

Result<ReportData> collectReport(const LabCall& call, std::shared_ptr<const StoredGesture> gesture) {
  ReportData data;
  data.gesture = std::move(gesture);
  if (auto done = Collector(call, data).run(); !done.ok()) return done.error();
  return data;
}

}  // namespace needlelab
