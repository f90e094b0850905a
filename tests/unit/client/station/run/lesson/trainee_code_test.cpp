// A trainee's code, from a file or a terminal to a server that asks for it.
#include "client/station/run/lesson/trainee_code.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <memory>

#include "client/station/run/lesson/curriculum.h"
#include "client/station/run/station.h"
#include "client/station/run/station_run.h"
#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/net/uplink/fake_server.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

Error refusal(const std::string& text) {
  return {ErrorCode::kCode, text};
}

// --- a lesson without a window, and a server that asks for a code

class TraineeCode : public testing::Test {
 protected:
  TraineeCode() {
    sigemptyset(&signals_);
    options_.headless = true;
    options_.servers = {{"127.0.0.1", server_.port()}};
    options_.ca_file = FakeServer::caFile();
    options_.key_file = folder_.write("station.key", "station-1:" + std::string(64, '0') + "\n");
    fs::permissions(options_.key_file, fs::perms::owner_read);
    options_.spool = folder_.path() / "spool";
    options_.trainee = "tom";
    options_.exercise = "ball";
    pb::Lesson lesson;
    lesson.set_exercise_json(R"({"id": "ball", "name": "Ball", "profile_id": "phantom-ball"})");
    lesson.set_profile_json(*readWholeFile(NEEDLELAB_SAMPLES "/phantom-ball.json"));
    lesson.set_profile_revision(1);
    server_.setLesson(lesson);
    // no terminal, however the test is run
    stdin_ = ::dup(STDIN_FILENO);
    const int null = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    ::dup2(null, STDIN_FILENO);
    ::close(null);
  }
  ~TraineeCode() override {
    ::dup2(stdin_, STDIN_FILENO);
    ::close(stdin_);
  }

  void giveFile(const std::string& text) {
    options_.code_file = folder_.write("code", text);
    fs::permissions(options_.code_file, fs::perms::owner_read | fs::perms::owner_write);
  }
  // Prepares a lesson as runStation does; announcements go to observer_.
  Status prepare() {
    observer_.beginning.reset();
    auto ask = headlessCodePrompt(options_);
    if (!ask.ok()) return ask.error();
    run_.reset();
    home_.reset();
    home_ = std::make_unique<StationHome>(options_, observer_);
    RETURN_IF_ERROR(home_->openSpool());
    RETURN_IF_ERROR(home_->connect());
    run_ = std::make_unique<StationRun>(*home_, options_, signals_, GivenCode{code_at_once_, *ask});
    return run_->prepare();
  }
  [[nodiscard]] pb::SessionDescription begun() const {
    return home_->spool().unfinished().back()->description();
  }
  void takeServerAway() { options_.servers = {{"127.0.0.1", 1}}; }
  // The content of every file that the station has written.
  [[nodiscard]] std::string written() const {
    std::string all;
    for (const auto& entry : fs::recursive_directory_iterator(options_.spool))
      if (entry.is_regular_file()) all += *readWholeFile(entry.path());
    return all;
  }

  struct Beginning : LessonObserver {
    std::shared_ptr<const LessonBeginning> beginning;
    void began(std::shared_ptr<const LessonBeginning> begun) override { beginning = std::move(begun); }
  } observer_;
  TempFolder folder_;
  FakeServer server_;
  sigset_t signals_{};
  StationOptions options_;
  std::string code_at_once_;  // as in a second attempt
  int stdin_ = -1;
  std::unique_ptr<StationHome> home_;
  std::unique_ptr<StationRun> run_;
};

TEST_F(TraineeCode, aTraineeWithoutACodeIsNotAsked) {
  giveFile("4711-tom\n");
  ASSERT_TRUE(prepare().ok());
  EXPECT_THAT(server_.givenCodes(), ElementsAre("")) << "no one asked for what is in the file";
  EXPECT_FALSE(begun().code_checked());
  EXPECT_FALSE(observer_.beginning->code_unchecked);
}

TEST_F(TraineeCode, offlineTheSessionHasTheIdAndTheDiskNoName) {
  const std::string name = "tamara", person = "@01890a5d-ac96-774b-bcce-b302099a8057";
  pb::Lesson lesson = server_.lesson();
  lesson.set_person_ref(person);
  server_.setLesson(lesson);
  options_.trainee = name;
  ASSERT_TRUE(prepare().ok());
  EXPECT_EQ(begun().trainee(), person);
  EXPECT_EQ(observer_.beginning->trainee, name) << "the screen shows it";
  Curriculum listed;
  listed.trainees = {{name, "Tamara Lind", person}};
  ASSERT_TRUE(CurriculumCache(options_.spool, options_.key_file).keep(listed).ok());
  takeServerAway();
  ASSERT_TRUE(prepare().ok());
  EXPECT_EQ(begun().trainee(), person);
  EXPECT_THAT(written(), AllOf(Not(HasSubstr(name)), Not(HasSubstr("Tamara"))));
  options_.trainee = "somebody";
  ASSERT_TRUE(prepare().ok());
  EXPECT_EQ(begun().trainee(), "somebody") << "as it was typed: the server maps it";
}

TEST_F(TraineeCode, theCodeFileIsSentOnRequestAndMarkedChecked) {
  server_.setCode("tom", "4711-tom");
  giveFile("4711-tom\r\nsecond line\n");
  const Status status = prepare();
  ASSERT_TRUE(status.ok()) << status.error().message;
  EXPECT_THAT(server_.givenCodes(), ElementsAre("", "4711-tom"));
  EXPECT_TRUE(begun().code_checked());
  EXPECT_TRUE(run_->codeChecked());
  EXPECT_FALSE(observer_.beginning->code_unchecked);
  EXPECT_THAT(written(), Not(HasSubstr("4711-tom"))) << "neither in the lesson's cache nor in the spool";
}

TEST_F(TraineeCode, aWrongCodeInTheFileIsSentOnceAndNothingBegins) {
  server_.setCode("tom", "4711-tom");
  giveFile("0000\n");
  const Status status = prepare();
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kCode);
  EXPECT_THAT(status.error().message, HasSubstr("this is not the code of tom; 4 tries left"));
  EXPECT_THAT(status.error().message, HasSubstr("--code-file " + options_.code_file.string()));
  EXPECT_THAT(server_.givenCodes(), ElementsAre("", "0000"));
  EXPECT_TRUE(home_->spool().unfinished().empty());
}

TEST_F(TraineeCode, withoutATerminalTheErrorNamesTheOption) {
  server_.setCode("tom", "4711-tom");
  const Status status = prepare();
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput) << "exit code 2";
  EXPECT_THAT(status.error().message, HasSubstr("tom has a code"));
  EXPECT_THAT(status.error().message, HasSubstr("--code-file FILE"));
}

TEST_F(TraineeCode, aProfileFromAFileAsksTheSame) {
  server_.setCode("tom", "4711-tom");
  options_.exercise.clear();
  options_.profile_file = NEEDLELAB_SAMPLES "/phantom-ball.json";
  giveFile("0000");
  EXPECT_EQ(prepare().error().code, ErrorCode::kCode);
  options_.code_file.clear();
  EXPECT_EQ(prepare().error().code, ErrorCode::kInvalidInput);
  giveFile("4711-tom");
  ASSERT_TRUE(prepare().ok());
  EXPECT_TRUE(begun().code_checked());
  EXPECT_THAT(server_.givenCodes(), ElementsAre("", "0000", "", "", "4711-tom"));
}

TEST_F(TraineeCode, tooManyWrongCodesBlockTheCacheToo) {
  giveFile("0000");
  ASSERT_TRUE(prepare().ok()) << "fills the cache";
  server_.setCode("tom", "4711-tom");
  for (int wrong = 0; wrong < 5; ++wrong) EXPECT_EQ(prepare().error().code, ErrorCode::kCode);
  giveFile("4711-tom");
  const Status status = prepare();
  ASSERT_FALSE(status.ok()) << "the right one has to wait, too";
  EXPECT_EQ(status.error().code, ErrorCode::kCode);
  EXPECT_THAT(status.error().message, HasSubstr("try again in a minute"));
  EXPECT_EQ(observer_.beginning, nullptr) << "nothing began from the cache";
}

TEST_F(TraineeCode, withoutTheServerTheTraineeLearnsThatAManagerConfirmsIt) {
  server_.setCode("tom", "4711-tom");
  giveFile("4711-tom");
  ASSERT_TRUE(prepare().ok());
  takeServerAway();
  ASSERT_TRUE(prepare().ok());
  EXPECT_FALSE(begun().code_checked());
  EXPECT_TRUE(observer_.beginning->code_unchecked);
  options_.trainee = "zoe";
  ASSERT_TRUE(prepare().ok());
  EXPECT_FALSE(observer_.beginning->code_unchecked) << "the server never asked for a code of zoe";
}

TEST_F(TraineeCode, aRemovedCodeIsNoLongerMentioned) {
  server_.setCode("tom", "4711-tom");
  giveFile("4711-tom");
  ASSERT_TRUE(prepare().ok());
  server_.setCode("tom", "");
  ASSERT_TRUE(prepare().ok());
  EXPECT_FALSE(begun().code_checked());
  takeServerAway();
  ASSERT_TRUE(prepare().ok());
  EXPECT_FALSE(observer_.beginning->code_unchecked);
}

TEST_F(TraineeCode, aCodeThatTheServerDidNotCompareIsNotChecked) {
  code_at_once_ = "4711-tom";
  ASSERT_TRUE(prepare().ok()) << "the code was removed since the last try";
  EXPECT_THAT(server_.givenCodes(), ElementsAre("4711-tom"));
  EXPECT_FALSE(begun().code_checked());
  EXPECT_FALSE(run_->codeChecked());
  options_.exercise.clear();
  options_.profile_file = NEEDLELAB_SAMPLES "/phantom-ball.json";
  ASSERT_TRUE(prepare().ok());
  EXPECT_FALSE(begun().code_checked());
}

TEST_F(TraineeCode, aServerSilentAboutTheCodeLetsNothingBegin) {
  giveFile("4711-tom");
  ASSERT_TRUE(prepare().ok()) << "fills the cache";
  server_.setCode("tom", "4711-tom");
  server_.faults.busy_for_codes = true;
  Status status = prepare();
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kCode);
  EXPECT_EQ(status.error().message, "the server is busy: try again");
  EXPECT_EQ(observer_.beginning, nullptr) << "nothing began from the cache";
  server_.faults.busy_for_codes = false;
  ASSERT_TRUE(prepare().ok());
}

TEST_F(TraineeCode, aCodeThatTheServerFailedToCheckLetsNoProfileBegin) {
  server_.setCode("tom", "4711-tom");
  server_.faults.fail_codes = true;
  code_at_once_ = "4711-tom";
  options_.exercise.clear();
  options_.profile_file = NEEDLELAB_SAMPLES "/phantom-ball.json";
  const Status status = prepare();
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message, HasSubstr("the test says so"));
  EXPECT_EQ(observer_.beginning, nullptr);
}

TEST_F(TraineeCode, aFileThatHoldsNoCodeIsNamedBeforeAnythingBegins) {
  for (const char* text : {"", "123\n", "\n4711\n", "12\t45\n"}) {
    giveFile(text);
    const Status status = prepare();
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(status.error().message, HasSubstr(options_.code_file.string()));
  }
  options_.code_file = folder_.path() / "none";
  const Status missing = prepare();
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kInvalidInput);
  EXPECT_FALSE(fs::exists(options_.spool));
}

// --- at a terminal

// A child process at a new terminal, and what that terminal shows.
class TerminalChild {
 public:
  // `child` returns the exit code.
  explicit TerminalChild(const std::function<int()>& child) {
    pid_ = ::forkpty(&master_, nullptr, nullptr, nullptr);
    if (pid_ == 0) ::_exit(child());
  }
  ~TerminalChild() {
    if (master_ >= 0) ::close(master_);
  }
  TerminalChild(const TerminalChild&) = delete;
  TerminalChild& operator=(const TerminalChild&) = delete;

  // Waits until the terminal has shown `text` this many times; false: the child ended before.
  bool shows(const std::string& text, int times) {
    std::array<char, 256> piece;
    while (count(text) < times) {
      const ssize_t got = ::read(master_, piece.data(), piece.size());
      if (got <= 0) return false;
      shown_.append(piece.data(), static_cast<std::size_t>(got));
    }
    return true;
  }
  void type(const std::string& text) const {
    EXPECT_EQ(::write(master_, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  int exitCode() {
    while (shows("\x01never shown", 1)) {
    }
    int status = 0;
    return ::waitpid(pid_, &status, 0) == pid_ && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  [[nodiscard]] const std::string& shown() const { return shown_; }

 private:
  [[nodiscard]] int count(const std::string& text) const {
    int found = 0;
    for (std::size_t at = shown_.find(text); at != std::string::npos; at = shown_.find(text, at + 1)) ++found;
    return found;
  }
  pid_t pid_ = -1;
  int master_ = -1;
  std::string shown_;
};

StationOptions atTheTerminal(const TempFolder& folder) {
  StationOptions options;
  options.trainee = "tom";
  options.spool = folder.path();
  options.key_file = folder.write("station.key", "station-1:" + std::string(64, '0') + "\n");
  fs::create_directories(folder.path() / "lessons");
  Curriculum curriculum;
  curriculum.trainees = {{"tom", "Tom Smith"}};
  EXPECT_TRUE(CurriculumCache(options.spool, options.key_file).keep(curriculum).ok());
  return options;
}

TEST(CodeAtTheTerminal, isTypedHiddenAndRepeatedUntilTheServerAcceptsIt) {
  const TempFolder folder;
  const StationOptions options = atTheTerminal(folder);
  TerminalChild child([&] {
    const auto ask = headlessCodePrompt(options);
    const auto first = (*ask)(refusal("tom has a code"), {});
    const auto second = (*ask)(refusal("this is not the code of tom; 4 tries left"), {});
    return first.ok() && *first == "4711-tom" && second.ok() && *second == "4712-tom" ? 7 : 1;
  });
  const std::string prompt = "Code of Tom Smith (PIN or badge): ";
  ASSERT_TRUE(child.shows(prompt, 1)) << child.shown();
  child.type("12\n");
  ASSERT_TRUE(child.shows(prompt, 2)) << child.shown();
  EXPECT_THAT(child.shown(), HasSubstr("4 to 64")) << "too short: it costs no try";
  child.type("4711-tom\n");
  ASSERT_TRUE(child.shows(prompt, 3)) << child.shown();
  EXPECT_THAT(child.shown(), HasSubstr("this is not the code of tom; 4 tries left"));
  child.type("4712-tom\n");
  EXPECT_EQ(child.exitCode(), 7) << child.shown();
  EXPECT_THAT(child.shown(), Not(HasSubstr("471")));
}

TEST(CodeAtTheTerminal, nothingTypedAndAStopEndIt) {
  const TempFolder folder;
  const StationOptions options = atTheTerminal(folder);
  TerminalChild child([&] {
    const auto ask = headlessCodePrompt(options);
    const auto nothing = (*ask)(refusal("tom has a code"), {});
    const auto stopped = (*ask)(refusal("tom has a code"), [] { return true; });
    return !nothing.ok() && nothing.error().code == ErrorCode::kFailed && !stopped.ok() &&
                   stopped.error().code == ErrorCode::kFailed
               ? 7
               : 1;
  });
  ASSERT_TRUE(child.shows("(PIN or badge): ", 1)) << child.shown();
  child.type("\n");
  EXPECT_EQ(child.exitCode(), 7) << child.shown();
}

}  // namespace
}  // namespace needlelab::test
