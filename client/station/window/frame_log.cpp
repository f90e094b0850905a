#include "client/station/window/frame_log.h"

#include <cerrno>
#include <cstring>
#include <utility>

#include <fmt/core.h>

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

FrameLog::FrameLog(const std::filesystem::path& file) : file_(file), out_(file, std::ios::trunc) {}

Result<FrameLog> FrameLog::open(const std::filesystem::path& file) {
  errno = 0;
  FrameLog log(file);
  RETURN_IF_ERROR(
      log.write("frame,shown_ns,screen,question,can_begin,lesson,lesson_s,depth_m,plunger,p_WT_x_m,p_WT_y_m,"
                "p_WT_z_m,aim_WT_x_m,aim_WT_y_m,aim_WT_z_m\n"));
  return log;
}

// errno 0: no earlier failure
Status FrameLog::write(const std::string& line) {
  out_ << line << std::flush;
  if (out_) return {};
  return Error{ErrorCode::kFailed,
               "--frame-log " + file_.string() + " cannot be written" +
                   (errno == 0 ? std::string() : std::string(": ") + std::strerror(errno))};
}

Status FrameLog::add(const ShownFrame& frame, std::int64_t shown_ns) {
  std::string line = fmt::format("{},{},{},{},{},{}", ++frames_, shown_ns, nameOf(frame.stage),
                                 nameOf(frame.question), frame.can_begin ? 1 : 0, frame.lesson);
  for (const double value : {frame.lesson_s, frame.depth_m, frame.plunger, frame.p_WT_m.x, frame.p_WT_m.y,
                             frame.p_WT_m.z, frame.aim_WT_m.x, frame.aim_WT_m.y, frame.aim_WT_m.z}) {
    line += ',';
    appendNumber(line, value);
  }
  errno = 0;
  return write(line + '\n');
}

}  // namespace needlelab
