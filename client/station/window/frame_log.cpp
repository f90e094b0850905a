#include "client/station/window/frame_log.h"

#include <cerrno>
#include <cstring>
#include <utility>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "common/base/text/csv.h"

namespace needlelab {
namespace {

const char* nameOf(Stage stage) {
  switch (stage) {
    case Stage::kOpening:
      return "opening";
    case Stage::kStart:
      return "start";
    case Stage::kPreparing:
      return "preparing";
    case Stage::kLesson:
      return "lesson";
    case Stage::kConcluding:
      return "concluding";
    case Stage::kEnd:
      return "end";
    case Stage::kClosing:
      return "closing";
    case Stage::kFailed:
      return "failed";
  }
  return "";
}

const char* nameOf(ShownQuestion question) {
  switch (question) {
    case ShownQuestion::kNone:
      return "none";
    case ShownQuestion::kEndLesson:
      return "end-lesson";
    case ShownQuestion::kBeginExam:
      return "begin-exam";
    case ShownQuestion::kQuit:
      return "quit";
  }
  return "";
}

}  // namespace

// errno 0: no earlier failure
Status LineLog::written() const {
  if (out_) return {};
  return Error{ErrorCode::kFailed,
               option_ + " " + file_.string() + " cannot be written" +
                   (errno == 0 ? std::string() : std::string(": ") + std::strerror(errno))};
}

Result<LineLog> LineLog::open(std::string_view option, const std::filesystem::path& file) {
  errno = 0;
  LineLog log(option, file);
  RETURN_IF_ERROR(log.written());
  return log;
}

Status LineLog::add(std::string line) {
  errno = 0;
  out_ << std::move(line) + '\n' << std::flush;
  return written();
}

Result<FrameLog> FrameLog::open(const std::filesystem::path& file) {
  ASSIGN_OR_RETURN(auto lines, LineLog::open("--frame-log", file));
  FrameLog log(std::move(lines));
  RETURN_IF_ERROR(log.log_.add(
      "frame,shown_ns,screen,question,can_begin,lesson,lesson_s,depth_m,plunger,p_WT_x_m,p_WT_y_m,"
      "p_WT_z_m,aim_WT_x_m,aim_WT_y_m,aim_WT_z_m"));
  return log;
}

Status FrameLog::add(const ShownFrame& frame, std::int64_t shown_ns) {
  std::string line = fmt::format("{},{},{},{},{},{}", ++frames_, shown_ns, nameOf(frame.stage),
                                 nameOf(frame.question), frame.can_begin ? 1 : 0, frame.lesson);
  for (const double value : {frame.lesson_s, frame.depth_m, frame.plunger, frame.p_WT_m.x, frame.p_WT_m.y,
                             frame.p_WT_m.z, frame.aim_WT_m.x, frame.aim_WT_m.y, frame.aim_WT_m.z}) {
    line += ',';
    appendNumber(line, value);
  }
  return log_.add(std::move(line));
}

Result<TextLog> TextLog::open(const std::filesystem::path& file) {
  ASSIGN_OR_RETURN(auto lines, LineLog::open("--text-log", file));
  return TextLog(std::move(lines));
}

Status TextLog::add(const std::vector<std::string>& words) {
  ++frames_;
  if (words == last_) return {};
  last_ = words;
  return log_.add(nlohmann::json{{"frame", frames_}, {"words", words}}.dump());
}

}  // namespace needlelab
