#include "client/net/spool/lesson_cache.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include "common/base/files/files.h"
#include "common/base/time/clock.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class LessonCacheTest : public testing::Test {
 protected:
  LessonCacheTest() {
    fs::create_directories(folder_.path() / "lessons");
    lesson_.set_exercise_json(R"({"id": "knee-1", "name": "Knee µ", "profile_id": "knee"})");
    lesson_.set_profile_json(R"({"id": "knee", "stiffness": 500})");
    lesson_.set_profile_revision(3);
  }
  std::string textOf(const std::string& id) const { return *readWholeFile(fileOf(id)); }
  fs::path fileOf(const std::string& id) const { return folder_.path() / "lessons" / (id + ".json"); }
  void write(const std::string& id, const std::string& text) const {
    folder_.write("lessons/" + id + ".json", text);
  }

  TempFolder folder_;
  LessonCache cache_{folder_.path()};
  pb::Lesson lesson_;
};

TEST_F(LessonCacheTest, keepsLessonsUnderTheirIdAndNowhereElse) {
  EXPECT_EQ(cache_.find("knee-1").error().code, ErrorCode::kNotFound);
  ASSERT_TRUE(cache_.keep("knee-1", lesson_).ok());
  EXPECT_EQ(cache_.find("knee-1")->SerializeAsString(), lesson_.SerializeAsString());
  EXPECT_EQ(cache_.find("knee-1")->profile_revision(), 3u);
  for (const char* id : {"", "../knee", "a/b", ".hidden", "knee 1", "knee\n"})
    EXPECT_EQ(cache_.keep(id, lesson_).error().code, ErrorCode::kInvalidInput) << id;
}

TEST_F(LessonCacheTest, filesOfEarlierVersionsAreRead) {
  write("knee-1", R"({"exerciseJson": "{\"id\": \"knee-1\"}", "profileJson": "{}", "profileRevision": 2})");
  auto lesson = cache_.find("knee-1");
  ASSERT_TRUE(lesson.ok()) << lesson.error().message;
  EXPECT_EQ(lesson->profile_revision(), 2u);
}

TEST_F(LessonCacheTest, anExerciseThatNestsDeepIsRefusedByName) {
  constexpr std::size_t kLevels = 300'000;
  lesson_.set_exercise_json(R"({"id": "knee-1", "a": )" + std::string(kLevels, '[') +
                            std::string(kLevels, ']') + "}");
  ASSERT_TRUE(cache_.keep("knee-1", lesson_).ok());
  const auto lesson = cache_.find("knee-1");
  ASSERT_FALSE(lesson.ok());
  EXPECT_EQ(lesson.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(lesson.error().message, HasSubstr("its exercise is nested more deeply"));
  const auto listed = cache_.list();
  ASSERT_EQ(listed.size(), 1u);
  EXPECT_THAT(listed[0].trouble, HasSubstr("its exercise is nested more deeply"));
}

TEST_F(LessonCacheTest, oneFlippedDigitIsFound) {
  ASSERT_TRUE(cache_.keep("knee-1", lesson_).ok());
  std::string text = textOf("knee-1");
  const auto name = text.find("stiffness");  // an earlier timestamp may contain a 500, too
  ASSERT_NE(name, std::string::npos);
  const auto at = text.find("500", name);
  ASSERT_NE(at, std::string::npos);
  text[at] = '9';  // a stiffness of 900 is a valid profile, too
  write("knee-1", text);
  auto lesson = cache_.find("knee-1");
  ASSERT_FALSE(lesson.ok());
  EXPECT_EQ(lesson.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(lesson.error().message,
              AllOf(HasSubstr("knee-1.json"), HasSubstr("hash"), HasSubstr("delete it and connect")));
}

TEST_F(LessonCacheTest, aCoursesExamSettingsAreKeptAndProtected) {
  lesson_.set_assigned_only(true);
  lesson_.set_exam(true);
  lesson_.set_results_from_unix_ns(1'780'495'200'000'000'000);
  ASSERT_TRUE(cache_.keep("knee-1", lesson_).ok());
  EXPECT_EQ(cache_.find("knee-1")->SerializeAsString(), lesson_.SerializeAsString());
  ASSERT_EQ(cache_.list().size(), 1u);
  EXPECT_TRUE(cache_.list().front().assigned_only);
  const std::string whole = textOf("knee-1");
  for (const char* field : {"assignedOnly", "exam", "resultsFromUnixNs"}) {
    std::string other = whole;
    const auto at = other.find('"' + std::string(field) + '"');
    ASSERT_NE(at, std::string::npos) << field;
    other[at + 1] = 'x';
    write("knee-1", other);
    EXPECT_FALSE(cache_.find("knee-1").ok()) << field;
  }
}

TEST_F(LessonCacheTest, everyDamagedByteIsFoundOrHarmless) {
  ASSERT_TRUE(cache_.keep("knee-1", lesson_).ok());
  const std::string whole = textOf("knee-1");
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x11);
    write("knee-1", damaged);
    const auto lesson = cache_.find("knee-1");
    if (lesson.ok()) {
      EXPECT_EQ(lesson->SerializeAsString(), lesson_.SerializeAsString()) << "byte " << i;
    } else {
      EXPECT_EQ(lesson.error().code, ErrorCode::kCorrupt) << "byte " << i;
    }
    if (i > 0) {
      write("knee-1", whole.substr(0, i));
      EXPECT_TRUE(!cache_.find("knee-1").ok() || whole.find_first_not_of(" \n", i) == std::string::npos);
    }
  }
}

TEST_F(LessonCacheTest, hostileFilesAreRefusedInPlainWords) {
  ASSERT_TRUE(cache_.keep("knee-1", lesson_).ok());
  fs::copy_file(fileOf("knee-1"), fileOf("shoulder"));
  fs::create_directory(fileOf("folder"));
  ASSERT_EQ(::mkfifo(fileOf("pipe").c_str(), 0600), 0);
  fs::create_symlink("/dev/zero", fileOf("endless"));
  fs::create_symlink("nowhere", fileOf("dangling"));
  write("huge", std::string(9u << 20, ' '));
  write("deep", std::string(200'000, '['));
  write("nested", "{\"lesson\": " + std::string(50'000, '[') + std::string(50'000, ']') + "}");
  write("binary", std::string("\x1b[2J\0\xff\xfe", 7));
  write("wrong", R"({"profile_revision": "many"})");
  write("other", R"({"exerciseJson": "{\"id\": \"\\u001b[2Jknee\"}", "profileJson": "{}"})");
  for (const char* id : {"shoulder", "folder", "pipe", "endless", "dangling", "huge", "deep", "nested",
                         "binary", "wrong", "other"}) {
    const auto lesson = cache_.find(id);
    ASSERT_FALSE(lesson.ok()) << id;
    EXPECT_EQ(lesson.error().code, ErrorCode::kCorrupt) << id;
    EXPECT_THAT(lesson.error().message, AllOf(HasSubstr(fileOf(id).string()), HasSubstr("delete it")));
    EXPECT_EQ(lesson.error().message.find('\x1b'), std::string::npos) << "nothing of it reaches the terminal";
  }
}

TEST_F(LessonCacheTest, theListNamesPresentAndBrokenEntries) {
  const auto before_ns = wallNowNs();
  ASSERT_TRUE(cache_.keep("knee-1", lesson_).ok());
  write("broken", "{");
  write("notes", "");
  fs::rename(fileOf("notes"), folder_.path() / "lessons" / "notes.txt");
  const auto list = cache_.list();
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0].exercise_id, "broken");
  EXPECT_THAT(list[0].trouble, HasSubstr("broken.json"));
  EXPECT_EQ(list[1].exercise_id, "knee-1");
  EXPECT_EQ(list[1].name, "Knee µ");
  EXPECT_EQ(list[1].profile_id, "knee");
  EXPECT_EQ(list[1].profile_revision, 3u);
  EXPECT_GE(list[1].fetched_unix_ns, before_ns);
  EXPECT_EQ(list[1].trouble, "");
  EXPECT_TRUE(LessonCache(folder_.path() / "nowhere").list().empty());
}

}  // namespace
}  // namespace needlelab::test
