// What a message costs the server before and after parsing: which are refused by their first bytes, which are
// parsed on another thread, how much memory they may use together.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/wire/protocol.h"
#include "db/people/people.h"
#include "tests/unit/server/live/raw_peer.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;

constexpr const char* kLongPassword = "correct horse battery";

/// A peer new to the server that has logged in.
struct LoggedIn : RawPeer {
  LoggedIn(RunningServer& server, const std::string& name, pb::Role role) : RawPeer(server) {
    server.addUser(name, role, kLongPassword);
    EXPECT_TRUE(logIn(personLogin(name, kLongPassword)).has_welcome());
  }
};

/// SetReference with this many empty session ids: 2 bytes each on the wire, 64 in memory.
pb::Envelope referenceOfNothing(std::uint64_t id, int ids) {
  pb::Envelope envelope;
  envelope.mutable_request()->set_id(id);
  auto& reference = *envelope.mutable_request()->mutable_set_reference();
  for (int i = 0; i < ids; ++i) reference.add_session_ids();
  return envelope;
}

/// Sends the messages, then a Ping; returns the answers before its Pong.
std::vector<pb::Envelope> answersTo(RawPeer& peer, const std::vector<pb::Envelope>& messages) {
  for (const pb::Envelope& message : messages) peer.send(message);
  pb::Envelope ping;
  ping.mutable_ping()->set_id(4711);
  peer.send(ping);
  std::vector<pb::Envelope> answers;
  while (auto got = peer.receive()) {
    if (got->has_pong() && got->pong().id() == 4711) return answers;
    answers.push_back(std::move(*got));
  }
  ADD_FAILURE() << "the connection ended";
  return answers;
}

/// Messages about a session whose id is a megabyte long.
std::vector<pb::Envelope> withLongSessionIds() {
  const std::string id(1'000'000, 'x');
  std::vector<pb::Envelope> messages(3);
  messages[0].mutable_open_session()->mutable_description()->set_session_id(id);
  messages[1].mutable_chunk()->set_session_id(id);
  messages[2].mutable_close_session()->set_session_id(id);
  return messages;
}

// The finding: 40 connections of one trainee held 475 MB of unread refusals.
TEST(MessageBounds, aRefusalRepeatsNoLongSessionId) {
  RunningServer server;
  RawPeer station(server);
  ASSERT_TRUE(station.logIn(stationLogin("bench-1", server.addStation("bench-1"))).has_welcome());
  const FakeSession session("bench-1");
  station.send(session.open());  // chunks are legal from now on
  std::size_t refused = 0;
  for (const pb::Envelope& answer : answersTo(station, withLongSessionIds())) {
    if (!answer.has_refusal()) continue;
    ++refused;
    EXPECT_NE(answer.refusal().reason(), pb::Refusal::STATE) << answer.refusal().text();
    EXPECT_EQ(answer.refusal().session_id(), "");
    EXPECT_LT(answer.ByteSizeLong(), 2 * kMaxRefusalBytes);
  }
  EXPECT_EQ(refused, 3u);
}

TEST(MessageBounds, tooFrequentMessagesAreRefusedWithoutTheirSessionId) {
  RunningServer server([](ServerOptions& options) {
    options.bounds.small_messages_at_once = 2;  // Hello and Login
    options.bounds.small_messages_per_s = 1e-9;
  });
  LoggedIn tina(server, "tina", pb::TRAINEE);
  for (int ping = 0; ping < 2; ++ping) EXPECT_TRUE(answersTo(tina, {}).empty());
  const auto messages = withLongSessionIds();
  for (const std::size_t i : {std::size_t{0}, std::size_t{2}}) {
    tina.send(messages[i]);
    const auto answer = tina.receive();
    ASSERT_TRUE(answer.has_value());
    EXPECT_EQ(answer->refusal().reason(), pb::Refusal::RATE_LIMITED);
    EXPECT_EQ(answer->refusal().session_id(), "");
    EXPECT_LT(answer->ByteSizeLong(), 2 * kMaxRefusalBytes);
  }
}

TEST(MessageBounds, aCallThatIsNotForTheRoleIsRefusedUnparsed) {
  RunningServer server;
  LoggedIn tina(server, "tina", pb::TRAINEE);
  const auto answers = answersTo(tina, {referenceOfNothing(5, 524'200), referenceOfNothing(6, 524'200)});
  ASSERT_EQ(answers.size(), 2u);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    EXPECT_EQ(answers[i].refusal().reason(), pb::Refusal::ROLE);
    EXPECT_FALSE(answers[i].refusal().fatal());
    EXPECT_EQ(answers[i].refused_request(), 5 + i);
    EXPECT_THAT(answers[i].refusal().text(), HasSubstr("'reference set' is not for the role trainee"));
  }
  EXPECT_EQ(server.stop(), 0);
  const ServerCounters& counters = server.counters();
  EXPECT_EQ(counters.messages_refused_unparsed, 2u);
  EXPECT_EQ(counters.messages_parsed, 3u) << "Hello, Login, Ping";
  EXPECT_EQ(counters.messages_parsed_off_thread, 0u);
  EXPECT_LT(counters.decoded_bytes, 16u << 10);
}

TEST(MessageBounds, tooManyListItemsAreRefusedUnparsedWithTheBound) {
  RunningServer server;
  LoggedIn ada(server, "ada", pb::ADMINISTRATOR);
  const auto answers = answersTo(ada, {referenceOfNothing(5, 10'001)});
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].refusal().reason(), pb::Refusal::TOO_LARGE);
  EXPECT_EQ(answers[0].refused_request(), 5u);
  EXPECT_EQ(answers[0].refusal().text(),
            "request.set_reference.session_ids has more than 10000 items: send fewer at once");
  EXPECT_EQ(server.stop(), 0);
  EXPECT_EQ(server.counters().messages_refused_unparsed, 1u);
  EXPECT_EQ(server.counters().messages_parsed, 3u);
}

TEST(MessageBounds, onlyLargeMessagesAreParsedOnAnotherThread) {
  RunningServer server;
  auto station = server.connect(stationLogin("bench-1", server.addStation("bench-1")));
  ASSERT_TRUE(station.ok()) << station.error().message;
  FakeSession session("bench-1");
  // the profile is text, which is scanned letter by letter; that it is not a profile is noticed later
  ASSERT_TRUE(station->send(session.open("\"" + std::string(100'000, 'x') + "\"")).ok());
  (void)waitFor(*station, [](const pb::Envelope& e) { return e.has_session_opened() || e.has_refusal(); });
  FakeSession small("bench-1");
  ASSERT_TRUE(station->send(small.open()).ok());
  (void)waitFor(*station, [](const pb::Envelope& e) { return e.has_session_opened(); });
  // whatever the store does with it: the Pong comes after parsing
  pb::Envelope chunk = small.chunk(0), ping;
  chunk.mutable_chunk()->mutable_data()->append(std::string(100'000, 'x'));
  ping.mutable_ping()->set_id(9);
  ASSERT_TRUE(station->send(chunk).ok());
  ASSERT_TRUE(station->send(ping).ok());
  (void)waitFor(*station, [](const pb::Envelope& e) { return e.has_pong() && e.pong().id() == 9; });
  station->finish();
  EXPECT_EQ(server.stop(), 0);
  EXPECT_EQ(server.counters().messages_parsed_off_thread, 1u);
  EXPECT_GE(server.counters().decoded_bytes, 200'000u);
}

TEST(MessageBounds, messagesKeepTheirOrderOnEveryThread) {
  RunningServer server([](ServerOptions& options) { options.bounds.parsed_here_bytes = 20; });
  RawPeer station(server);
  ASSERT_TRUE(station.logIn(stationLogin("bench-1", server.addStation("bench-1"))).has_welcome());
  std::string all;
  for (std::uint64_t id = 1; id <= 50; ++id) {
    pb::Envelope ping;
    ping.mutable_ping()->set_id(id);
    // every second one is long enough for the other thread
    if (id % 2 == 0)
      ping.mutable_ping()
          ->GetReflection()
          ->MutableUnknownFields(ping.mutable_ping())
          ->AddLengthDelimited(777, std::string(200, 'x'));
    all += RawPeer::framed(ping);
  }
  station.write(all);
  std::uint64_t seen = 0;
  while (seen < 50) {
    const auto got = station.receive();
    ASSERT_TRUE(got.has_value());
    if (!got->has_pong()) continue;
    EXPECT_EQ(got->pong().id(), seen + 1);
    ++seen;
  }
  EXPECT_EQ(server.stop(), 0);
  EXPECT_GE(server.counters().messages_parsed_off_thread, 25u);
}

TEST(MessageBounds, whatWouldTakeMoreThanTheBudgetIsRefusedUnparsed) {
  RunningServer server([](ServerOptions& options) { options.bounds.decoded.person = 100'000; });
  LoggedIn ada(server, "ada", pb::ADMINISTRATOR);
  const auto answers = answersTo(ada, {referenceOfNothing(5, 10'000)});
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].refusal().reason(), pb::Refusal::TOO_LARGE);
  EXPECT_THAT(answers[0].refusal().text(), HasSubstr("at most 100000 are allowed"));
  EXPECT_EQ(server.stop(), 0);
  EXPECT_EQ(server.counters().messages_parsed, 3u);
}

/// Gives the body a field of a newer version, so that it has this many bytes.
void padBody(google::protobuf::Message& body, std::size_t bytes) {
  auto& unknown = *body.GetReflection()->MutableUnknownFields(&body);
  // plus a two-byte tag and a two-byte length
  unknown.AddLengthDelimited(777, std::string(bytes - body.ByteSizeLong() - 4, 'x'));
  ASSERT_EQ(body.ByteSizeLong(), bytes);
}

// The finding: ClockOffsets of 0.9 MB waited for the writer without being counted: 920 MB with one station's
// key.
TEST(MessageBounds, smallMessagesThatAreLongAreRefusedUnparsed) {
  RunningServer server;
  RawPeer peer(server);
  ASSERT_TRUE(peer.logIn(stationLogin("bench-1", server.addStation("bench-1"))).has_welcome());
  const FakeSession session("bench-1");
  peer.send(session.open());
  while (const auto got = peer.receive())
    if (got->has_session_opened()) break;
  const auto refusalTo = [&](auto field, std::size_t bytes) {
    pb::Envelope envelope;
    padBody(*field(envelope), bytes);
    const auto answers = answersTo(peer, {envelope});
    return answers.empty() || !answers.back().has_refusal() ? pb::Refusal() : answers.back().refusal();
  };
  const auto clockOffsetOf = [&](pb::Envelope& e) {
    e.mutable_clock_offset()->set_session_id(session.id());
    e.mutable_clock_offset()->set_round_trip_ns(1);
    return e.mutable_clock_offset();
  };
  const auto pingOf = [](pb::Envelope& e) { return e.mutable_ping(); };
  const auto pongOf = [](pb::Envelope& e) { return e.mutable_pong(); };
  const auto statusOf = [](pb::Envelope& e) { return e.mutable_station_status(); };
  const auto expect = [](const pb::Refusal& refusal, const std::string& text) {
    EXPECT_EQ(refusal.reason(), pb::Refusal::TOO_LARGE);
    EXPECT_FALSE(refusal.fatal());
    EXPECT_EQ(refusal.text(), text);
  };
  expect(refusalTo(clockOffsetOf, 4097), "clock_offset has 4097 bytes, at most 4096 are allowed");
  expect(refusalTo(pingOf, 4097), "ping has 4097 bytes, at most 4096 are allowed");
  expect(refusalTo(pongOf, 4097), "pong has 4097 bytes, at most 4096 are allowed");
  expect(refusalTo(statusOf, 2049), "a status line of 2049 bytes: the limit is 2048");
  EXPECT_EQ(refusalTo(clockOffsetOf, 4096).text(), "");
  EXPECT_EQ(refusalTo(pingOf, 4096).text(), "");
  EXPECT_EQ(refusalTo(pongOf, 4096).text(), "");
  EXPECT_EQ(refusalTo(statusOf, 2048).text(), "");
  EXPECT_EQ(server.stop(), 0);
  EXPECT_EQ(server.counters().messages_refused_unparsed, 4u);
}

// A chunk waits for the writer with its data bytes, which the bound on chunks counts.
TEST(MessageBounds, aChunksOtherFieldsCountTowardsTheBudget) {
  RunningServer server([](ServerOptions& options) { options.bounds.decoded.station = 100'000; });
  RawPeer peer(server);
  ASSERT_TRUE(peer.logIn(stationLogin("bench-1", server.addStation("bench-1"))).has_welcome());
  const FakeSession session("bench-1");
  peer.send(session.open());
  while (const auto got = peer.receive())
    if (got->has_session_opened()) break;
  auto chunk = session.chunk(0);
  auto& body = *chunk.mutable_chunk();
  auto& unknown = *body.GetReflection()->MutableUnknownFields(&body);
  for (int i = 0; i < 30'000; ++i) unknown.AddVarint(777, 1);
  peer.send(chunk);
  std::optional<pb::Envelope> got;
  while ((got = peer.receive()))
    if (got->has_refusal()) break;
  ASSERT_TRUE(got.has_value());
  EXPECT_EQ(got->refusal().reason(), pb::Refusal::TOO_LARGE);
  EXPECT_THAT(got->refusal().text(), HasSubstr("at most 100000 are allowed"));
  // the same number of data bytes does not count in this budget
  auto large = session.chunk(0);
  large.mutable_chunk()->set_data(std::string(200'000, 'x'));
  peer.send(large);
  while ((got = peer.receive()))
    if (got->has_refusal()) break;
  ASSERT_TRUE(got.has_value());
  EXPECT_NE(got->refusal().reason(), pb::Refusal::TOO_LARGE) << got->ShortDebugString();
}

// Two requests of which only one fits at a time: the second waits until the first ends, and is answered.
TEST(MessageBounds, whoFindsNoRoomWaitsForIt) {
  RunningServer server([](ServerOptions& options) { options.bounds.decoded.person = 40'000; });
  LoggedIn ines(server, "ines", pb::INSTRUCTOR);
  std::string all;
  for (std::uint64_t id = 1; id <= 20; ++id) {
    pb::Envelope check;
    check.mutable_request()->set_id(id);
    check.mutable_request()->mutable_check_text()->set_json(std::string(30'000, ' '));
    all += RawPeer::framed(check);
  }
  ines.write(all);
  for (std::uint64_t id = 1; id <= 20; ++id) {
    const auto got = ines.receive();
    ASSERT_TRUE(got.has_value());
    EXPECT_EQ(got->reply().id(), id) << "one at a time, so in order; " << got->ShortDebugString();
  }
}

// The finding: a trainee requested 8 × 0.8 MB on 40 connections and read nothing: 110 MB.
TEST(MessageBounds, ignoringRepliesDelaysOnlyYourNextRequest) {
  constexpr int kConnections = 4, kPeople = 500;
  constexpr std::uint64_t kEach = 8, kOthers = 40;
  constexpr std::size_t kLongest = 1u << 20, kBound = 3 * kLongest;
  RunningServer server([](ServerOptions& options) {
    options.bounds.replies.person = kBound;
    options.limits.socket_buffer_bytes = 64 << 10;  // less than a reply
    options.limits.write_timeout = std::chrono::minutes(1);
  });
  std::string csv = "name,full_name\n";
  for (int i = 0; i < kPeople; ++i) csv += "s" + std::to_string(i) + "," + std::string(190, 'x') + "\n";
  pb::Request import;
  import.mutable_import_people()->set_csv(csv);
  ASSERT_TRUE(server.asAdmin(import).people_import().done());
  server.addUser("ines", pb::INSTRUCTOR, kLongPassword);
  server.addUser("bert", pb::INSTRUCTOR, kLongPassword);
  std::vector<std::unique_ptr<RawPeer>> peers;
  for (int i = 0; i < kConnections; ++i) {
    peers.push_back(std::make_unique<RawPeer>(server));
    ASSERT_TRUE(peers.back()->logIn(personLogin("ines", kLongPassword)).has_welcome());
  }
  RawPeer bert(server);
  ASSERT_TRUE(bert.logIn(personLogin("bert", kLongPassword)).has_welcome());
  pb::Envelope list, own;
  list.mutable_request()->mutable_list_users();
  own.mutable_request()->mutable_get_user()->set_name("bert");
  for (const auto& peer : peers) {
    for (std::uint64_t id = 1; id <= kEach; ++id) {
      list.mutable_request()->set_id(id);
      peer->send(list);
    }
  }
  // the workers take turns: with each of these one of the others completes, if permitted
  for (std::uint64_t id = 1; id <= kOthers; ++id) {
    own.mutable_request()->set_id(id);
    bert.send(own);
    auto got = bert.receive();
    while (got && got->has_ping()) got = bert.receive();
    ASSERT_TRUE(got.has_value());
    EXPECT_EQ(got->reply().id(), id) << "others continue; " << got->ShortDebugString();
  }
  // all of it arrives once it is read: four in parallel, because the three with a reply may be those read
  // last
  std::vector<std::thread> readers;
  for (const auto& peer : peers) {
    readers.emplace_back([&] {
      for (std::uint64_t answered = 0; answered < kEach; ++answered) {
        auto got = peer->receive();
        while (got && got->has_ping()) got = peer->receive();  // on a slow machine
        ASSERT_TRUE(got.has_value());
        EXPECT_GE(got->reply().users().users_size(), kPeople) << got->ShortDebugString().substr(0, 200);
        EXPECT_GT(got->ByteSizeLong(), 190u * kPeople);
      }
    });
  }
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(server.stop(), 0);
  const std::uint64_t most = server.counters().max_reply_bytes;
  EXPECT_GT(most, kBound / 2);
  EXPECT_LE(most, kBound + kLongest) << "and the room of the other person's reply";
}

TEST(MessageBounds, twoCallsInOneRequestEndTheConnection) {
  RunningServer server;
  LoggedIn tina(server, "tina", pb::TRAINEE);
  pb::Envelope allowed;
  allowed.mutable_request()->mutable_list_profiles();
  const std::string body =
      referenceOfNothing(1, 1000).SerializeAsString() + allowed.SerializeAsString();  // merged by Protobuf
  std::string bytes;
  appendFrameHeader(bytes, body.size());
  tina.write(bytes + body);
  const auto answers = tina.readAll();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].refusal().reason(), pb::Refusal::INVALID);
  EXPECT_TRUE(answers[0].refusal().fatal());
  EXPECT_THAT(answers[0].refusal().text(), HasSubstr("more than one body"));
}

// --- log-ins that could not be checked

TEST(LogInCheck, whatCouldNotBeCheckedIsNoGuess) {
  RunningServer server([](ServerOptions& options) { options.guard.allowed_per_name = 2; });
  server.addUser("anna", pb::INSTRUCTOR, kLongPassword);
  const auto withHash = [&](const std::function<void(std::string&)>& change) {
    return server.server().store().writer().run([&](Connection& c) -> Status {
      ASSIGN_OR_RETURN(auto person, PeopleStore(c).find("anna"));
      std::string hash = person->password_hash;
      change(hash);
      return PeopleStore(c).setPasswordHash("anna", hash);
    });
  };
  std::string real;
  ASSERT_TRUE(withHash([&](std::string& hash) {
                real = hash;
                hash.replace(hash.find("m="), hash.find(",t=") - hash.find("m="), "m=4294967296");
              }).ok());
  for (int i = 0; i < 5; ++i) {
    const auto answer = RawPeer(server).logIn(personLogin("anna", kLongPassword));
    EXPECT_EQ(answer.refusal().reason(), pb::Refusal::INTERNAL) << "not LOGIN, not RATE_LIMITED";
  }
  ASSERT_TRUE(withHash([&](std::string& hash) { hash = real; }).ok());
  EXPECT_TRUE(RawPeer(server).logIn(personLogin("anna", kLongPassword)).has_welcome());
}

// --- what ends with an account, and what does not

TEST(Access, aDisabledInstructorsLiveFramesEndAndATraineesLessonGoesOn) {
  RunningServer server;
  auto station = server.connect(stationLogin("bench-1", server.addStation("bench-1")));
  server.addUser("ines", pb::INSTRUCTOR, kLongPassword);
  server.addUser("tina", pb::TRAINEE, kLongPassword);
  server.addUser("chief", pb::ADMINISTRATOR, kLongPassword);
  auto ines = server.connect(personLogin("ines", kLongPassword));
  auto chief = server.connect(personLogin("chief", kLongPassword));
  ASSERT_TRUE(station.ok() && ines.ok() && chief.ok());
  const FakeSession session("bench-1");  // tina's
  ASSERT_TRUE(station->send(session.open()).ok());
  (void)waitFor(*station, [](const pb::Envelope& e) { return e.has_session_opened(); });
  pb::Envelope subscribe;
  subscribe.mutable_subscribe()->set_subscription(1);
  subscribe.mutable_subscribe()->set_station("bench-1");
  ASSERT_TRUE(ines->send(subscribe).ok());
  (void)waitFor(*ines, [](const pb::Envelope& e) { return e.has_subscribed(); });
  EXPECT_TRUE(
      waitFor(*station, [](const pb::Envelope& e) { return e.has_watch_state(); }).watch_state().watched());

  pb::Request disable;
  disable.mutable_disable_user()->set_name("ines");
  ASSERT_TRUE(chief->call(disable).ok());
  const auto refusal = waitForRefusal(*ines);
  EXPECT_EQ(refusal.reason(), pb::Refusal::LOGIN);
  EXPECT_TRUE(refusal.fatal());
  EXPECT_FALSE(
      waitFor(*station, [](const pb::Envelope& e) { return e.has_watch_state(); }).watch_state().watched())
      << "the station sends its frames to no one any more";

  disable.mutable_disable_user()->set_name("tina");
  ASSERT_TRUE(chief->call(disable).ok());
  ASSERT_TRUE(station->send(session.chunk(0)).ok());
  session.waitForAck(*station, 1);
  ASSERT_TRUE(station->send(session.close(1)).ok());
  (void)waitFor(*station, [](const pb::Envelope& e) { return e.has_session_closed(); });
  pb::Request lesson;
  lesson.mutable_get_lesson()->set_exercise_id("ball-free-practice");
  lesson.mutable_get_lesson()->set_trainee("tina");
  const auto next = station->call(lesson);
  ASSERT_FALSE(next.ok());
  EXPECT_THAT(next.error().message, HasSubstr("no one named 'tina' who may practise"));
}

}  // namespace
}  // namespace needlelab
