#include "client/instructor/model/stored/session_analysis.h"

#include <utility>

#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "common/base/text/uuid.h"

namespace needlelab {

SessionAnalysis::SessionAnalysis(LabConnection& connection, Notices& notices, ScenePreparer prepare)
    : connection_(connection), notices_(notices), prepare_(std::move(prepare)) {}

SessionAnalysis::~SessionAnalysis() {
  progress_.stop = true;
}

void SessionAnalysis::poll() {
  worker_.poll();
}

void SessionAnalysis::begin(AnalysisJob job) {
  job_ = job;
  trouble_.clear();
}

void SessionAnalysis::showError(AnalysisJob job, const Error& error) {
  job_ = job;
  trouble_ = printable(error.message);
  notices_.trouble(trouble_);
}

LabCall SessionAnalysis::caller(const std::function<bool()>& stopped) {
  return [this, stopped](const pb::Request& request) { return connection_.call(request, stopped); };
}

double SessionAnalysis::loadedShare() const {
  const auto chunks = progress_.chunks.load();
  return chunks == 0 ? 0.0 : static_cast<double>(progress_.chunks_read.load()) / static_cast<double>(chunks);
}

// on the worker's thread
Result<std::string> SessionAnalysis::idOf(const SessionChoice& which, const LabCall& call) const {
  if (which.size() == Uuid().size()) return which;
  if (which == "newest" || which == "previous") {
    pb::Request request;
    request.mutable_list_sessions()->set_limit(100);
    ASSIGN_OR_RETURN(const auto reply, call(request));
    // running lessons cannot be replayed
    int left = which == "newest" ? 1 : 2;
    for (const pb::SessionInfo& row : reply.sessions().sessions())
      if (row.state() != pb::SESSION_OPEN && --left == 0) return row.description().session_id();
    return Error{ErrorCode::kNotFound, "the server has no such session yet: " + which};
  }
  if (which.rfind("reference ", 0) == 0) {
    pb::Request request;
    request.mutable_get_reference()->set_exercise_id(which.substr(10));
    ASSIGN_OR_RETURN(const auto reply, call(request));
    if (reply.reference().session_ids().empty())
      return Error{
          ErrorCode::kNotFound,
          "the exercise '" + which.substr(10) +
              "' has no reference yet: choose experts' sessions in the web console, or by needlelab-admin "
              "reference set"};
    return reply.reference().session_ids(0);
  }
  ASSIGN_OR_RETURN(const auto id, parseUuid(which));
  return std::string(id.begin(), id.end());
}

SessionAnalysis::Loaded SessionAnalysis::load(const SessionChoice& which,
                                              const std::function<bool()>& stopped) {
  const LabCall call = caller(stopped);
  progress_.chunks_read = 0;
  progress_.chunks = 0;
  ASSIGN_OR_RETURN(const auto id, idOf(which, call));
  return loadGesture(call, id, prepare_, &progress_);
}

void SessionAnalysis::takeFirst(std::shared_ptr<const StoredGesture> gesture) {
  first_ = std::move(gesture);
  remarks_ = first_->annotations;
  comparison_.reset();
  rerun_.reset();
  report_.reset();
  player.load(first_->first_s(), first_->last_s());
}

void SessionAnalysis::loadFirst(const SessionChoice& which) {
  begin(AnalysisJob::kLoad);
  worker_.start("loading a session", [this, which](const auto& stopped) -> Worker::Finish {
    auto loaded = load(which, stopped);
    return [this, loaded = std::move(loaded)]() mutable {
      if (!loaded.ok()) return showError(AnalysisJob::kLoad, loaded.error());
      takeFirst(std::move(*loaded));
      second_.reset();
    };
  });
}

void SessionAnalysis::loadSecond(const SessionChoice& which) {
  begin(AnalysisJob::kCompare);
  SessionChoice exact = which;
  if (which == "reference" && first_) exact = "reference " + first_->info.description().exercise_id();
  worker_.start("loading the second session", [this, exact](const auto& stopped) -> Worker::Finish {
    auto loaded = load(exact, stopped);
    return [this, loaded = std::move(loaded)]() mutable {
      if (!loaded.ok()) return showError(AnalysisJob::kCompare, loaded.error());
      second_ = std::move(*loaded);
      comparison_.reset();
    };
  });
}

void SessionAnalysis::dropSecond() {
  second_.reset();
  comparison_.reset();
}

void SessionAnalysis::loadBoth(const SessionChoice& first, const SessionChoice& second, Alignment alignment) {
  begin(AnalysisJob::kCompare);
  worker_.start("loading two sessions",
                [this, first, second, alignment](const auto& stopped) -> Worker::Finish {
                  auto a = load(first, stopped);
                  if (!a.ok()) return [this, error = a.error()] { showError(AnalysisJob::kCompare, error); };
                  SessionChoice exact = second;
                  if (second == "reference") exact = "reference " + (*a)->info.description().exercise_id();
                  auto b = load(exact, stopped);
                  if (!b.ok()) return [this, error = b.error()] { showError(AnalysisJob::kCompare, error); };
                  auto both = compareGestures(**a, **b, alignment);
                  return [this, a = std::move(*a), b = std::move(*b), both = std::move(both)]() mutable {
                    takeFirst(std::move(a));
                    second_ = std::move(b);
                    if (both.ok())
                      comparison_ = std::move(*both);
                    else
                      showError(AnalysisJob::kCompare, both.error());
                  };
                });
}

void SessionAnalysis::compare(Alignment alignment) {
  begin(AnalysisJob::kCompare);
  if (!first_ || !second_)
    return showError(AnalysisJob::kCompare, {ErrorCode::kInvalidInput, "two sessions are needed to compare"});
  worker_.start("comparing", [this, a = first_, b = second_, alignment](const auto&) -> Worker::Finish {
    auto both = compareGestures(*a, *b, alignment);
    return [this, a, b, both = std::move(both)]() mutable {
      if (a != first_ || b != second_) return;
      if (!both.ok()) return showError(AnalysisJob::kCompare, both.error());
      comparison_ = std::move(*both);
    };
  });
}

void SessionAnalysis::rerun(const std::string& profile_id, const std::string& axial_model) {
  begin(AnalysisJob::kRerun);
  if (!first_) return showError(AnalysisJob::kRerun, {ErrorCode::kInvalidInput, "load a session first"});
  worker_.start("running the engine on the recording",
                [this, gesture = first_, profile_id, axial_model](const auto& stopped) -> Worker::Finish {
                  RerunChoice choice;
                  choice.axial_model = axial_model;
                  if (!profile_id.empty() && profile_id != "own") {
                    pb::Request request;
                    request.mutable_get_profile()->set_id(profile_id);
                    auto reply = connection_.call(request, stopped);
                    if (!reply.ok())
                      return [this, error = reply.error()] { showError(AnalysisJob::kRerun, error); };
                    choice.profile_json = reply->profile().json();
                  }
                  auto run = rerunGesture(*gesture, choice, prepare_, stopped);
                  if (!run.ok())
                    return [this, error = run.error()] { showError(AnalysisJob::kRerun, error); };
                  return [this, gesture, result = std::make_shared<const Rerun>(std::move(*run))] {
                    if (gesture == first_) rerun_ = result;
                  };
                });
}

void SessionAnalysis::collect() {
  begin(AnalysisJob::kScore);
  if (!first_) return showError(AnalysisJob::kScore, {ErrorCode::kInvalidInput, "load a session first"});
  worker_.start("reading score and progress",
                [this, gesture = first_](const auto& stopped) -> Worker::Finish {
                  auto data = collectReport(caller(stopped), gesture);
                  return [this, gesture, data = std::move(data)]() mutable {
                    if (gesture != first_) return;
                    if (!data.ok()) return showError(AnalysisJob::kScore, data.error());
                    report_ = std::move(*data);
                  };
                });
}

void SessionAnalysis::exportTo(const std::filesystem::path& file) {
  begin(AnalysisJob::kExport);
  if (!first_) return showError(AnalysisJob::kExport, {ErrorCode::kInvalidInput, "load a session first"});
  const std::string kind = lowerCase(file.extension().string());
  if (kind != ".html" && kind != ".csv")
    return showError(AnalysisJob::kExport,
                     {ErrorCode::kInvalidInput,
                      file.string() + ": the name must end in .html (report) or .csv (samples)"});
  worker_.start("exporting", [this, gesture = first_, file, kind](const auto& stopped) -> Worker::Finish {
    const Status done = [&]() -> Status {
      if (kind == ".csv") return writeSamplesCsv(*gesture, file);
      ASSIGN_OR_RETURN(const auto data, collectReport(caller(stopped), gesture));
      return writeFileAtomically(file, viewOf(reportHtml(data)));
    }();
    return [this, file, done] {
      if (!done.ok()) return showError(AnalysisJob::kExport, done.error());
      notices_.good("written: " + file.string());
    };
  });
}

void SessionAnalysis::readRemarks() {
  if (!first_) return;
  worker_.start("reading the remarks", [this, gesture = first_](const auto& stopped) -> Worker::Finish {
    auto remarks = needlelab::readRemarks(caller(stopped), gesture->info.description().session_id());
    if (!remarks.ok()) return [this, error = remarks.error()] { showError(AnalysisJob::kRemarks, error); };
    return [this, gesture, remarks = std::move(*remarks)]() mutable {
      if (gesture == first_) remarks_ = std::move(remarks);
    };
  });
}

}  // namespace needlelab
