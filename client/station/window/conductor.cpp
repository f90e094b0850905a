#include "client/station/window/conductor.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "client/device/hand_plan_choice.h"
#include "client/net/lesson_cache.h"
#include "client/station/run/live_view.h"
#include "client/station/run/say.h"
#include "client/station/run/signals.h"
#include "client/station/window/offers.h"
#include "common/base/clock.h"
#include "common/base/program.h"
#include "common/base/text.h"

namespace needlelab {

using namespace std::chrono_literals;

namespace {

constexpr auto kLook = 100ms;
constexpr std::int64_t kDeviceAgain_ns = 5'000'000'000, kServerAgain_ns = 500'000'000;
constexpr auto kOffersPatience = 5s;

}  // namespace

Conductor::Conductor(const StationOptions& options, const sigset_t& stop_signals, LessonBoard& board,
                     bool alone, bool begins)
    : options_(options),
      signals_(stop_signals),
      board_(board),
      alone_(alone),
      begins_(begins),
      home_(options, board) {}

LessonChoice Conductor::firstChoice() const {
  return {options_.trainee_given || alone_ || begins_ ? options_.trainee : std::string(), options_.exercise,
          !options_.profile_file.empty()};
}

bool Conductor::open() {
  for (const auto step : {&StationHome::openSpool, &StationHome::connect})
    if (const Status status = (home_.*step)(); !status.ok()) {
      say(status.error().message);
      code_ = exitCodeOf(status.error());
      board_.change([&](BoardState& state) {
        state.stage = Stage::kFailed;
        state.trouble = printable(status.error().message);
      });
      return false;
    }
  return true;
}

int Conductor::run() {
  if (!open()) {
    while (!quit_) {
      quit_ = signalWithin(signals_, 0ms) != 0 || board_.waitForWish(kLook).kind == BoardWish::Kind::kQuit;
      if (alone_) break;
    }
    return *code_;
  }
  board_.change([&](BoardState& state) { state.choice = firstChoice(); });
  // with a display, and nobody in a hurry, a person chooses first
  if (begins_)
    practise(firstChoice());
  else
    showStart();
  while (!quit_) {
    if (signalWithin(signals_, 0ms) != 0) break;
    lookAtServer();
    if (last_) showOutcome();
    serve(board_.waitForWish(kLook));
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

void Conductor::serve(const BoardWish& wish) {
  switch (wish.kind) {
    case BoardWish::Kind::kNothing:
      return;
    case BoardWish::Kind::kBegin:
      return practise(wish.choice);
    case BoardWish::Kind::kStart:
      return showStart();
    case BoardWish::Kind::kLook:
      next_device_look_ns_ = 0;
      return refreshOffers();
    case BoardWish::Kind::kQuit:
      quit_ = true;
      return;
  }
}

void Conductor::showStart() {
  reportLast();
  LessonOffers offers = offersHere(options_, home_.spool());
  board_.change([&](BoardState& state) {
    state.stage = Stage::kStart;
    // what the server said before stays until it says more
    if (state.offers.exercises.empty()) state.offers = std::move(offers);
    if (state.next) state.choice.exercise = state.next->exercise;
    if (state.next) state.choice.by_profile = false;
  });
  refreshOffers();
  lookAtDevice();
}

void Conductor::refreshOffers() {
  LessonOffers offers = offersHere(options_, home_.spool());
  if (Uplink* uplink = home_.uplink()) {
    const auto cached = LessonCache(options_.spool).list();
    // a person who has chosen does not wait for a list
    const auto ask = [&](pb::Request request) {
      return uplink->ask(std::move(request), kOffersPatience, true, [&] { return board_.wishWaits(); });
    };
    if (const Status status = addServersOffers(offers, cached, ask); !status.ok()) {
      const bool away =
          status.error().code == ErrorCode::kUnavailable || status.error().code == ErrorCode::kFailed;
      if (!away) say(status.error().message);
    }
  }
  board_.change([&](BoardState& state) { state.offers = std::move(offers); });
}

void Conductor::lookAtDevice() {
  const DeviceNews news = deviceNews(options_, options_.hand.plan == kPointerPlan, hangs_);
  device_ready_ = news.ready;
  next_device_look_ns_ = steadyNowNs() + kDeviceAgain_ns;
  board_.change([&](BoardState& state) { state.device = news; });
}

// between lessons: is the server there, and what does it offer; does the device come up
void Conductor::lookAtServer() {
  const std::int64_t now_ns = steadyNowNs();
  if (now_ns < next_server_look_ns_) return;
  next_server_look_ns_ = now_ns + kServerAgain_ns;
  home_.guard().check();
  bool at_start = false;
  board_.change([&](BoardState& state) {
    at_start = state.stage == Stage::kStart;
    if (Uplink* uplink = home_.uplink()) {
      const UplinkState now = uplink->state();
      state.server = serverText(now);
      state.server_away = !now.connected;
    }
  });
  Uplink* const uplink = home_.uplink();
  const std::string standing = uplink == nullptr ? "" : uplink->state().connected ? "there" : "away";
  if (at_start && standing != offers_of_) {
    offers_of_ = standing;
    if (standing == "there") refreshOffers();
  }
  if (at_start && !device_ready_ && now_ns >= next_device_look_ns_) lookAtDevice();
}

void Conductor::practise(const LessonChoice& choice) {
  reportLast();
  StationOptions options = options_;
  options.trainee = choice.trainee.empty() && !home_.uplink() ? "guest" : choice.trainee;
  options.exercise = choice.by_profile ? "" : choice.exercise;
  if (!choice.by_profile) options.profile_file.clear();
  board_.change([&](BoardState& state) {
    state.stage = Stage::kPreparing;
    state.preparing.clear();
    state.trouble.clear();
    state.choice = choice;
    if (state.next && state.next->exercise == choice.exercise) state.next.reset();
  });
  last_ = std::make_unique<StationRun>(home_, options, signals_);
  const auto prepared = [&]() -> Status {
    if (auto valid = checkName("trainee", options.trainee); !valid.ok()) return valid;
    if (options.exercise.empty() && options.profile_file.empty())
      return Error{ErrorCode::kInvalidInput, "choose an exercise"};
    return last_->prepare();
  }();
  if (!prepared.ok()) {
    quit_ = last_->interrupted();
    last_.reset();
    say(prepared.error().message);
    failed_to_begin_ = exitCodeOf(prepared.error());
    board_.change([&](BoardState& state) { state.trouble = printable(prepared.error().message); });
    return showStart();
  }
  static_cast<void>(last_->practise());
  outcome_ = last_->outcome();
  drain_until_ns_ = steadyNowNs() + std::llround(options_.drain_s * 1e9);
  quit_ = last_->interrupted();
  board_.change([&](BoardState& state) {
    state.stage = Stage::kEnd;
    state.outcome = std::make_shared<const LessonOutcome>(*outcome_);
  });
}

// until the server's word is there, or one does not wait for it any more
void Conductor::showOutcome() {
  const Uplink* const uplink = home_.uplink();
  if (uplink == nullptr) return reportLast();
  const UplinkState now = uplink->state();
  if (now.current_verdict || !now.current_trouble.empty()) {
    outcome_ = last_->outcome();
    board_.change(
        [&](BoardState& state) { state.outcome = std::make_shared<const LessonOutcome>(*outcome_); });
    return reportLast();
  }
  if (steadyNowNs() >= drain_until_ns_) reportLast();
}

void Conductor::reportLast() {
  if (!last_) return;
  code_ = std::max(code_.value_or(kExitDone), last_->report(*outcome_, earlier_));
  earlier_.push_back(outcome_->summary);
  last_.reset();
}

}  // namespace needlelab
