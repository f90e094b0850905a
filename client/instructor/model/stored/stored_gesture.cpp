#include "client/instructor/model/stored/stored_gesture.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/core.h>

#include "client/instructor/model/live/session_scene.h"
#include "client/view/model/gesture_replica.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"
#include "common/haptics/cut_snapshot.h"
#include "common/profile/profile.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/motion/recorded_samples.h"

namespace needlelab {
namespace {

constexpr std::uint32_t kChunksAtOnce = 16;
constexpr std::size_t kNotesKept = 20;

/// Builds the samples' trace, with the engine if the scene allows it.
class TraceMaker {
 public:
  explicit TraceMaker(StoredGesture& gesture) : gesture_(gesture) {
    if (gesture.scene.model) replica_.emplace(gesture.scene.model, gesture.thinned, gesture.rate_hz);
  }
  void feed(const GestureSample& sample) {
    gesture_.trace.push(replica_ ? replica_->feed(sample) : momentOfSample(sample, gesture_.rate_hz));
  }
  void noteGap() {
    if (replica_) replica_->noteGap();
  }
  void takeCuts(const CutSnapshot& cuts) {
    if (replica_) replica_->takeCuts(cuts);
  }
  void takePaths(ByteView list) {
    if (replica_) replica_->takePaths(list);
  }

 private:
  StoredGesture& gesture_;
  std::optional<GestureReplica> replica_;
};

/// Creates a gesture without samples.
std::shared_ptr<StoredGesture> beginGesture(pb::SessionInfo info, const ScenePreparer& prepare,
                                            std::uint64_t samples) {
  auto gesture = std::make_shared<StoredGesture>();
  gesture->info = std::move(info);
  gesture->id = sessionIdText(gesture->info.description().session_id());
  const double rate_hz = gesture->info.description().rate_hz();
  gesture->rate_hz = rate_hz >= 50 && rate_hz <= 40'000 ? rate_hz : 1000;
  pb::SessionDescription description = gesture->info.description();
  const auto& removed = gesture->info.removed_original();
  gesture->thinned = removed.fate() == pb::RemovedOriginal::THINNED;
  double sample_rate_hz = gesture->rate_hz;
  if (gesture->thinned) {
    if (removed.thinned_rate_hz() > 0) sample_rate_hz = std::min(removed.thinned_rate_hz(), gesture->rate_hz);
    gesture->ticks_per_sample = gesture->rate_hz / sample_rate_hz;
    // the engine's lowest rate
    description.set_rate_hz(std::max(50.0, sample_rate_hz));
    gesture->notes.push_back("thinned recording: " + printable(removed.reason()));
  }
  gesture->scene = sceneOfSession(description, prepare);
  if (!gesture->scene.why.empty()) gesture->notes.push_back(printable(gesture->scene.why));
  // Ticks can be missing, so reserve twice the samples' duration.
  const double span_s =
      2 * static_cast<double>(std::min<std::uint64_t>(samples, kMaxLoadedSamples)) / sample_rate_hz;
  gesture->trace = traceOf(gesture->scene, std::max(10.0, span_s), gesture->ticks_per_sample);
  return gesture;
}

/// Remarks and syringe events on the time line.
void addEvents(StoredGesture& gesture) {
  for (const pb::Annotation& annotation : gesture.annotations) {
    TraceEvent event;
    event.kind = TraceEvent::Kind::kRemark;
    event.time_s = gesture.timeOfTick(annotation.tick());
    event.text = printable(annotation.author()) + ": " + printable(annotation.text());
    gesture.trace.add(std::move(event));
  }
}

/// Whether the score was computed with today's plan.
enum class PlanInScore : std::uint8_t {
  kUnknown,  ///< cannot tell: the tip was never in tissue, or the score covers more samples than were loaded
  kSame,     ///< its greatest distance from the planned line matches today's plan
  kOther,    ///< it does not match
  kNone,     ///< the gesture was scored without a plan
};

PlanInScore planInScore(const StoredGesture& gesture, const std::vector<Measure>& measures) {
  constexpr double kSame_m = 1e-4;
  std::vector<GestureSample> storage;
  std::optional<double> largest_m;
  for (const GestureSample& s : cleaned(gesture.samples, storage)) {
    if (isInside(s))
      largest_m = std::max(largest_m.value_or(0),
                           distanceFrom(*gesture.plan_W, {s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]}));
  }
  if (!largest_m) return PlanInScore::kUnknown;
  const auto scored = std::find_if(measures.begin(), measures.end(), [](const Measure& row) {
    return roleOf(row.name) == MeasureRole::kPlannedLine;
  });
  if (scored == measures.end()) return PlanInScore::kNone;
  const bool whole = !gesture.thinned && gesture.samples.size() == gesture.info.samples();
  if (!scored->measured || !whole) return PlanInScore::kUnknown;
  return std::abs(*largest_m - scored->value) > kSame_m ? PlanInScore::kOther : PlanInScore::kSame;
}

class Loader {
 public:
  Loader(const LabCall& call, std::string id, LoadProgress* progress)
      : call_(call), id_(std::move(id)), progress_(progress) {}

  Result<std::shared_ptr<const StoredGesture>> run(const ScenePreparer& prepare) {
    pb::Request get;
    get.mutable_get_session()->set_session_id(id_);
    ASSIGN_OR_RETURN(auto info, call_(get));
    if (info.session().removed_original().fate() == pb::RemovedOriginal::DELETED)
      return Error{ErrorCode::kNotFound, "its recording was deleted by retention: " +
                                             printable(info.session().removed_original().reason())};
    const std::uint64_t samples = info.session().samples();
    gesture_ = beginGesture(std::move(*info.mutable_session()), prepare, samples);
    if (progress_ != nullptr) progress_->chunks = gesture_->info.chunks();
    RETURN_IF_ERROR(readSamples());
    RETURN_IF_ERROR(readAnnotations());
    RETURN_IF_ERROR(readEvents());
    readExercise();
    readScore();
    addEvents(*gesture_);
    return std::shared_ptr<const StoredGesture>(std::move(gesture_));
  }

 private:
  Status readSamples() {
    TraceMaker maker(*gesture_);
    gesture_->samples.reserve(std::min<std::size_t>(gesture_->info.samples(), kMaxLoadedSamples));
    for (std::uint64_t next = 0; next < gesture_->info.chunks();) {
      if (progress_ != nullptr && progress_->stop) return Error{ErrorCode::kFailed, "stopped"};
      pb::Request request;
      request.mutable_read_chunks()->set_session_id(id_);
      request.mutable_read_chunks()->set_from_seq(next);
      request.mutable_read_chunks()->set_max_chunks(kChunksAtOnce);
      request.mutable_read_chunks()->set_skip_damaged(true);
      request.mutable_read_chunks()->set_hash(gesture_->info.hash());
      ASSIGN_OR_RETURN(const auto reply, call_(request));
      const pb::Chunks& chunks = reply.chunks();
      for (const auto& damaged : chunks.damaged()) note("damaged, omitted: " + printable(damaged.text()));
      for (const pb::Chunk& chunk : chunks.chunks()) {
        if (chunk.seq() != expected_seq_) maker.noteGap();
        expected_seq_ = chunk.seq() + 1;
        RETURN_IF_ERROR(take(chunk, maker));
      }
      const std::uint64_t behind =
          std::max(chunks.next_seq(), next + static_cast<std::uint64_t>(chunks.chunks_size()));
      if (progress_ != nullptr) progress_->chunks_read = behind;
      if (behind == next || chunks.end() || full_) break;
      next = behind;
    }
    return {};
  }

  Status take(const pb::Chunk& chunk, TraceMaker& maker) {
    auto samples = decodeChunk(viewOf(chunk.data()));
    if (!samples.ok()) {
      note(fmt::format("chunk {} left out: {}", chunk.seq(), samples.error().message));
      maker.noteGap();
      return {};
    }
    const auto cuts = cutsIn(cutMemoryOf(viewOf(chunk.data())));
    maker.takePaths(pathListOf(viewOf(chunk.data())));
    for (const GestureSample& sample : *samples) {
      if (gesture_->samples.size() >= kMaxLoadedSamples) {
        if (!std::exchange(full_, true))
          note(fmt::format("only the first {} samples are shown", kMaxLoadedSamples));
        return {};
      }
      // Ticks ascend in a station's recording, but hostile data may violate that.
      if (!gesture_->samples.empty() && sample.tick <= gesture_->samples.back().tick) continue;
      gesture_->samples.push_back(sample);
      maker.feed(sample);
      if (cuts && sample.tick == cuts->tick) maker.takeCuts(*cuts);
    }
    return {};
  }

  Status readAnnotations() {
    ASSIGN_OR_RETURN(gesture_->annotations, readRemarks(call_, id_));
    return {};
  }

  Status readEvents() {
    if (gesture_->info.state() == pb::SESSION_OPEN) return {};  // only closed sessions have events
    pb::Request request;
    request.mutable_list_events()->set_session_id(id_);
    const auto reply = call_(request);
    if (!reply.ok()) {
      // a session without a readable profile has no events, but its samples are still usable
      note("aspirations and injections: " + printable(reply.error().message));
      return {};
    }
    gesture_->events.assign(reply->events().events().begin(), reply->events().events().end());
    return {};
  }

  void readExercise() {
    const std::string& exercise_id = gesture_->info.description().exercise_id();
    if (exercise_id.empty()) return;
    const auto exercise = findExercise(call_, exercise_id);
    if (!exercise.ok()) return note("the exercise's plan: " + printable(exercise.error().message));
    if (!*exercise) return;
    gesture_->exercise_name = printable((*exercise)->name());
    // Without a scene the plan's position in W is unknown; a note says why.
    if (!gesture_->scene.view) return;
    gesture_->plan_W = planOn(*gesture_->scene.view, **exercise);
    if ((*exercise)->has_plan() && !gesture_->plan_W)
      note("the exercise now has another patient: no planned line is shown");
  }

  /// Without a score the plots have no limits; the score screen says why.
  void readScore() {
    const auto measures = scoredMeasures();
    if (measures) gesture_->requirements = requirementsOf(*measures);
    if (gesture_->plan_W) judgePlan(measures ? planInScore(*gesture_, *measures) : PlanInScore::kUnknown);
  }

  /// Measures of the newest score; nullopt without one.
  std::optional<std::vector<Measure>> scoredMeasures() {
    if (gesture_->info.state() == pb::SESSION_OPEN) return std::nullopt;
    pb::Request request;
    request.mutable_get_score()->set_session_id(id_);
    const auto reply = call_(request);
    if (!reply.ok()) return std::nullopt;
    auto measures = parseScore(reply->score().measures_json());
    return measures.ok() ? std::optional(*std::move(measures)) : std::nullopt;
  }

  void judgePlan(PlanInScore judged) {
    switch (judged) {
      case PlanInScore::kSame:
        return;
      case PlanInScore::kUnknown:
        return note("the planned line is the exercise's current one");
      case PlanInScore::kOther:
        return note(
            "the exercise's plan was changed after this session was scored: its score uses the plan of "
            "that time");
      case PlanInScore::kNone:
        gesture_->plan_W.reset();
        return note("this session was scored without a plan: the exercise's current plan is not shown");
    }
  }

  void note(std::string text) {
    if (gesture_->notes.size() < kNotesKept) gesture_->notes.push_back(std::move(text));
  }

  const LabCall& call_;
  const std::string id_;
  LoadProgress* progress_;
  std::shared_ptr<StoredGesture> gesture_;
  std::uint64_t expected_seq_ = 0;  // next chunk number; a larger one means damaged chunks before it
  bool full_ = false;
};

}  // namespace

std::size_t StoredGesture::sampleAt(double time_s) const {
  const auto after =
      std::upper_bound(samples.begin(), samples.end(), time_s,
                       [&](double t, const GestureSample& s) { return t < timeOfTick(s.tick); });
  return after == samples.begin() ? 0 : static_cast<std::size_t>(after - samples.begin()) - 1;
}

std::optional<PlanView> StoredGesture::planView() const {
  if (!plan_W || !scene.view) return std::nullopt;
  return planViewOf(*scene.view, *plan_W);
}

std::string StoredGesture::title() const {
  const auto& d = info.description();
  const std::string exercise = exercise_name.empty() ? printable(d.exercise_id()) : exercise_name;
  return printable(traineeName(d)) + ", " + exercise + ", " +
         localTime(d.started_unix_ns(), TimeForm::kMinute);
}

Result<std::vector<pb::Annotation>> readRemarks(const LabCall& call, const std::string& session_id) {
  constexpr std::size_t kMaxRemarks = 10'000;
  std::vector<pb::Annotation> remarks;
  std::string page;
  do {
    pb::Request request;
    request.mutable_list_annotations()->set_session_id(session_id);
    request.mutable_list_annotations()->set_page(page);
    ASSIGN_OR_RETURN(const auto reply, call(request));
    const auto& list = reply.annotations();
    remarks.insert(remarks.end(), list.annotations().begin(), list.annotations().end());
    page = list.next_page();
  } while (!page.empty() && remarks.size() < kMaxRemarks);
  std::stable_sort(remarks.begin(), remarks.end(),
                   [](const auto& a, const auto& b) { return a.tick() < b.tick(); });
  return remarks;
}

Result<std::optional<pb::Exercise>> findExercise(const LabCall& call, const std::string& exercise_id) {
  constexpr int kMaxPages = 1000;
  std::string page;
  for (int i = 0; i < kMaxPages; ++i) {
    pb::Request request;
    request.mutable_list_exercises()->set_page(page);
    ASSIGN_OR_RETURN(const auto reply, call(request));
    for (const auto& row : reply.exercises().exercises()) {
      auto exercise = parseExercise(row.json(), "exercise");
      if (exercise.ok() && exercise->id() == exercise_id) return std::optional(*std::move(exercise));
    }
    page = reply.exercises().next_page();
    if (page.empty()) break;
  }
  return std::optional<pb::Exercise>();
}

Result<std::shared_ptr<const StoredGesture>> loadGesture(const LabCall& call, const std::string& session_id,
                                                         const ScenePreparer& prepare,
                                                         LoadProgress* progress) {
  return Loader(call, session_id, progress).run(prepare);
}

std::shared_ptr<const StoredGesture> gestureOf(pb::SessionInfo info, std::vector<GestureSample> samples,
                                               const ScenePreparer& prepare, const pb::Exercise* exercise) {
  auto gesture = beginGesture(std::move(info), prepare, samples.size());
  if (exercise != nullptr && gesture->scene.view) gesture->plan_W = planOn(*gesture->scene.view, *exercise);
  gesture->samples = std::move(samples);
  TraceMaker maker(*gesture);
  for (const GestureSample& sample : gesture->samples) maker.feed(sample);
  return gesture;
}

}  // namespace needlelab
