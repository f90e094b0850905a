#include "client/station/window/trainee_app.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <fmt/core.h>
#include <imgui/imgui.h>

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

#include "client/device/hand/hand_options.h"
#include "client/station/run/io/terminal.h"
#include "client/station/run/loop/real_time.h"
#include "client/station/run/loop/signals.h"
#include "client/station/window/frame_log.h"
#include "client/station/window/lessons/lesson_sequence.h"
#include "client/station/window/trainee_window.h"
#include "client/view/drawn_text.h"
#include "client/view/surface.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

}  // namespace

// --- when pictures are due ---

std::vector<PictureRequest> PicturePlan::due(Stage stage, double lesson_s) {
  constexpr int kSettled = 3;
  frames_ = stage == last_ ? frames_ + 1 : 1;
  last_ = stage;
  std::vector<PictureRequest> now;
  for (std::size_t i = 0; i < pictures_.size(); ++i) {
    if (taken_[i]) continue;
    const PictureRequest& picture = pictures_[i];
    const bool is_due = picture.when == PictureRequest::When::kLesson
                            ? stage == Stage::kLesson && frames_ >= kSettled && lesson_s >= picture.at_s
                        : picture.when == PictureRequest::When::kStart
                            ? stage == Stage::kStart && frames_ >= kSettled
                            : stage == Stage::kEnd && frames_ >= kSettled;
    if (!is_due) continue;
    taken_[i] = true;
    now.push_back(picture);
  }
  return now;
}

bool PicturePlan::done() const {
  const auto left = missing();
  // after the lesson, only its end can still be seen
  return std::none_of(left.begin(), left.end(), [&](const PictureRequest& picture) {
    return last_ != Stage::kEnd || picture.when == PictureRequest::When::kEnd;
  });
}

std::vector<PictureRequest> PicturePlan::missing() const {
  std::vector<PictureRequest> left;
  for (std::size_t i = 0; i < pictures_.size(); ++i)
    if (!taken_[i]) left.push_back(pictures_[i]);
  return left;
}

// --- the program ---

namespace {

bool hasDisplay() {
  const char* const display = std::getenv("DISPLAY");
  return display != nullptr && *display != '\0';
}

bool isPictureRequested(const StationOptions& options, PictureRequest::When when) {
  const auto& pictures = options.window.pictures;
  return std::any_of(pictures.begin(), pictures.end(),
                     [&](const auto& picture) { return picture.when == when; });
}

int refused(const std::string& why, int code) {
  logMessage(why);
  return code;
}

SurfaceOptions surfaceOptions(const StationOptions& options, bool display) {
  SurfaceOptions surface;
  surface.kind = display ? SurfaceOptions::Kind::kWindow : SurfaceOptions::Kind::kOffScreen;
  surface.title = "needlelab station";
  surface.asks_before_closing = true;
  surface.full_screen = !options.window.windowed;
  surface.viewing = options.window.viewing;
  surface.width_px = options.window.width_px;
  surface.height_px = options.window.height_px;
  surface.font_scale = options.window.font_scale.value_or(1);
  // the command line takes precedence over the stored size
  if (display && !options.window.size_given) {
    surface.state_file = defaultSpool().parent_path() / "station-window.json";
    // the spool's folder will be created in it; without it, the size is not stored
    (void)makePrivateFolder(surface.state_file.parent_path());
  }
  return surface;
}

/// The lessons' thread and its end.
class LessonThread {
 public:
  LessonThread(LessonSequence& sequence, LessonBoard& board) : sequence_(sequence), board_(board) {
    [[maybe_unused]] static const int registered = std::atexit(&LessonThread::atExit);
    current_.store(this);
    thread_ = std::thread([this] {
      code_ = sequence_.run();
      ended_.store(true);
    });
  }
  ~LessonThread() {
    finish();
    current_.store(nullptr);
  }
  LessonThread(const LessonThread&) = delete;
  LessonThread& operator=(const LessonThread&) = delete;

  [[nodiscard]] bool ended() const { return ended_.load(); }
  void beginExam() { sequence_.requests().beginExam(); }
  /// Ends the running lesson, then sends its recording.
  void requestEnd() {
    if (end_requested_.exchange(true)) return;
    sequence_.requests().stop({});
    board_.ask({BoardRequest::Kind::kQuit, {}});
  }
  /// The first call ends the lesson; later calls end the wait for the server.
  void requestEndAgain() {
    if (!end_requested_.load()) return requestEnd();
    sequence_.requests().stop({});
  }
  int finish() {
    if (thread_.joinable()) {
      requestEnd();
      thread_.join();
    }
    return code_;
  }

 private:
  // Xlib calls `exit` when its display or its window is lost: end the lesson properly before that. A handler
  // registered later than this one must not free what the lessons' thread uses (keepTlsAtExit).
  static void atExit() {
    LessonThread* const here = current_.load();
    if (here == nullptr || here->thread_.get_id() == std::this_thread::get_id()) return;
    logMessage("the display is gone; the lesson ends, and its recording is kept");
    here->finish();
    endProgram(kExitFailed);
  }

  static inline std::atomic<LessonThread*> current_{nullptr};
  LessonSequence& sequence_;
  LessonBoard& board_;
  std::atomic<bool> ended_{false}, end_requested_{false};
  int code_ = kExitFailed;
  std::thread thread_;
};

/// The frame loop.
class FrameLoop {
 public:
  FrameLoop(const StationOptions& options, const sigset_t& signals, bool alone, Surface& surface,
            TraineeWindow& window, LessonBoard& board, LessonThread& lessons,
            std::optional<FrameLog> frame_log, std::optional<TextLog> text_log)
      : options_(options),
        signals_(signals),
        alone_(alone),
        surface_(surface),
        window_(window),
        board_(board),
        lessons_(lessons),
        frame_log_(std::move(frame_log)),
        text_log_(std::move(text_log)),
        plan_(options.window.pictures) {}

  /// Returns false if a picture is missing.
  bool run() {
    Stopwatch watch;
    while (!lessons_.ended()) {
      if (signalWithin(signals_, 0ms) != 0) lessons_.requestEndAgain();
      if (!surface_.beginFrame()) break;
      if (surface_.takeCloseRequest()) {
        // while the program ends, there is nothing left to ask
        if (window_.shown().stage == Stage::kClosing) surface_.close();
        window_.askToQuit();
      }
      window_.frame();
      scaleLetters();
      surface_.endFrame();
      ++frames_;
      drawn_s_ += surface_.frameCost_s();
      logFrame();
      takePictures();
      if (alone_) stepWithoutDisplay();
    }
    const double seconds = watch.lap();
    logMessage(fmt::format("window: {} frames, {:.1f} a second, {:.1f} ms each", frames_,
                           frames_ / std::max(seconds, 1e-3), 1e3 * drawn_s_ / std::max(frames_, 1)));
    for (const PictureRequest& picture : plan_.missing())
      logMessage("no picture " + picture.file.string() + ": the lesson ended before it");
    return all_saved_ && plan_.missing().empty();
  }

 private:
  void scaleLetters() {
    const ImGuiIO& io = ImGui::GetIO();
    if (!io.KeyCtrl) return;
    const bool more = ImGui::IsKeyPressed(GLFW_KEY_EQUAL) || ImGui::IsKeyPressed(GLFW_KEY_KP_ADD);
    const bool less = ImGui::IsKeyPressed(GLFW_KEY_MINUS) || ImGui::IsKeyPressed(GLFW_KEY_KP_SUBTRACT);
    if (more != less) surface_.setFontScale(surface_.fontScale() + (more ? 0.1 : -0.1));
  }

  // stops a log after its first failure
  void logFrame() {
    if (text_log_) {
      std::vector<std::string> words;
      for (DrawnLine& line : drawnText()) words.push_back(std::move(line.text));
      if (const Status added = text_log_->add(words); !added.ok()) {
        logMessage(added.error().message);
        text_log_.reset();
      }
    }
    if (!frame_log_) return;
    if (const Status added = frame_log_->add(window_.shownFrame(), steadyNowNs()); !added.ok()) {
      logMessage(added.error().message);
      frame_log_.reset();
    }
  }

  void takePictures() {
    for (const PictureRequest& picture : plan_.due(window_.shown().stage, window_.lessonTime_s())) {
      if (const Status saved = savePng(surface_.picture(), picture.file); !saved.ok()) {
        logMessage(saved.error().message);
        all_saved_ = false;
      } else {
        logMessage("picture " + picture.file.string());
      }
    }
  }

  // without a display no person can begin or quit
  void stepWithoutDisplay() {
    const BoardState& state = window_.shown();
    const bool lesson_is_requested = isPictureRequested(options_, PictureRequest::When::kLesson) ||
                                     isPictureRequested(options_, PictureRequest::When::kEnd);
    if (!state.exam_terms.empty()) lessons_.beginExam();
    if (state.stage == Stage::kStart && !state.trouble.empty()) return lessons_.requestEnd();
    if (state.stage == Stage::kStart && isStartPictureTaken() && !begun_) {
      if (!lesson_is_requested) return lessons_.requestEnd();
      begun_ = true;
      board_.ask({BoardRequest::Kind::kBegin, state.choice});
    }
    // ends after the server's verdict, or without further pictures
    if (state.stage == Stage::kEnd &&
        (plan_.done() || !isPictureRequested(options_, PictureRequest::When::kEnd)))
      lessons_.requestEnd();
  }
  [[nodiscard]] bool isStartPictureTaken() const {
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
  std::optional<FrameLog> frame_log_;
  std::optional<TextLog> text_log_;
  PicturePlan plan_;
  int frames_ = 0;
  double drawn_s_ = 0;
  bool all_saved_ = true, begun_ = false;
};

// refuses options that need a person at a display
Status checkDisplay(const StationOptions& options, bool display) {
  if (display) return {};
  if (options.window.pictures.empty())
    return Error{ErrorCode::kUnavailable,
                 "there is no display for a window (DISPLAY is not set): --headless practises without one, "
                 "--screenshot FILE --at S takes pictures of a lesson without one"};
  if (options.hand.plan == kPointerPlan)
    return Error{ErrorCode::kInvalidInput,
                 "--hand-plan pointer needs a display: no one could move the hand here"};
  const bool needs_lesson = isPictureRequested(options, PictureRequest::When::kLesson) ||
                            isPictureRequested(options, PictureRequest::When::kEnd);
  if (needs_lesson && options.exercise.empty() && options.profile_file.empty())
    return Error{ErrorCode::kInvalidInput,
                 "without a display no one can choose: give --exercise ID or --profile FILE"};
  return {};
}

}  // namespace

int runTrainee(const StationOptions& given, const sigset_t& stop_signals) {
  const bool display = hasDisplay();
  if (const Status possible = checkDisplay(given, display); !possible.ok())
    return refused(possible.error().message, exitCodeOf(possible.error()));
  StationOptions options = given;
  // with a window and the simulated device, mouse and keys move the needle
  if (display && options.device == "simulated" && !options.hand_plan_given && !options.hand.skill)
    options.hand.plan = kPointerPlan;
  std::optional<FrameLog> frame_log;
  if (!options.window.frame_log.empty()) {
    auto opened = FrameLog::open(options.window.frame_log);
    if (!opened.ok()) return refused(opened.error().message, exitCodeOf(opened.error()));
    frame_log.emplace(std::move(*opened));
  }
  std::optional<TextLog> text_log;
  if (!options.window.text_log.empty()) {
    auto opened = TextLog::open(options.window.text_log);
    if (!opened.ok()) return refused(opened.error().message, exitCodeOf(opened.error()));
    text_log.emplace(std::move(*opened));
  }

  const auto core = coreForLoop(options.cpu);
  // llvmpipe's threads keep the core mask of their creation: keep them off the haptic loop's core
  auto keep_off = std::make_optional<KeepOffCore>(core);
  auto surface = Surface::open(surfaceOptions(options, display));
  if (!surface.ok()) return refused(surface.error().message, exitCodeOf(surface.error()));
  if (options.window.font_scale) (*surface)->setFontScale(*options.window.font_scale);
  // the lessons' threads may use all cores
  keep_off.reset();
  LessonBoard board;
  const bool alone = !display;
  const bool begins =
      options.window.start || (alone && !isPictureRequested(options, PictureRequest::When::kStart));
  LessonSequence sequence(options, stop_signals, board, alone, begins);
  auto window = TraineeWindow::make(board, sequence.requests(), options.window.may_quit);
  if (!window.ok()) return refused(window.error().message, exitCodeOf(window.error()));
  bool pictures = true;
  int code = kExitFailed;
  {
    LessonThread lessons(sequence, board);
    keep_off.emplace(core);
    pictures = FrameLoop(options, stop_signals, alone, **surface, **window, board, lessons,
                         std::move(frame_log), std::move(text_log))
                   .run();
    // close the window at once, because draining may take a while
    window->reset();
    surface->reset();
    lessons.requestEnd();
    while (!lessons.ended())
      if (signalWithin(stop_signals, 50ms) != 0) lessons.requestEndAgain();
    code = lessons.finish();
  }
  if (code == kExitDone && !pictures) code = kExitFailed;
  if (sequence.hangs()) endProgram(code);
  return code;
}

}  // namespace needlelab
