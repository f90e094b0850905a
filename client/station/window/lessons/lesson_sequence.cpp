#include "client/station/window/lessons/lesson_sequence.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "client/device/hand/hand_options.h"
#include "client/net/spool/lesson_cache.h"
#include "client/station/run/io/live_line.h"
#include "client/station/run/io/terminal.h"
#include "client/station/run/lesson/trainee_code.h"
#include "client/station/run/loop/signals.h"
#include "client/station/window/lessons/start_choice.h"
#include "common/base/program.h"
#include "common/base/secret.h"
#include "common/base/text/plain_words.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

constexpr auto kLook = 100ms;
constexpr std::int64_t kDeviceRetry_ns = 5'000'000'000, kServerRetry_ns = 500'000'000;
constexpr auto kListsPatience = 5s;
// for others' changes of assignments, people and courses
constexpr std::int64_t kListRefresh_ns = 300'000'000'000;
// Longer: fetching everything takes longer. Shorter: the stations of a lab send more requests at a time.
constexpr std::int64_t kPrefetchPeriod_ns = 1'000'000'000;
// after this time, another person may be at the End screen
constexpr std::int64_t kKeepCode_ns = 120'000'000'000;

}  // namespace

LessonSequence::LessonSequence(const StationOptions& options, const sigset_t& stop_signals,
                               LessonBoard& board, bool alone, bool begins, TimeSource& time)
    : options_(options),
      signals_(stop_signals),
      board_(board),
      alone_(alone),
      begins_(begins),
      time_(time),
      home_(options, board, time) {}

LessonChoice LessonSequence::firstChoice() const {
  return {options_.trainee_given || alone_ || begins_ ? options_.trainee : std::string(), options_.exercise,
          !options_.profile_file.empty()};
}

bool LessonSequence::open() {
  for (const auto step : {&StationHome::openSpool, &StationHome::connect})
    if (const Status status = (home_.*step)(); !status.ok()) {
      logMessage(status.error().message);
      code_ = exitCodeOf(status.error());
      board_.change([&](BoardState& state) {
        state.stage = Stage::kFailed;
        state.trouble = plainWords(printable(status.error().message));
      });
      return false;
    }
  return true;
}

int LessonSequence::run() {
  if (!open()) {
    while (!quit_) {
      quit_ =
          signalWithin(signals_, 0ms) != 0 || board_.waitForRequest(kLook).kind == BoardRequest::Kind::kQuit;
      if (alone_) break;
    }
    return *code_;
  }
  board_.change([&](BoardState& state) { state.choice = firstChoice(); });
  // with a display and without --start, a person chooses first
  if (begins_)
    practise(firstChoice());
  else
    showStart();
  while (!quit_) {
    if (signalWithin(signals_, 0ms) != 0) break;
    updateServer();
    if (Uplink* const uplink = home_.uplink()) uplink->noteHand(requests().handRaised());
    if (last_) showOutcome();
    if (!kept_code_of_.empty() && time_.nowNs() >= keep_code_until_ns_) forgetCode();
    BoardRequest request = board_.waitForRequest(kLook);
    const WipeAtEnd wiped(request.code);
    handle(request);
  }
  board_.change([](BoardState& state) { state.stage = Stage::kClosing; });
  if (last_) {
    last_->drain();
    outcome_ = last_->outcome();
    home_.close();
    reportLast();
  }
  home_.close();
  home_.guard().report();
  return code_.value_or(failed_to_begin_);
}

void LessonSequence::handle(const BoardRequest& request) {
  switch (request.kind) {
    case BoardRequest::Kind::kNothing:
      return;
    case BoardRequest::Kind::kBegin:
      return practise(request.choice, request.code);
    case BoardRequest::Kind::kStart:
      return showStart();
    case BoardRequest::Kind::kLook:
      next_device_look_ns_ = 0;
      return refreshLists(request.choice.trainee);
    case BoardRequest::Kind::kTrainee:
      return updateStanding(request.choice.trainee);
    case BoardRequest::Kind::kQuit:
      quit_ = true;
      return;
  }
}

void LessonSequence::forgetCode() {
  wipe(kept_code_);
  kept_code_of_.clear();
}

void LessonSequence::showStart() {
  reportLast();
  forgetCode();  // the next person at the Start screen may be somebody else
  StartLists lists = localLists(options_, home_.spool());
  std::string trainee;
  board_.change([&](BoardState& state) {
    const bool practised = state.stage == Stage::kEnd;
    state.stage = Stage::kStart;
    // keeps the server's last lists until new ones arrive
    if (state.lists.exercises.empty()) state.lists = std::move(lists);
    // after a lesson, selects the ladder's next step, if there is one
    trainee = state.choice.trainee;
    if (practised && state.lists.curriculum && state.lists.curriculum->standings.contains(trainee))
      state.choice.exercise.clear();
    if (state.next) state.choice.exercise = state.next->exercise;
    if (state.next) state.choice.by_profile = false;
  });
  refreshLists(trainee);
  updateDevice();
}

// a person's request interrupts the wait for the answer
Result<pb::Reply> LessonSequence::requestLists(Uplink& uplink, pb::Request request) {
  return uplink.ask(std::move(request), kListsPatience, true, [this] { return board_.requestWaits(); });
}

void LessonSequence::refreshLists(const std::string& trainee) {
  prefetch();
  list_refresh_ns_ = time_.nowNs() + kListRefresh_ns;
  StartLists lists = localLists(options_, home_.spool());
  if (Uplink* uplink = home_.uplink()) {
    const auto cached = LessonCache(options_.spool).list();
    const Status status = addServerLists(
        lists, cached, trainee,
        [&](pb::Request request) { return requestLists(*uplink, std::move(request)); }, wallNowNs());
    keepCurriculum(status, lists);
  }
  board_.change([&](BoardState& state) { state.lists = std::move(lists); });
}

void LessonSequence::updateStanding(const std::string& trainee) {
  Uplink* const uplink = home_.uplink();
  if (uplink == nullptr) return;
  StartLists lists;
  board_.change([&](const BoardState& state) { lists = state.lists; });
  const Status status = addStanding(
      lists, trainee, [&](pb::Request request) { return requestLists(*uplink, std::move(request)); },
      wallNowNs());
  keepCurriculum(status, lists);
  if (status.ok()) board_.change([&](BoardState& state) { state.lists = std::move(lists); });
}

// for times when the server is away
void LessonSequence::keepCurriculum(Status asked, const StartLists& lists) {
  if (asked.ok() && lists.curriculum)
    asked = CurriculumCache(options_.spool, options_.key_file).keep(*lists.curriculum);
  reportTrouble(asked);
}

StartLists LessonSequence::listsNow() const {
  BoardState state;
  std::uint64_t seen = 0;
  board_.look(state, seen);
  return std::move(state.lists);
}

// fetches one of the things that lessons need without the server
void LessonSequence::fetchAhead() {
  Uplink& uplink = *home_.uplink();
  StartLists lists = listsNow();
  const auto fetched = ahead_.step(
      lists, [&](pb::Request request) { return requestLists(uplink, std::move(request)); }, wallNowNs());
  if (!fetched.ok()) return reportTrouble(fetched.error());
  if (*fetched) board_.change([&](BoardState& state) { state.lists = std::move(lists); });
}

void LessonSequence::prefetch() {
  reportTrouble(ahead_.keep(listsNow(), wallNowNs()));
}

void LessonSequence::reportTrouble(const Status& asked) const {
  if (asked.ok()) return;
  // the server is away or refuses the station; the screen shows that
  const ErrorCode code = asked.error().code;
  const bool expected =
      code == ErrorCode::kUnavailable || code == ErrorCode::kFailed || code == ErrorCode::kDenied;
  if (!expected) logMessage(asked.error().message);
}

void LessonSequence::updateDevice() {
  const DeviceReadiness news = deviceReadiness(options_, options_.hand.plan == kPointerPlan, hangs_);
  device_ready_ = news.ready;
  next_device_look_ns_ = time_.nowNs() + kDeviceRetry_ns;
  board_.change([&](BoardState& state) { state.device = news; });
}

// between lessons: checks the server, its exercises, and the device
void LessonSequence::updateServer() {
  const std::int64_t now_ns = time_.nowNs();
  if (now_ns < next_server_look_ns_) return;
  next_server_look_ns_ = now_ns + kServerRetry_ns;
  home_.guard().check();
  bool at_start = false;
  std::string trainee;
  board_.change([&](BoardState& state) {
    at_start = state.stage == Stage::kStart;
    trainee = state.choice.trainee;
    if (Uplink* uplink = home_.uplink()) {
      const UplinkState now = uplink->state();
      state.server = serverText(now);
      state.server_away = !now.connected;
    }
  });
  Uplink* const uplink = home_.uplink();
  const std::string status = uplink == nullptr ? "" : uplink->state().connected ? "there" : "away";
  if (at_start && status != lists_made_with_) {
    lists_made_with_ = status;
    if (status == "there") refreshLists(trainee);
  }
  if (at_start && status == "there") {
    if (now_ns >= list_refresh_ns_) refreshLists(trainee);
    if (now_ns >= next_ahead_ns_) {
      next_ahead_ns_ = now_ns + kPrefetchPeriod_ns;
      fetchAhead();
    }
  }
  if (at_start && !device_ready_ && now_ns >= next_device_look_ns_) updateDevice();
}

void LessonSequence::practise(const LessonChoice& choice, const std::string& typed_code) {
  reportLast();
  prefetch();
  StationOptions options = options_;
  options.trainee = choice.trainee.empty() && !home_.uplink() ? std::string(kGuestName) : choice.trainee;
  options.exercise = choice.by_profile ? "" : choice.exercise;
  if (!choice.by_profile) options.profile_file.clear();
  board_.change([&](BoardState& state) {
    state.stage = Stage::kPreparing;
    state.preparing.clear();
    state.trouble.clear();
    state.code_question.reset();
    state.choice = choice;
    if (state.next && state.next->exercise == choice.exercise) state.next.reset();
  });
  if (options.trainee != kept_code_of_ || time_.nowNs() >= keep_code_until_ns_) forgetCode();
  std::string code = typed_code.empty() ? kept_code_ : typed_code;
  const bool code_kept = typed_code.empty() && !code.empty();
  const WipeAtEnd wiped(code);
  last_ = std::make_unique<StationRun>(home_, options, signals_, GivenCode{code, {}});
  const auto prepared = [&]() -> Status {
    RETURN_IF_ERROR(checkName("trainee", options.trainee));
    if (options.exercise.empty() && options.profile_file.empty())
      return Error{ErrorCode::kInvalidInput, "choose an exercise"};
    return last_->prepare();
  }();
  if (!prepared.ok()) {
    quit_ = last_->interrupted();
    last_.reset();
    cannotBegin(prepared.error(), choice, !typed_code.empty(), code_kept);
    return showStart();
  }
  // the server may be away; then its earlier acceptance still holds
  if (last_->codeChecked()) {
    forgetCode();
    kept_code_ = code;
    kept_code_of_ = options.trainee;
  }
  static_cast<void>(last_->practise());
  outcome_ = last_->outcome();
  keep_code_until_ns_ = time_.nowNs() + kKeepCode_ns;
  drain_until_ns_ = time_.nowNs() + std::llround(options_.drain_s * 1e9);
  quit_ = last_->interrupted();
  board_.change([&](BoardState& state) {
    state.stage = Stage::kEnd;
    state.outcome = std::make_shared<const LessonOutcome>(*outcome_);
  });
}

void LessonSequence::cannotBegin(const Error& error, const LessonChoice& choice, bool code_typed,
                                 bool code_kept) {
  logMessage(error.message);
  // the window asks the person, who has done nothing wrong
  if (error.code == ErrorCode::kCode && !alone_) {
    // the refused code was kept from the last lesson, not typed
    const std::string before =
        code_kept ? choice.trainee + "'s code from the last lesson no longer works; type the current one. "
                  : "";
    const CodeQuestion question{choice.trainee, printable(before + error.message), code_typed,
                                ++code_questions_};
    return board_.change([&](BoardState& state) { state.code_question = question; });
  }
  failed_to_begin_ = exitCodeOf(error);
  board_.change([&](BoardState& state) { state.trouble = plainWords(printable(error.message)); });
}

// shows the outcome until the server's verdict arrives or the wait ends
void LessonSequence::showOutcome() {
  const Uplink* const uplink = home_.uplink();
  if (uplink == nullptr) return reportLast();
  const UplinkState now = uplink->state();
  if (now.current_verdict || !now.current_trouble.empty()) {
    outcome_ = last_->outcome();
    board_.change(
        [&](BoardState& state) { state.outcome = std::make_shared<const LessonOutcome>(*outcome_); });
    return reportLast();
  }
  if (time_.nowNs() >= drain_until_ns_) reportLast();
}

void LessonSequence::reportLast() {
  if (!last_) return;
  code_ = std::max(code_.value_or(kExitDone), last_->report(*outcome_, earlier_));
  earlier_.push_back(outcome_->summary);
  last_.reset();
}

}  // namespace needlelab
