#include "tests/windows/script/script_runner.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/core.h>

namespace needlelab {
namespace {

Error wrong(std::string words) {
  return {ErrorCode::kFailed, std::move(words)};
}

double number(const ScriptAction& action, std::size_t i = 0) {
  return *numberOf(action.words[i]);
}

constexpr std::array<std::pair<std::string_view, WindowScreen>, 3> kScreenVerbs = {
    {{"lab", WindowScreen::kLab}, {"sessions", WindowScreen::kSessions}, {"scores", WindowScreen::kScores}}};

}  // namespace

ScriptRunner::ScriptRunner(std::vector<ScriptAction> actions, std::string name,
                           std::function<void(const std::string&)> print)
    : actions_(std::move(actions)), name_(std::move(name)), print_(std::move(print)) {}

void ScriptRunner::fail(const ScriptAction& action, const std::string& why) {
  std::string line = action.verb;
  for (const std::string& word : action.words) line += " \"" + word + "\"";
  status_ = Error{ErrorCode::kFailed, fmt::format("{}:{}: {}: {}", name_, action.line, line, why)};
  over_ = true;
}

void ScriptRunner::afterFrame(InstructorWindow& window) {
  const double cost_s = window.surface().frameCost_s();
  ++frame_count_;
  frame_cost_s_ += cost_s;
  frame_most_s_ = std::max(frame_most_s_, cost_s);
  if (over_) return;
  if (next_ >= actions_.size()) {
    over_ = true;
    return;
  }
  const ScriptAction& action = actions_[next_];
  const double now_s = window.lab().now_s();
  const bool first = !std::exchange(begun_, true);
  if (first) {
    began_s_ = now_s;
    frames_ = 0;
  }
  ++frames_;
  const auto done = act(action, window, first);
  if (!done.ok()) return fail(action, done.error().message);
  if (*done) {
    begun_ = false;
    ++next_;
    return;
  }
  if (now_s - began_s_ > patience_s_ && action.verb != "wait")
    fail(action,
         fmt::format("not so within {:g} s; the screen says: ", patience_s_) + window.text().substr(0, 600));
}

Result<bool> ScriptRunner::act(const ScriptAction& action, InstructorWindow& window, bool first) {
  for (const auto part : {&ScriptRunner::actOnLink, &ScriptRunner::actOnLab, &ScriptRunner::actOnStation,
                          &ScriptRunner::actOnAnalysis, &ScriptRunner::actOnWindow}) {
    const auto done = (this->*part)(action, window, first);
    // kNotFound: this function does not handle the verb
    if (done.ok() || done.error().code != ErrorCode::kNotFound) return done;
  }
  return wrong("this window cannot do that");
}

Result<bool> ScriptRunner::actOnLink(const ScriptAction& action, InstructorWindow& window, bool first) {
  LabState& lab = window.lab();
  const std::string& verb = action.verb;
  if (verb == "login") {
    if (first && !lab.inside()) lab.logIn();
    if (!lab.form_trouble.empty()) return wrong(lab.form_trouble);
    if (lab.link().phase == LinkPhase::kRefused)
      return wrong(lab.link().trouble.what + " " + lab.link().trouble.detail);
    return lab.link().phase == LinkPhase::kOnline && lab.inside();
  }
  if (verb == "logout") {
    lab.logOut();
    return true;
  }
  if (verb == "wait") return lab.now_s() - began_s_ >= number(action);
  if (verb == "timeout") {
    patience_s_ = number(action);
    return true;
  }
  return Error{ErrorCode::kNotFound, {}};
}

Result<bool> ScriptRunner::actOnLab(const ScriptAction& action, InstructorWindow& window, bool) {
  LabState& lab = window.lab();
  const std::string& verb = action.verb;
  for (const auto& [name, screen] : kScreenVerbs) {
    if (verb != name) continue;
    lab.screen = screen;
    return true;
  }
  if (verb == "wait-station") {
    const StationTile* const tile = lab.overview.find(action.words[0]);
    if (tile == nullptr) return false;
    const std::string state = action.words.size() > 1 ? action.words[1] : "online";
    if (state == "online") return tile->online && !tile->stale;
    if (state == "offline") return !tile->online;
    if (state == "lesson") return tile->online && !tile->session_id.empty();
    if (state == "help") return needsHelp(tile->need);
    return wrong("a station is online, offline, in a lesson, or needs help; not '" + state + "'");
  }
  if (verb == "filter") {
    const std::string& what = action.words[0];
    lab.filter = {};
    if (what == "online")
      lab.filter.only_online = true;
    else if (what != "all")
      lab.filter.text = what;
    lab.screen = WindowScreen::kLab;
    return true;
  }
  if (verb == "open-first") {
    const auto calls = lab.overview.calls().open(lab.now_s());
    const auto tiles = lab.overview.tiles(lab.filter);
    if (calls.empty() && tiles.empty()) return false;
    lab.open(std::string(calls.empty() ? tiles.front()->station : calls.front()->station));
    return true;
  }
  if (verb == "open") {
    if (lab.live() == nullptr || lab.live()->station() != action.words[1] ||
        lab.screen != WindowScreen::kLive) {
      if (lab.overview.find(action.words[1]) == nullptr) return false;
      lab.open(action.words[1]);
    }
    return true;
  }
  return Error{ErrorCode::kNotFound, {}};
}

Result<bool> ScriptRunner::answered(LabState& lab) const {
  if (lab.commands.waiting() > 0) return false;
  if (!lab.notices.all().empty() && lab.notices.all().back().condition == Condition::kTrouble)
    return wrong(lab.notices.all().back().text);
  return true;
}

Result<bool> ScriptRunner::actOnStation(const ScriptAction& action, InstructorWindow& window, bool first) {
  LabState& lab = window.lab();
  const std::string& verb = action.verb;
  const bool in_replay = lab.screen == WindowScreen::kReplay;
  LiveStation* const live = lab.live();
  if (verb == "annotate") {
    if (first) lab.annotate(action.words[0]);
    return answered(lab);
  }
  if (verb == "pause" || verb == "resume") {
    if (in_replay) {
      verb == "pause" ? lab.analysis.player.pause() : lab.analysis.player.play();
      return true;
    }
    if (live == nullptr) return wrong("no station is being watched: open one first");
    if (live->trace().empty()) return false;
    verb == "pause" ? live->pause() : live->resume();
    return true;
  }
  constexpr std::array<std::string_view, 6> kLiveVerbs = {"wait-live",     "scroll-back", "message",
                                                          "next-exercise", "aids",        "stop-lesson"};
  if (std::find(kLiveVerbs.begin(), kLiveVerbs.end(), verb) == kLiveVerbs.end())
    return Error{ErrorCode::kNotFound, {}};
  if (live == nullptr) return wrong("no station is being watched: open one first");
  if (verb == "wait-live") {
    const std::size_t shown = live->latency().count();
    if (first) live_before_ = shown;
    return static_cast<double>(shown - std::min(shown, live_before_)) >= number(action);
  }
  if (verb == "scroll-back") {
    if (live->trace().lastTime_s() - live->trace().firstTime_s() < number(action)) return false;
    live->scrollTo(live->trace().lastTime_s() - number(action));
    return true;
  }
  if (first && verb == "message") lab.commands.message(lab.commanded(), action.words[0]);
  if (first && verb == "next-exercise")
    lab.commands.nextExercise(lab.commanded(), action.words[0], lab.exerciseName(action.words[0]));
  if (first && verb == "stop-lesson")
    lab.commands.stopLessons(lab.commanded(), action.words.empty() ? "" : action.words[0]);
  if (first && verb == "aids") {
    if (action.words[0] == "reset") {
      lab.resetAids();
    } else {
      ASSIGN_OR_RETURN(const auto aids, parseAids(action.words[0]));
      lab.setAids(aids);
    }
  }
  return answered(lab);
}

Result<bool> ScriptRunner::worked(LabState& lab) const {
  if (lab.analysis.busy()) return false;
  if (!lab.analysis.trouble().empty()) return wrong(lab.analysis.trouble());
  return true;
}

Result<bool> ScriptRunner::actOnAnalysis(const ScriptAction& action, InstructorWindow& window, bool first) {
  LabState& lab = window.lab();
  const std::string& verb = action.verb;
  if (verb == "search") {
    if (first) {
      lab.screen = WindowScreen::kSessions;
      window.sessions_screen.query = {};
      window.sessions_screen.query.search = action.words[0];
      lab.sessions.search(window.sessions_screen.query);
    }
    if (!lab.sessions.trouble().empty()) return wrong(lab.sessions.trouble());
    return !lab.sessions.waiting();
  }
  if (verb == "replay") {
    if (first) {
      lab.analysis.loadFirst(action.words.back());
      lab.screen = WindowScreen::kReplay;
    }
    return worked(lab);
  }
  if (verb == "compare") {
    if (first) {
      const std::string how = action.words.size() > 2 ? action.words[2] : "depth";
      lab.analysis.loadBoth(action.words[0], action.words[1],
                            how == "dtw"    ? Alignment::kDtw
                            : how == "time" ? Alignment::kTime
                                            : Alignment::kDepth);
      lab.screen = WindowScreen::kCompare;
    }
    return worked(lab);
  }
  if (verb == "rerun") {
    if (first) {
      window.rerun_screen.profile = action.words[0];
      window.rerun_screen.model = action.words.size() > 1 ? action.words[1] : "";
      lab.analysis.rerun(window.rerun_screen.profile, window.rerun_screen.model);
      lab.screen = WindowScreen::kRerun;
    }
    return worked(lab);
  }
  if (verb == "export") {
    if (first) lab.analysis.exportTo(action.words[0]);
    return worked(lab);
  }
  ReplayPlayer& player = lab.analysis.player;
  if (verb == "wait-replay") {
    if (!lab.analysis.first()) return wrong("no session is loaded: replay one first");
    return player.at_s() - player.first_s() >= number(action);
  }
  if (verb == "play")
    player.play();
  else if (verb == "seek")
    player.seek(player.first_s() + number(action));
  else if (verb == "step")
    player.step(static_cast<int>(std::clamp(number(action), -1e6, 1e6)));
  else if (verb == "speed")
    player.setSpeed(number(action));
  else if (verb == "loop" && action.words[0] == "off")
    player.setLoop({});
  else if (verb == "loop")
    player.setLoop(ReplayLoop{player.first_s() + number(action), player.first_s() + number(action, 1)});
  else
    return Error{ErrorCode::kNotFound, {}};
  if (!lab.analysis.first()) return wrong("no session is loaded: replay one first");
  return true;
}

Result<bool> ScriptRunner::actOnWindow(const ScriptAction& action, InstructorWindow& window, bool first) {
  const std::string& verb = action.verb;
  const auto stands = [&] { return window.text().find(flatText(action.words[0])) != std::string::npos; };
  if (verb == "wait-text") return stands();
  if (verb == "wait-gone") return !stands();
  if (verb == "expect") {
    // the previous action's effect appears on the screen a frame later
    if (frames_ < 3) return false;
    if (stands()) return true;
    return wrong("does not stand there; the screen says: " + window.text().substr(0, 1500));
  }
  if (verb == "screenshot") {
    if (frames_ < 3) return false;
    RETURN_IF_ERROR(savePng(window.surface().picture(), action.words[0]));
    return true;
  }
  if (verb == "camera") {
    const std::string& where = action.words[0];
    const Look look = where == "above"  ? Look::kAbove
                      : where == "side" ? Look::kSide
                      : where == "free" ? Look::kFree
                                        : Look::kTrainee;
    window.live_screen.pane().look(look);
    window.replay_screen.pane().look(look);
    return true;
  }
  if (verb == "help") {
    window.show_help = !window.show_help;
    return true;
  }
  if (verb == "font-scale") {
    window.surface().setFontScale(number(action));
    return true;
  }
  if (verb == "latency") {
    LiveStation* const live = window.lab().live();
    if (live == nullptr) return wrong("no station is being watched: open one first");
    const LatencyMeter& meter = live->latency();
    if (meter.count() == 0) return false;
    const double p99_ms = meter.quantile_ms(0.99);
    print_(fmt::format("capture to screen: p50 {:.1f} ms  p99 {:.1f} ms  of {} live frames; {} dropped",
                       meter.quantile_ms(0.5), p99_ms, meter.count(), live->stats().dropped()));
    if (!action.words.empty() && p99_ms > number(action))
      return wrong(fmt::format("p99 is {:.1f} ms", p99_ms));
    return true;
  }
  if (verb == "frames") {
    print_(fmt::format("frames: {}, {:.1f} ms each on average, {:.1f} ms at most", frame_count_,
                       1e3 * frame_cost_s_ / static_cast<double>(std::max<std::size_t>(1, frame_count_)),
                       1e3 * frame_most_s_));
    frame_count_ = 0;
    frame_cost_s_ = frame_most_s_ = 0;
    return true;
  }
  if (verb == "print") {
    print_(action.words[0]);
    return true;
  }
  if (verb == "quit") {
    (void)first;
    over_ = true;
    return true;
  }
  return Error{ErrorCode::kNotFound, {}};
}

}  // namespace needlelab
