#include "db/sessions/session_results.h"

#include <google/protobuf/util/message_differencer.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using google::protobuf::util::MessageDifferencer;

pb::SyringeEvent anEvent(pb::SyringeEvent::Kind kind, std::uint64_t tick) {
  pb::SyringeEvent event;
  event.set_kind(kind);
  event.set_begin_tick(tick);
  event.set_end_tick(tick + 700);
  event.set_begin_s(0.001 * static_cast<double>(tick));
  event.set_end_s(0.001 * static_cast<double>(tick + 700));
  event.set_plunger_from(0.2);
  event.set_plunger_to(1.0 / 3);
  event.set_in_tissue_share(0.75);
  event.set_in_target_share(0.1);
  auto& begin = *event.mutable_begin();
  begin.set_x_m(0.1);
  begin.set_y_m(-0.2);
  begin.set_z_m(0.3);
  begin.set_in_tissue(true);
  begin.set_layer(3);
  begin.set_tissue("BURSA");
  begin.set_insertion_m(0.022);
  begin.set_depth_m(0.021);
  begin.set_target("subacromial bursa");
  begin.set_target_distance_m(-0.0004);
  begin.set_hazard("nerve, Größe's");
  auto& end = *event.mutable_end();
  end.set_z_m(0.01);
  end.set_layer(-1);
  end.set_depth_m(-0.01);
  event.add_hazards("nerve, Größe's");
  event.add_hazards("artery");
  return event;
}

/// A closed session of one chunk.
Uuid closedSession(test::TestDb& db) {
  const Uuid id = makeUuidV7();
  SessionStore sessions(db.writer);
  EXPECT_OK(sessions.open(test::describe(id), 1));
  EXPECT_OK(sessions.append(id, 0, test::chunkOf(0)));
  EXPECT_OK(sessions.close(test::closeOf(id, 1), 2));
  return id;
}

TEST(SessionResults, eventsComeBackInOrder) {
  test::TestDb db;
  const Uuid id = closedSession(db);
  EventStore store(db.writer);
  auto list = store.list(id);
  ASSERT_OK(list);
  EXPECT_FALSE(list->has_value()) << "no one has looked for events yet";

  const std::vector<pb::SyringeEvent> events = {anEvent(pb::SyringeEvent::ASPIRATION, 500),
                                                anEvent(pb::SyringeEvent::INJECTION, 2000)};
  ASSERT_OK(store.put(id, events));
  Connection reader = db.reader();
  list = EventStore(reader).list(id);
  ASSERT_OK(list);
  ASSERT_TRUE(list->has_value());
  ASSERT_EQ((*list)->size(), 2u);
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_TRUE(MessageDifferencer::Equals((**list)[i], events[i])) << (**list)[i].DebugString();
}

TEST(SessionResults, noneIsAnAnswerToo) {
  test::TestDb db;
  const Uuid id = closedSession(db);
  ASSERT_OK(EventStore(db.writer).put(id, {}));
  const auto list = EventStore(db.writer).list(id);
  ASSERT_OK(list);
  ASSERT_TRUE(list->has_value());
  EXPECT_TRUE((*list)->empty());
}

TEST(SessionResults, whatWasPutOnceStays) {
  test::TestDb db;
  const Uuid id = closedSession(db);
  EventStore store(db.writer);
  const std::vector<pb::SyringeEvent> one = {anEvent(pb::SyringeEvent::INJECTION, 5)};
  ASSERT_OK(store.put(id, one));
  ASSERT_OK(store.put(id, {}));
  EXPECT_EQ((*store.list(id))->size(), 1u);
}

TEST(SessionResults, eventsWantAClosedSession) {
  test::TestDb db;
  EventStore store(db.writer);
  EXPECT_EQ(store.put(makeUuidV7(), {}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store.list(makeUuidV7()).error().code, ErrorCode::kNotFound);
  const Uuid id = makeUuidV7();
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  EXPECT_EQ(store.put(id, {}).error().code, ErrorCode::kInvalidInput);
  EXPECT_FALSE(store.list(id)->has_value());
}

TEST(SessionResults, theDatabaseRefusesInvalidRows) {
  test::TestDb db;
  const Uuid id = closedSession(db);
  auto event = anEvent(pb::SyringeEvent::INJECTION, 5);
  event.set_kind(pb::SyringeEvent::KIND_UNSPECIFIED);
  const std::vector<pb::SyringeEvent> wrong = {event};
  EXPECT_FALSE(EventStore(db.writer).put(id, wrong).ok());
}

TEST(AnnotationStore, keepsThemByTick) {
  test::TestDb db;
  const Uuid id = makeUuidV7();
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  AnnotationStore notes(db.writer);
  const auto first = notes.add({0, id, 500, "too fast\nhere", "ina", 7});
  ASSERT_OK(first);
  ASSERT_OK(notes.add({0, id, 20, "good angle", "ina", 8}));
  const auto list = notes.list(id);
  ASSERT_OK(list);
  ASSERT_EQ(list->size(), 2u);
  EXPECT_EQ((*list)[0].tick, 20u);
  EXPECT_EQ((*list)[1].id, *first);
  EXPECT_EQ((*list)[1].text, "too fast\nhere");
}

TEST(AnnotationStore, givesThoseBehindAPlaceAndOneByItsId) {
  test::TestDb db;
  const Uuid id = makeUuidV7(), other = makeUuidV7();
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  ASSERT_OK(SessionStore(db.writer).open(test::describe(other), 1));
  AnnotationStore notes(db.writer);
  std::vector<std::pair<std::uint64_t, std::uint64_t>> places;  // tick, id
  for (std::uint64_t i = 0; i < 90; ++i) {
    const std::uint64_t tick = i % 3 == 0 ? 0 : i % 7;
    const auto added = notes.add({0, id, tick, "remark " + std::to_string(i), "ina", 1});
    ASSERT_OK(added);
    places.emplace_back(tick, *added);
    ASSERT_OK(notes.add({0, other, tick, "of the other", "ina", 1}));
  }
  std::sort(places.begin(), places.end());
  const auto placesIn = [&](const std::optional<AnnotationPlace>& after, std::size_t most) {
    std::vector<std::pair<std::uint64_t, std::uint64_t>> listed;
    const auto page =
        notes.list(id, after, [&, left = most](const StoredAnnotation&) mutable { return left-- > 0; });
    EXPECT_OK(page);
    for (const StoredAnnotation& one : *page) listed.emplace_back(one.tick, one.id);
    return listed;
  };
  EXPECT_EQ(placesIn({}, 1000), places);
  for (const std::size_t size : {1u, 7u, 89u}) {
    std::vector<std::pair<std::uint64_t, std::uint64_t>> all;
    std::optional<AnnotationPlace> after;
    for (;;) {
      const auto page = placesIn(after, size);
      if (page.empty()) break;
      all.insert(all.end(), page.begin(), page.end());
      after = AnnotationPlace{page.back().first, page.back().second};
    }
    EXPECT_EQ(all, places) << size;
  }
  EXPECT_EQ(notes.textOf(id, places[0].second)->value_or(""), "remark 0");
  EXPECT_FALSE(notes.textOf(other, places[0].second)->has_value()) << "another session's";
  EXPECT_EQ(notes.find(id, "ina", "remark 0")->value_or(0), places[0].second);
  EXPECT_FALSE(notes.find(id, "mia", "remark 0")->has_value());
  EXPECT_FALSE(notes.find(id, "ina", "of the other")->has_value());
}

TEST(AnnotationStore, refusesEmptyHugeAndHomelessOnes) {
  test::TestDb db;
  const Uuid id = makeUuidV7();
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  AnnotationStore notes(db.writer);
  EXPECT_FALSE(notes.add({0, id, 1, "", "ina", 1}).ok());
  EXPECT_FALSE(notes.add({0, id, 1, std::string(5'000, 'x'), "ina", 1}).ok());
  EXPECT_FALSE(notes.add({0, id, UINT64_MAX, "x", "ina", 1}).ok());
  EXPECT_EQ(notes.add({0, makeUuidV7(), 1, "x", "ina", 1}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(notes.list(makeUuidV7()).error().code, ErrorCode::kNotFound);
}

}  // namespace

}  // namespace needlelab
