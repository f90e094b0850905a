#include "client/station/window/trainee_app.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "client/device/hand_plan_choice.h"
#include "client/station/run/loop_core.h"
#include "client/station/run/option_list.h"
#include "client/station/run/say.h"
#include "client/station/run/signals.h"
#include "client/station/window/conductor.h"
#include "client/station/window/keys.h"
#include "client/station/window/picture_plan.h"
#include "client/station/window/trainee_window.h"
#include "client/view/surface.h"
#include "common/base/program.h"
#include "common/base/text.h"

namespace needlelab {

using namespace std::chrono_literals;

namespace {

bool thereIsADisplay() {
  const char* const display = std::getenv("DISPLAY");
  return display != nullptr && *display != '\0';
}

bool wantsPicture(const StationOptions& options, PictureRequest::When when) {
  const auto& pictures = options.window.pictures;
  return std::any_of(pictures.begin(), pictures.end(),
                     [&](const auto& picture) { return picture.when == when; });
}

int refused(const std::string& why, int code) {
  say(why);
  return code;
}

SurfaceOptions surfaceOptions(const StationOptions& options, bool display) {
  SurfaceOptions surface;
  surface.kind = display ? SurfaceOptions::Kind::kWindow : SurfaceOptions::Kind::kOffScreen;
  surface.title = "needlelab station";
  surface.width_px = options.window.width_px;
  surface.height_px = options.window.height_px;
  surface.font_scale = options.window.font_scale.value_or(1);
  // what was said now goes before what was left last time
  if (display && !options.window.size_given) {
    surface.state_file = defaultSpool().parent_path() / "station-window.json";
    std::error_code ignored;
    std::filesystem::create_directories(surface.state_file.parent_path(), ignored);
  }
  return surface;
}

/// The thread of the lessons, and how it is told to end.
class LessonThread {
 public:
  LessonThread(Conductor& conductor, LessonBoard& board) : conductor_(conductor), board_(board) {
    current_.store(this);
    thread_ = std::thread([this] {
      code_ = conductor_.run();
      ended_.store(true);
    });
    [[maybe_unused]] static const int registered = std::atexit(&LessonThread::atExit);
  }
  ~LessonThread() {
    finish();
    current_.store(nullptr);
  }
  LessonThread(const LessonThread&) = delete;
  LessonThread& operator=(const LessonThread&) = delete;

  [[nodiscard]] bool ended() const { return ended_.load(); }
  /// Ends what runs, then sends what was recorded.
  void askToEnd() {
    if (asked_.exchange(true)) return;
    conductor_.requests().stop({});
    board_.ask({BoardWish::Kind::kQuit, {}});
  }
  /// Asked once already: the server is not waited for any more.
  void askAgain() {
    if (!asked_.load()) return askToEnd();
    conductor_.requests().stop({});
  }
  int finish() {
    if (thread_.joinable()) {
      askToEnd();
      thread_.join();
    }
    return code_;
  }

 private:
  // Xlib ends the program by `exit` when its display goes: the lesson is ended properly before that
  static void atExit() {
    LessonThread* const here = current_.load();
    if (here == nullptr || here->thread_.get_id() == std::this_thread::get_id()) return;
    say("the display is gone; the lesson ends, what was recorded is kept");
    here->finish();
  }

  static inline std::atomic<LessonThread*> current_{nullptr};
  Conductor& conductor_;
  LessonBoard& board_;
  std::atomic<bool> ended_{false}, asked_{false};
  int code_ = kExitFailed;
  std::thread thread_;
};

/// The frame loop.
class FrameLoop {
 public:
  FrameLoop(const StationOptions& options, const sigset_t& signals, bool alone, Surface& surface,
            TraineeWindow& window, LessonBoard& board, LessonThread& lessons)
      : options_(options),
        signals_(signals),
        alone_(alone),
        surface_(surface),
        window_(window),
        board_(board),
        lessons_(lessons),
        plan_(options.window.pictures) {}

  /// False when a picture is missing.
  bool run() {
    const auto began = std::chrono::steady_clock::now();
    while (!lessons_.ended()) {
      if (signalWithin(signals_, 0ms) != 0) lessons_.askAgain();
      if (!surface_.beginFrame()) break;
      window_.frame();
      scaleLetters();
      surface_.endFrame();
      ++frames_;
      drawn_s_ += surface_.frameCost_s();
      takePictures();
      if (alone_) goOnAlone();
    }
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    say(formatted("window: %d frames, %.1f a second, %.1f ms each", frames_,
                  frames_ / std::max(seconds, 1e-3), 1e3 * drawn_s_ / std::max(frames_, 1)));
    for (const PictureRequest& picture : plan_.missing())
      say("no picture " + picture.file.string() + ": the lesson ended before it");
    return all_saved_ && plan_.done();
  }

 private:
  void scaleLetters() {
    const ImGuiIO& io = ImGui::GetIO();
    if (!io.KeyCtrl) return;
    const bool more = ImGui::IsKeyPressed(GLFW_KEY_EQUAL) || ImGui::IsKeyPressed(GLFW_KEY_KP_ADD);
    const bool less = ImGui::IsKeyPressed(GLFW_KEY_MINUS) || ImGui::IsKeyPressed(GLFW_KEY_KP_SUBTRACT);
    if (more != less) surface_.setFontScale(surface_.fontScale() + (more ? 0.1 : -0.1));
  }

  void takePictures() {
    for (const PictureRequest& picture : plan_.due(window_.shown().stage, window_.lessonTime_s())) {
      if (const Status saved = savePng(surface_.picture(), picture.file); !saved.ok()) {
        say(saved.error().message);
        all_saved_ = false;
      } else {
        say("picture " + picture.file.string());
      }
    }
  }

  // nobody is there to begin or to quit
  void goOnAlone() {
    const BoardState& state = window_.shown();
    const bool lesson_is_wanted = wantsPicture(options_, PictureRequest::When::kLesson) ||
                                  wantsPicture(options_, PictureRequest::When::kEnd);
    if (state.stage == Stage::kStart && !state.trouble.empty()) return lessons_.askToEnd();
    if (state.stage == Stage::kStart && startIsTaken() && !begun_) {
      if (!lesson_is_wanted) return lessons_.askToEnd();
      begun_ = true;
      board_.ask({BoardWish::Kind::kBegin, state.choice});
    }
    // the server's word, or no picture more to wait for
    if (state.stage == Stage::kEnd && (plan_.done() || !wantsPicture(options_, PictureRequest::When::kEnd)))
      lessons_.askToEnd();
  }
  [[nodiscard]] bool startIsTaken() const {
    const auto missing = plan_.missing();
    return std::none_of(missing.begin(), missing.end(),
                        [](const auto& picture) { return picture.when == PictureRequest::When::kStart; });
  }

  const StationOptions& options_;
  const sigset_t& signals_;
  const bool alone_;
  Surface& surface_;
  TraineeWindow& window_;
  LessonBoard& board_;
  LessonThread& lessons_;
  PicturePlan plan_;
  int frames_ = 0;
  double drawn_s_ = 0;
  bool all_saved_ = true, begun_ = false;
};

// what cannot work without a person before a display
Status checkDisplay(const StationOptions& options, bool display) {
  if (display) return {};
  if (options.window.pictures.empty())
    return Error{ErrorCode::kUnavailable,
                 "there is no display for a window (DISPLAY is not set): --headless practises without one, "
                 "--screenshot FILE --at S takes pictures of a lesson without one"};
  if (options.hand.plan == kPointerPlan)
    return Error{ErrorCode::kInvalidInput,
                 "--hand-plan pointer needs a display: nobody could move the hand here"};
  const bool needs_lesson = wantsPicture(options, PictureRequest::When::kLesson) ||
                            wantsPicture(options, PictureRequest::When::kEnd);
  if (needs_lesson && options.exercise.empty() && options.profile_file.empty())
    return Error{ErrorCode::kInvalidInput,
                 "without a display nobody can choose: give --exercise ID or --profile FILE"};
  return {};
}

}  // namespace

int runTrainee(const StationOptions& given, const sigset_t& stop_signals) {
  const bool display = thereIsADisplay();
  if (const Status possible = checkDisplay(given, display); !possible.ok())
    return refused(possible.error().message, exitCodeOf(possible.error()));
  StationOptions options = given;
  // on a laptop whoever looks at the window moves the needle
  if (display && options.device == "simulated" && !options.hand_plan_given && !options.hand.skill)
    options.hand.plan = kPointerPlan;

  const auto core = coreForLoop(options.cpu);
  // llvmpipe's threads keep where they were begun: not beside the haptic loop
  auto keep_off = std::make_optional<KeepOffCore>(core);
  auto surface = Surface::open(surfaceOptions(options, display));
  if (!surface.ok()) return refused(surface.error().message, exitCodeOf(surface.error()));
  if (options.window.font_scale) (*surface)->setFontScale(*options.window.font_scale);
  // the lessons' threads may use every core
  keep_off.reset();
  LessonBoard board;
  const bool alone = !display;
  const bool begins = options.window.start || (alone && !wantsPicture(options, PictureRequest::When::kStart));
  Conductor conductor(options, stop_signals, board, alone, begins);
  auto window = TraineeWindow::make(board, conductor.requests());
  if (!window.ok()) return refused(window.error().message, exitCodeOf(window.error()));
  bool pictures = true;
  int code = kExitFailed;
  {
    LessonThread lessons(conductor, board);
    keep_off.emplace(core);
    pictures = FrameLoop(options, stop_signals, alone, **surface, **window, board, lessons).run();
    // what follows may take a while: the window is gone at once
    window->reset();
    surface->reset();
    lessons.askToEnd();
    while (!lessons.ended())
      if (signalWithin(stop_signals, 50ms) != 0) lessons.askAgain();
    code = lessons.finish();
  }
  if (code == kExitDone && !pictures) code = kExitFailed;
  if (conductor.hangs()) std::_Exit(code);
  return code;
}

}  // namespace needlelab
