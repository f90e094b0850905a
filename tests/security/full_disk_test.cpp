// A station's key, stolen or mistaken, cannot fill the disk; a disk that is full anyway stops neither reading
// nor the server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <memory>

#include "common/base/bytes.h"
#include "common/base/program.h"
#include "common/base/text/text.h"
#include "db/erasure/retention_store.h"
#include "tests/support/patience.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;
constexpr std::uint64_t kMiB = 1u << 20;
constexpr const char* kPassword = "another long password";

/// A server whose disk has as much room as the test says.
struct RoomyServer {
  explicit RoomyServer(const std::function<void(ServerOptions&)>& tweak = {})
      : server([free = free_bytes, tweak](ServerOptions& options) {
          options.free_bytes = [free](const std::filesystem::path&) { return std::optional(free->load()); };
          options.room_every = milliseconds(5);
          if (tweak) tweak(options);
        }) {}
  void leave(std::uint64_t MiB) const { free_bytes->store(MiB * kMiB); }

  std::shared_ptr<std::atomic<std::uint64_t>> free_bytes =
      std::make_shared<std::atomic<std::uint64_t>>(10'000 * kMiB);
  RunningServer server;
};

/// The answer to an OpenSession: session_opened or a refusal.
pb::Envelope answerTo(BlockingClient& client, const pb::Envelope& open) {
  EXPECT_TRUE(client.send(open).ok());
  return waitFor(client, [](const pb::Envelope& e) { return e.has_session_opened() || e.has_refusal(); });
}

/// Sends it until the server answers as wanted: the server checks its disk only from time to time.
template <typename Wanted>
pb::Envelope answerAsWanted(BlockingClient& client, const std::function<pb::Envelope()>& open,
                            Wanted wanted) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  for (;;) {
    auto answer = answerTo(client, open());
    if (wanted(answer) || std::chrono::steady_clock::now() > end) return answer;
    std::this_thread::sleep_for(milliseconds(5));
  }
}
bool isRefused(const pb::Envelope& answer) {
  return answer.has_refusal();
}
bool isOpened(const pb::Envelope& answer) {
  return answer.has_session_opened();
}

/// How many of the session's chunks a person can read now.
int readableChunks(BlockingClient& person, const FakeSession& session) {
  pb::Request request;
  request.mutable_read_chunks()->set_session_id(session.id());
  const auto reply = person.call(request);
  EXPECT_TRUE(reply.ok()) << reply.error().message;
  return reply.ok() ? reply->chunks().chunks_size() : -1;
}

TEST(FullDisk, oneStationKeyCannotExceedItsProfileQuota) {
  RoomyServer s([](ServerOptions& options) {  // for four, with the other fields of their descriptions
    options.quotas.description_bytes = 1'010'000;
  });
  auto thief = s.server.connect(stationLogin("bench-1", s.server.addStation("bench-1")));
  auto honest = s.server.connect(stationLogin("bench-2", s.server.addStation("bench-2")));
  ASSERT_TRUE(thief.ok() && honest.ok());
  const std::string profile = "{" + std::string(249'998, ' ') + "}";
  int opened = 0, refused = 0;
  // more refusals than a faulty peer may have: refused for lack of room, it asks again
  for (int i = 0; i < 455; ++i) {
    const auto answer = answerTo(*thief, FakeSession("bench-1").open(profile));
    if (answer.has_session_opened()) {
      ++opened;
      continue;
    }
    ++refused;
    ASSERT_EQ(answer.refusal().reason(), pb::Refusal::NO_ROOM) << answer.refusal().text();
    ASSERT_FALSE(answer.refusal().fatal());
  }
  EXPECT_EQ(opened, 4);
  EXPECT_EQ(refused, 451);
  EXPECT_TRUE(isOpened(answerTo(*honest, FakeSession("bench-2").open(profile))));
  auto reader = s.server.server().store().readers().borrow();
  ASSERT_TRUE(reader.ok());
  auto rows = (*reader)->query("SELECT count(*), sum(length(profile_json)) FROM sessions");
  ASSERT_TRUE(*rows.step());
  EXPECT_EQ(rows.integer(0), 5);
  EXPECT_EQ(rows.integer(1), 5 * 250'000) << "nothing of a refused session is kept";
}

TEST(FullDisk, oneStationsKeyBringsSoManyOpenSessionsAndUnknownNames) {
  RoomyServer s([](ServerOptions& options) {
    options.quotas.open_sessions = 10;
    options.quotas.unknown_names = 3;
  });
  auto client = s.server.connect(stationLogin("bench-1", s.server.addStation("bench-1")));
  ASSERT_TRUE(client.ok());
  const auto open = [](const std::string& trainee) {
    auto envelope = FakeSession("bench-1").open();
    envelope.mutable_open_session()->mutable_description()->set_trainee(trainee);
    return envelope;
  };
  for (const char* name : {"a", "b", "c"}) EXPECT_TRUE(isOpened(answerTo(*client, open(name)))) << name;
  const auto fourth = answerTo(*client, open("d"));
  EXPECT_EQ(fourth.refusal().reason(), pb::Refusal::NO_ROOM);
  EXPECT_THAT(fourth.refusal().text(), HasSubstr("names of trainees"));
  EXPECT_TRUE(isOpened(answerTo(*client, open("a")))) << "a name that came before waits already";
  for (int i = 4; i < 10; ++i) EXPECT_TRUE(isOpened(answerTo(*client, open(std::string(kGuestName)))));
  const auto eleventh = answerTo(*client, open(std::string(kGuestName)));
  EXPECT_EQ(eleventh.refusal().reason(), pb::Refusal::NO_ROOM);
  EXPECT_THAT(eleventh.refusal().text(), HasSubstr("10 open sessions"));
}

TEST(FullDisk, oneStationKeyCannotExceedItsChunkQuotaAndLosesNothing) {
  constexpr std::uint64_t kTaken = 5;
  double share = 0;
  for (std::uint64_t seq = 0; seq < kTaken; ++seq)
    share += static_cast<double>(FakeSession::bytes(seq).size() + StationQuotas::kChunkRowBytes);
  share += 1;  // for rounding: too little for a chunk, or for opening a session
  RoomyServer s([share](ServerOptions& options) { options.quotas.chunk_bytes = share; });
  const std::string key = s.server.addStation("bench-1");
  s.server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  auto thief = s.server.connect(stationLogin("bench-1", key));
  auto honest = s.server.connect(stationLogin("bench-2", s.server.addStation("bench-2")));
  ASSERT_TRUE(thief.ok() && honest.ok());
  const FakeSession stolen("bench-1"), lesson("bench-2");
  ASSERT_TRUE(isOpened(answerTo(*thief, stolen.open())));
  for (std::uint64_t seq = 0; seq < kTaken; ++seq) ASSERT_TRUE(thief->send(stolen.chunk(seq)).ok());
  stolen.waitForAck(*thief, kTaken);
  ASSERT_TRUE(thief->send(stolen.chunk(0)).ok());
  ASSERT_TRUE(thief->send(stolen.chunk(kTaken)).ok());
  const pb::Refusal refused = waitForRefusal(*thief);
  EXPECT_EQ(refused.reason(), pb::Refusal::NO_ROOM) << refused.text();
  EXPECT_EQ(refused.expected_seq(), kTaken) << "stored data are repeated and cost nothing";
  EXPECT_TRUE(refused.fatal()) << "so that the station sends again what came after it";
  EXPECT_THAT(refused.text(), testing::AllOf(HasSubstr("of recordings within a day"), HasSubstr(" min")));

  thief = s.server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(thief.ok()) << "log-in continues";
  for (const auto& open : {stolen.open(), FakeSession("bench-1").open()}) {
    const auto answer = answerTo(*thief, open);
    EXPECT_EQ(answer.refusal().reason(), pb::Refusal::NO_ROOM) << answer.refusal().text();
    EXPECT_FALSE(answer.refusal().fatal()) << "it asks again until there is room";
  }
  ASSERT_TRUE(isOpened(answerTo(*honest, lesson.open())));
  for (std::uint64_t seq = 0; seq < kTaken; ++seq) ASSERT_TRUE(honest->send(lesson.chunk(seq)).ok());
  lesson.waitForAck(*honest, kTaken);
  auto chief = s.server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(chief.ok()) << chief.error().message;
  EXPECT_EQ(readableChunks(*chief, stolen), static_cast<int>(kTaken)) << "acknowledged data stay";
  EXPECT_EQ(readableChunks(*chief, lesson), static_cast<int>(kTaken));
}

TEST(FullDisk, undecodableChunksHaveASmallQuotaAndSoundOnesPass) {
  const FakeSession session("bench-1");
  const auto impossible = [&](std::uint64_t seq) {
    pb::Envelope envelope = session.chunk(seq);
    std::string& data = *envelope.mutable_chunk()->mutable_data();
    data[16] = static_cast<char>(data[16] ^ 1);  // another last tick
    const std::uint32_t crc = crc32c(viewOf(data).first(data.size() - 4));
    std::memcpy(data.data() + data.size() - 4, &crc, 4);
    return envelope;
  };
  RoomyServer s([](ServerOptions& options) {
    options.quotas.undecodable_bytes =
        static_cast<double>(FakeSession::bytes(1).size() + StationQuotas::kChunkRowBytes);
  });
  const std::string key = s.server.addStation("bench-1");
  auto station = s.server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(station.ok());
  ASSERT_TRUE(isOpened(answerTo(*station, session.open())));
  ASSERT_TRUE(station->send(session.chunk(0)).ok());
  ASSERT_TRUE(station->send(impossible(1)).ok());
  ASSERT_TRUE(station->send(impossible(2)).ok());
  const pb::Refusal refused = waitForRefusal(*station);
  EXPECT_EQ(refused.reason(), pb::Refusal::NO_ROOM) << refused.text();
  EXPECT_EQ(refused.expected_seq(), 2u);
  EXPECT_THAT(refused.text(), HasSubstr("chunks that cannot be decoded"));
  station = s.server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(station.ok());
  EXPECT_EQ(answerTo(*station, session.open()).session_opened().next_seq(), 2u);
  ASSERT_TRUE(station->send(session.chunk(2)).ok());
  session.waitForAck(*station, 3);
}

TEST(FullDisk, anAccountsQuotaSpansAllItsConnections) {
  RoomyServer s([](ServerOptions& options) {  // of the longest consents, including overhead
    options.shares.own_bytes = 5.0 * (1100 + PeopleShares::kRequestBytes);
  });
  for (const char* name : {"tina", "tom"}) s.server.addUser(name, pb::TRAINEE, kPassword);
  s.server.addUser("ina", pb::INSTRUCTOR, kPassword);
  pb::Request consent;
  const auto say = [&](BlockingClient& client, const std::string& name, int turn) {
    consent.mutable_set_consent()->set_name(name);
    consent.mutable_set_consent()->set_given(turn % 2 == 0);
    consent.mutable_set_consent()->set_note(std::string(1000, 'x'));
    return client.call(consent);
  };
  auto first = s.server.connect(personLogin("tina", kPassword));
  auto second = s.server.connect(personLogin("tina", kPassword));
  ASSERT_TRUE(first.ok() && second.ok());
  int stored = 0;
  for (int i = 0; i < 300; ++i) {
    const auto reply = say(i % 3 == 0 ? *second : *first, "tina", i);
    if (reply.ok()) {
      ++stored;
      continue;
    }
    ASSERT_EQ(reply.error().code, ErrorCode::kNoRoom) << reply.error().message;
    EXPECT_THAT(reply.error().message,
                testing::AllOf(HasSubstr("used up what it may store in a day"), HasSubstr(" min")));
  }
  EXPECT_EQ(stored, 5);
  auto tom = s.server.connect(personLogin("tom", kPassword));
  auto ina = s.server.connect(personLogin("ina", kPassword));
  ASSERT_TRUE(tom.ok() && ina.ok());
  EXPECT_TRUE(say(*tom, "tom", 0).ok());
  EXPECT_TRUE(say(*ina, "tina", 1).ok()) << "whoever asks pays, not whom it is about";
  pb::Request list;
  list.mutable_list_consents()->set_name("tina");
  const auto listed = first->call(list);
  ASSERT_TRUE(listed.ok()) << "reading continues";
  EXPECT_EQ(listed->consents().consents_size(), 6);
}

TEST(FullDisk, everyAuditedRequestIsChargedToItsSender) {
  constexpr int kShares = 5;
  RoomyServer s([](ServerOptions& options) {  // a request of less than 100 bytes costs its line
    options.shares.own_bytes = kShares * (100.0 + PeopleShares::kRequestBytes);
    options.shares.staff_bytes = options.shares.own_bytes;
  });
  s.server.addUser("tina", pb::TRAINEE, kPassword);
  s.server.addUser("ina", pb::INSTRUCTOR, kPassword);
  s.server.addUser("mia", pb::CURRICULUM_MANAGER, kPassword);
  (void)s.server.addStation("bench-1");
  pb::Request code, stop, disable;
  code.mutable_set_code()->set_name("tina");
  stop.mutable_stop_lesson()->set_station("bench-1");
  disable.mutable_disable_user()->set_name("tina");
  for (const auto& [who, request] : {std::pair{"tina", &code}, {"ina", &stop}, {"mia", &disable}}) {
    auto client = s.server.connect(personLogin(who, kPassword));
    ASSERT_TRUE(client.ok());
    // others are refused for another reason: no such station is online
    int for_room = 0;
    for (int i = 0; i < 2 * kShares; ++i) {
      const auto reply = client->call(*request);
      for_room += !reply.ok() && reply.error().code == ErrorCode::kNoRoom;
    }
    EXPECT_EQ(for_room, kShares) << who;
  }
}

TEST(FullDisk, atTheLastFloorNoRequestWritesAndReadingGoesOn) {
  RoomyServer s;
  s.server.addUser("tina", pb::TRAINEE, kPassword);
  s.server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  auto chief = s.server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(chief.ok());
  pb::Request toggle, list;
  const auto ask = [&](bool enable) {
    toggle.mutable_disable_user()->set_name("tina");
    toggle.mutable_disable_user()->set_enable(enable);
    return chief->call(toggle);
  };
  s.leave(7);  // of --min-free 64 MiB, less than an eighth
  const auto end = std::chrono::steady_clock::now() + kPatience;
  auto refused = ask(false);
  for (bool enable = true; refused.ok() && std::chrono::steady_clock::now() < end; enable = !enable)
    refused = ask(enable);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom) << refused.error().message;
  list.mutable_list_users();
  EXPECT_TRUE(chief->call(list).ok());
}

TEST(FullDisk, refusesNewDataAndAllowsReadsErasureAndRevocation) {
  RoomyServer s([](ServerOptions& options) { options.shares.own_bytes = 1e12; });
  s.server.addUser("tina", pb::TRAINEE, kPassword);
  s.server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  auto tina = s.server.connect(personLogin("tina", kPassword));
  auto chief = s.server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(tina.ok() && chief.ok());
  pb::Request consent;
  consent.mutable_set_consent()->set_name("tina");
  consent.mutable_set_consent()->set_given(true);
  consent.mutable_set_consent()->set_note(std::string(1000, 'x'));
  ASSERT_TRUE(tina->call(consent).ok());
  s.leave(20);
  const auto end = std::chrono::steady_clock::now() + kPatience;
  auto late = tina->call(consent);
  while (late.ok() && std::chrono::steady_clock::now() < end) late = tina->call(consent);
  ASSERT_FALSE(late.ok());
  EXPECT_EQ(late.error().code, ErrorCode::kNoRoom);
  EXPECT_THAT(late.error().message, HasSubstr("make room"));
  pb::Request annotate, reference, code, list, disable, retention, erase;
  annotate.mutable_annotate()->set_text("a remark");
  reference.mutable_set_reference();
  code.mutable_set_code()->set_name("tina");
  for (const pb::Request* stores : {&annotate, &reference, &code})
    EXPECT_EQ(chief->call(*stores).error().code, ErrorCode::kNoRoom);
  list.mutable_list_consents()->set_name("tina");
  EXPECT_TRUE(chief->call(list).ok());
  disable.mutable_disable_user()->set_name("tina");
  EXPECT_TRUE(chief->call(disable).ok());
  retention.mutable_run_retention()->set_dry_run(true);
  EXPECT_TRUE(chief->call(retention).ok());
  erase.mutable_erase_person()->set_name("tina");
  erase.mutable_erase_person()->set_confirm("tina");
  const auto erased = chief->call(erase);
  EXPECT_TRUE(erased.ok()) << erased.error().message;
}

/// Checks the disk once, at the start, and finds this much more than new sessions need.
RoomyServer serverWithRoomFor(std::uint64_t bytes) {
  return RoomyServer([bytes](ServerOptions& options) {
    options.min_free_bytes = kMiB;
    options.room_every = std::chrono::hours(1);
    options.free_bytes = [bytes](const std::filesystem::path&) {
      return std::optional(DiskRoom::kSessionFloors * kMiB + bytes);
    };
  });
}
/// Free pages of its database, which count as room, too.
std::uint64_t freePageBytes(RoomyServer& s) {
  auto reader = s.server.server().store().readers().borrow();
  const auto space = RetentionStore(**reader).space();
  EXPECT_TRUE(space.ok());
  return space.ok() ? space->free_bytes : 0;
}

// The finding: each repeated chunk used up room until the second check after it.
TEST(FullDisk, chunksThatComeAgainTakeNoRoomFromNewSessions) {
  constexpr std::uint64_t kRoom = 128u << 10;
  RoomyServer s = serverWithRoomFor(kRoom);
  auto station = s.server.connect(stationLogin("bench-1", s.server.addStation("bench-1")));
  ASSERT_TRUE(station.ok());
  const FakeSession lesson("bench-1");
  ASSERT_TRUE(isOpened(answerTo(*station, lesson.open())));
  // each byte counts twice, so half of them would suffice
  const std::uint64_t times = (kRoom + freePageBytes(s)) / FakeSession::bytes(0).size();
  for (std::uint64_t time = 0; time <= times; ++time) {
    ASSERT_TRUE(station->send(lesson.chunk(0)).ok());
    (void)waitFor(*station, [](const pb::Envelope& e) { return e.has_ack(); });
  }
  EXPECT_TRUE(isOpened(answerTo(*station, FakeSession("bench-1").open())));
}

TEST(FullDisk, aSessionThatIsOpenedAgainTakesNoRoomFromNewOnes) {
  constexpr std::uint64_t kRoom = 1u << 20, kProfile = 200'000;
  RoomyServer s = serverWithRoomFor(kRoom);
  auto station = s.server.connect(stationLogin("bench-1", s.server.addStation("bench-1")));
  ASSERT_TRUE(station.ok());
  const FakeSession lesson("bench-1");
  const auto open = lesson.open("{" + std::string(kProfile - 2, ' ') + "}");
  const std::uint64_t times = (kRoom + freePageBytes(s)) / kProfile;
  for (std::uint64_t time = 0; time <= times; ++time) ASSERT_TRUE(isOpened(answerTo(*station, open))) << time;
  EXPECT_TRUE(isOpened(answerTo(*station, FakeSession("bench-1").open())));
}

TEST(FullDisk, refusesFirstNewSessionsThenChunksAndReadsOn) {
  RoomyServer s;
  const std::string key = s.server.addStation("bench-1");
  s.server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  auto station = s.server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(station.ok());
  const FakeSession lesson("bench-1");
  ASSERT_TRUE(isOpened(answerTo(*station, lesson.open())));
  ASSERT_TRUE(station->send(lesson.chunk(0)).ok());
  lesson.waitForAck(*station, 1);

  s.leave(200);
  const auto fresh = [] { return FakeSession("bench-1").open(); };
  const auto late = answerAsWanted(*station, fresh, isRefused);
  ASSERT_EQ(late.refusal().reason(), pb::Refusal::NO_ROOM);
  EXPECT_THAT(late.refusal().text(), HasSubstr("make room"));
  // a lesson that has begun is still stored
  ASSERT_TRUE(station->send(lesson.chunk(1)).ok());
  lesson.waitForAck(*station, 2);
  EXPECT_TRUE(isOpened(answerTo(*station, lesson.open()))) << "and may be opened again after a lost link";

  s.leave(20);
  std::uint64_t stored = 2;
  for (std::uint64_t seq = 2;; ++seq) {
    ASSERT_TRUE(station->send(lesson.chunk(seq)).ok());
    const auto answer = waitFor(*station, [&](const pb::Envelope& e) {
      return e.has_refusal() || (e.has_ack() && e.ack().committed_seqs() > seq);
    });
    ASSERT_TRUE(answer.has_refusal() || answer.has_ack());
    if (answer.has_ack()) {
      stored = answer.ack().committed_seqs();
      continue;
    }
    EXPECT_EQ(answer.refusal().reason(), pb::Refusal::NO_ROOM);
    EXPECT_TRUE(answer.refusal().fatal()) << "so that the station sends again what came after it";
    break;
  }
  station = s.server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(station.ok()) << "log-in continues";
  EXPECT_EQ(answerTo(*station, lesson.open()).refusal().reason(), pb::Refusal::NO_ROOM);
  auto chief = s.server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(chief.ok()) << chief.error().message;
  EXPECT_EQ(readableChunks(*chief, lesson), static_cast<int>(stored));
  pb::Request retention;
  retention.mutable_run_retention()->set_dry_run(true);
  const auto ran = chief->call(retention);
  EXPECT_TRUE(ran.ok()) << ran.error().message;

  s.leave(10'000);
  const auto again = answerAsWanted(
      *station, [&] { return lesson.open(); }, isOpened);
  ASSERT_TRUE(again.has_session_opened());
  EXPECT_EQ(again.session_opened().next_seq(), stored) << "acknowledged data are there, and nothing else";
  ASSERT_TRUE(station->send(lesson.chunk(stored)).ok());
  lesson.waitForAck(*station, stored + 1);
  EXPECT_FALSE(s.server.server().store().writer().failed());
}

TEST(FullDisk, aServerStartedOnAFullDiskReadsAndRecovers) {
  RoomyServer s;
  const std::string key = s.server.addStation("bench-1");
  s.server.addUser("chief", pb::ADMINISTRATOR, kPassword);
  const FakeSession lesson("bench-1");
  {
    auto station = s.server.connect(stationLogin("bench-1", key));
    ASSERT_TRUE(station.ok());
    ASSERT_TRUE(isOpened(answerTo(*station, lesson.open())));
    for (std::uint64_t seq = 0; seq < 3; ++seq) ASSERT_TRUE(station->send(lesson.chunk(seq)).ok());
    lesson.waitForAck(*station, 3);
  }
  EXPECT_EQ(s.server.stop(), kExitDone);
  s.leave(1);
  s.server.start();
  ASSERT_TRUE(s.server.server().store().readOnly());
  EXPECT_THAT(s.server.server().store().readOnly()->message, HasSubstr("make room"));
  auto chief = s.server.connect(personLogin("chief", kPassword));
  ASSERT_TRUE(chief.ok()) << chief.error().message;
  EXPECT_EQ(readableChunks(*chief, lesson), 3);
  pb::Request change;
  change.mutable_add_station()->set_name("bench-2");
  const auto refused = chief->call(change);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom) << refused.error().message;
  auto station = s.server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(station.ok()) << station.error().message;
  EXPECT_EQ(answerTo(*station, lesson.open()).refusal().reason(), pb::Refusal::NO_ROOM);
  // this is the only level that needs a restart
  s.leave(10'000);
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (s.server.connect(stationLogin("bench-1", key)).ok() && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(milliseconds(20));
  EXPECT_EQ(s.server.stop(), kExitFailed) << "for the service manager, which starts it again";
  s.server.start();
  EXPECT_FALSE(s.server.server().store().readOnly());
  station = s.server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(station.ok());
  EXPECT_EQ(answerTo(*station, lesson.open()).session_opened().next_seq(), 3u);
  ASSERT_TRUE(station->send(lesson.chunk(3)).ok());
  lesson.waitForAck(*station, 4);
}

}  // namespace
}  // namespace needlelab::test
