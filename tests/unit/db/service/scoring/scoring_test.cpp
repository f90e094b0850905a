// Scores under newer definitions, and their comparison with experts.
#include <gmock/gmock.h>

#include <barrier>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "common/base/bytes.h"
#include "common/base/text/uuid.h"
#include "common/gesture/chunk.h"
#include "common/profile/profile.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/motion/dtw.h"
#include "db/erasure/erasure.h"
#include "db/people/person_refs.h"
#include "db/service/scoring/rescoring.h"
#include "db/sessions/session_results.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

constexpr double kGestureRate_hz = 200;

/// Goes in and out of the knee within 3 s, `aside_m` beside the first path.
std::vector<GestureSample> gestureAside(double aside_m) {
  std::vector<GestureSample> samples(600);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    GestureSample& s = samples[i];
    const double t = static_cast<double>(i) / kGestureRate_hz, depth_m = 0.03 * std::sin(t * 1.05) - 0.005;
    s.tick = i;
    s.time_ns = static_cast<std::int64_t>(i) * 5'000'000;
    s.p_WT_m[0] = aside_m;
    s.p_WT_m[2] = -depth_m;
    s.q_WT[0] = 1;  // downwards: a reference must not touch the femur below
    s.q_WT[3] = 0;
    s.layer = depth_m > 0 ? 0 : -1;
    s.insertion_m = std::max(0.0, depth_m);
    s.force_W_N[2] = depth_m > 0 ? 1 + aside_m * 100 : 0;
  }
  return samples;
}

class Scoring : public test::ServiceTest {
 protected:
  void SetUp() override {
    addStation();
    pb::Request profile;
    profile.mutable_get_profile()->set_id("knee-adult");
    profile_json_ = get(admin, profile).profile().json();
  }
  /// A session of one chunk that claims this many samples, and its station's close.
  pb::CloseSession delivered(const Bytes& chunk, std::uint64_t samples, const std::string& exercise) {
    const Uuid id = makeUuidV7();
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto d = test::describe(id);
      d.set_trainee("anna");
      d.set_exercise_id(exercise);
      d.set_rate_hz(kGestureRate_hz);
      d.set_profile_json(profile_json_);
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      auto appended = SessionStore(c).append(id, 0, chunk);
      return appended ? Status() : Status(appended.error());
    }));
    SessionHash hash;
    hash.update(chunk);
    const Digest digest = hash.digest();
    pb::CloseSession close = test::closeOf(id, 1);
    close.set_samples(samples);
    close.set_hash(digest.data(), digest.size());
    return close;
  }
  Uuid closed(const Bytes& chunk, std::uint64_t samples, const std::string& exercise = "knee-recess") {
    const auto close = delivered(chunk, samples, exercise);
    EXPECT_OK(store->service().scoring().closeSession(close, "station-1"));
    return *uuidOf(close.session_id());
  }
  Uuid closed(const std::vector<GestureSample>& samples, const std::string& exercise = "knee-recess") {
    return closed(encodeChunk(Resolution::lossless(), samples), samples.size(), exercise);
  }
  struct InSteps {
    std::size_t steps = 0;
    CloseOutcome outcome;
  };
  InSteps closedInSteps(const std::vector<GestureSample>& samples) {
    CloseUnderWay close{
        delivered(encodeChunk(Resolution::lossless(), samples), samples.size(), "knee-recess"), "station-1"};
    InSteps done;
    while (++done.steps < 1000) {
      auto outcome = store->service().scoring().closeStep(close);
      EXPECT_OK(outcome);
      if (!outcome) break;
      if (!*outcome) continue;
      done.outcome = **outcome;
      break;
    }
    return done;
  }
  pb::Score scoreOf(const Uuid& id, std::uint32_t version = 0) {
    pb::Request request;
    request.mutable_get_score()->set_session_id(test::bytesOfId(id));
    request.mutable_get_score()->set_definition_version(version);
    return get(instructor, request).score();
  }
  /// Adds to the checksums of the n-th session's chunks; the opposite number repairs them.
  void damage(int n, int by) {
    ASSERT_OK(change([&](Connection& c) {
      return c.script("UPDATE chunks SET crc = crc + (" + std::to_string(by) +
                      ") WHERE session = (SELECT number FROM sessions ORDER BY number LIMIT 1 OFFSET " +
                      std::to_string(n) + ")");
    }));
  }
  /// Marks the stored scores as made by a program with other definitions.
  void makeOld() {
    ASSERT_OK(change([](Connection& c) {
      return c.script(
          "UPDATE scores SET definition_version = 1, measures = '[]'; UPDATE sessions SET score_json = '[]'");
    }));
  }
  pb::RescoreReport rescore(bool dry_run, const std::string& exercise = "") {
    pb::Request request;
    request.mutable_rescore_all()->set_dry_run(dry_run);
    request.mutable_rescore_all()->set_exercise_id(exercise);
    return get(manager, request).rescore_report();
  }

  std::string profile_json_;
};

TEST_F(Scoring, aStoredSessionHasTheMeasuresOfItsSamplesBitForBit) {
  const auto samples = gestureAside(0.001);
  const Uuid id = closed(samples);
  const auto profile = parseProfile(profile_json_, "knee");
  ASSERT_OK(profile);
  pb::Request show;
  show.mutable_get_session()->set_session_id(test::bytesOfId(id));
  const auto stored = parseScore(get(instructor, show).session().score_json());
  ASSERT_OK(stored);
  const auto expected = scoreGesture(samples, kGestureRate_hz, *profile, {});
  std::size_t compared = 0;
  for (const Measure& row : expected) {
    for (const Measure& other : *stored) {
      if (other.name != row.name) continue;
      EXPECT_EQ(other.value, row.value) << row.name;
      ++compared;
    }
  }
  EXPECT_EQ(compared, expected.size());
}

TEST_F(Scoring, outdatedScoresAreRecomputedAndTheOldOnesStay) {
  std::vector<Uuid> ids;
  for (int i = 0; i < 4; ++i)
    ids.push_back(closed(gestureAside(0.001 * i), i == 3 ? "wrist-carpal" : "knee-recess"));
  EXPECT_EQ(rescore(false).rescored(), 0u) << "all are of the definitions of now";
  makeOld();
  // a session that can no longer be scored
  ASSERT_OK(change([&](Connection& c) {
    return c.run("UPDATE sessions SET profile_json = '{}' WHERE id = ?", ByteView(ids[1]));
  }));

  const auto dry = rescore(true);
  EXPECT_TRUE(dry.dry_run());
  EXPECT_EQ(dry.rescored(), 4u);
  EXPECT_EQ(rescore(true, "wrist-carpal").rescored(), 1u);
  EXPECT_EQ(scoreOf(ids[0]).definition_version(), 1u) << "a dry run changes nothing";

  // a run stopped after its first session; the next one continues
  std::atomic<bool> stop = false;
  const RescoreTools tools{store->writer(),
                           store->readers(),
                           [&](Connection& reader, const Uuid& id) {
                             stop = true;
                             return store->service().scoring().scoreSession(reader, id);
                           },
                           [] { return false; },
                           stop,
                           {}};
  const auto first = runRescoring(tools, "", {"mia"}, false);
  ASSERT_OK(first);
  EXPECT_TRUE(first->stopped());
  EXPECT_EQ(first->rescored(), 1u);

  const auto rest = rescore(false);
  EXPECT_FALSE(rest.stopped());
  EXPECT_EQ(rest.rescored(), 2u);
  EXPECT_EQ(rest.left_alone(), 1u);
  ASSERT_EQ(rest.faults_size(), 1);
  EXPECT_EQ(rest.faults(0).session_id(), test::bytesOfId(ids[1]));
  EXPECT_FALSE(rest.faults(0).text().empty());
  for (const int i : {0, 2, 3}) {
    const auto now = scoreOf(ids[static_cast<std::size_t>(i)]);
    EXPECT_EQ(now.definition_version(), kScoreDefinitionVersion);
    EXPECT_FALSE(now.first());
    EXPECT_THAT(now.measures_json(), HasSubstr("peak_force_n"));
    EXPECT_EQ(scoreOf(ids[static_cast<std::size_t>(i)], 1).measures_json(), "[]") << "the old one stays";
  }
  pb::Request audit;
  audit.mutable_list_audit()->set_limit(5);
  const auto lines = get(admin, audit).audit();
  ASSERT_GE(lines.entries_size(), 2);
  EXPECT_EQ(lines.entries(0).action(), "rescore all");
  EXPECT_THAT(lines.entries(0).detail(), HasSubstr("2 sessions scored by definition version"));
  EXPECT_THAT(lines.entries(1).detail(), HasSubstr("stopped"));
}

TEST_F(Scoring, aSessionIsComparedWithTheExpertsPathsToo) {
  std::vector<Uuid> experts;
  for (int i = 0; i < 5; ++i) experts.push_back(closed(gestureAside(0.001 * i)));
  pb::Request set;
  set.mutable_set_reference()->set_exercise_id("knee-recess");
  for (const Uuid& id : experts) set.mutable_set_reference()->add_session_ids(test::bytesOfId(id));
  const auto reference = get(instructor, set).reference();
  const auto band = std::find_if(reference.bands().begin(), reference.bands().end(),
                                 [](const auto& b) { return b.measure() == "dtw_distance_m"; });
  ASSERT_NE(band, reference.bands().end());
  EXPECT_EQ(band->n(), 5u);
  EXPECT_NEAR(band->mean(), 0.001, 1e-9) << "each is 1 mm beside the next";

  // 10 mm beside the last one: stored with the score, and in the comparison
  const Uuid novice = closed(gestureAside(0.014));
  const auto score = scoreOf(novice);
  const auto rows = parseScore(score.measures_json());
  ASSERT_OK(rows);
  const auto stored =
      std::find_if(rows->begin(), rows->end(), [](const Measure& m) { return m.name == "dtw_distance_m"; });
  ASSERT_NE(stored, rows->end());
  EXPECT_NEAR(stored->value, 0.01, 1e-9);
  const auto comparison = nlohmann::json::parse(score.comparison_json());
  const auto row = std::find_if(comparison.begin(), comparison.end(),
                                [](const auto& r) { return r["measure"] == "dtw_distance_m"; });
  ASSERT_NE(row, comparison.end());
  EXPECT_NEAR((*row)["value"].get<double>(), 0.01, 1e-9);
  EXPECT_TRUE((*row)["place"].is_null()) << "the experts' own distances are all 1 mm: nothing is said";
  EXPECT_EQ((*row)["words"], "");
  const auto force = std::find_if(comparison.begin(), comparison.end(),
                                  [](const auto& r) { return r["measure"] == "peak_force_n"; });
  ASSERT_NE(force, comparison.end());
  // layers are named as in the session's profile
  EXPECT_EQ((*force)["words"].get<std::string>().find("Peak force 2.4 N"), 0u);
  const auto skin = std::find_if(comparison.begin(), comparison.end(),
                                 [](const auto& r) { return r["measure"] == "peak_force_layer_1_n"; });
  ASSERT_NE(skin, comparison.end());
  EXPECT_EQ((*skin)["words"].get<std::string>().find("Peak force in skin 2.4 N"), 0u) << *skin;
  // experts 1, 1.1 … 1.4 N; the novice 2.4 N
  EXPECT_EQ((*force)["place"], "above");
  EXPECT_NEAR((*force)["least"].get<double>(), 1, 1e-9);
  EXPECT_NEAR((*force)["greatest"].get<double>(), 1.4, 1e-9);
  // an expert is not compared with itself
  const auto own = nlohmann::json::parse(scoreOf(experts[2]).comparison_json());
  for (const auto& r : own) {
    if (r["measure"] == "dtw_distance_m") {
      EXPECT_NEAR(r["value"].get<double>(), 0.001, 1e-9);
    }
  }
}

TEST_F(Scoring, aDistanceBetweenTwoPathsIsComputedOnce) {
  std::vector<Uuid> experts;
  for (int i = 0; i < 7; ++i) experts.push_back(closed(gestureAside(0.001 * i)));
  const auto setReference = [&](std::size_t count, std::uint32_t base) {
    pb::Request set;
    set.mutable_set_reference()->set_exercise_id("knee-recess");
    set.mutable_set_reference()->set_base_revision(base);
    for (std::size_t i = 0; i < count; ++i)
      set.mutable_set_reference()->add_session_ids(test::bytesOfId(experts[i]));
    return get(instructor, set).reference();
  };
  const auto computed = [&] { return store->service().scoring().distancesComputed(); };
  pb::Request show;
  show.mutable_get_reference()->set_exercise_id("knee-recess");

  const auto first = setReference(6, 0);
  EXPECT_EQ(computed(), 15u) << "6·5/2 pairs";
  const auto shown = get(instructor, show).reference();
  ASSERT_EQ(shown.bands_size(), first.bands_size());
  for (int i = 0; i < shown.bands_size(); ++i)
    EXPECT_EQ(shown.bands(i).SerializeAsString(), first.bands(i).SerializeAsString()) << i;
  EXPECT_EQ(computed(), 15u);

  // the next revision has one more gesture: only its distances are new; with one less nothing is computed
  setReference(7, first.revision());
  EXPECT_EQ(computed(), 21u);
  const auto fewer = setReference(5, first.revision() + 1);
  EXPECT_EQ(computed(), 21u);
  const auto band = std::find_if(fewer.bands().begin(), fewer.bands().end(),
                                 [](const auto& b) { return b.measure() == "dtw_distance_m"; });
  ASSERT_NE(band, fewer.bands().end());
  EXPECT_EQ(band->n(), 5u) << "the band is of the gestures of now";

  // a session compared with the five: also computed once, and again for a score with other definitions
  const Uuid novice = closed(gestureAside(0.014));
  const auto before = scoreOf(novice).comparison_json();
  EXPECT_EQ(computed(), 26u);
  EXPECT_EQ(scoreOf(novice).comparison_json(), before);
  makeOld();
  rescore(false);
  EXPECT_EQ(scoreOf(novice).comparison_json(), before);
  // an expert's own comparison is part of what the band needed
  scoreOf(experts[2]);
  EXPECT_EQ(computed(), 26u);
}

TEST_F(Scoring, longReferencesAreComparedInPartsWithPendingOnesNamed) {
  std::vector<Uuid> experts;
  for (int i = 0; i < 5; ++i) experts.push_back(closed(gestureAside(0.001 * i)));
  const Uuid novice = closed(gestureAside(0.014));
  const auto computed = [&] { return store->service().scoring().distancesComputed(); };
  store->service().scoring().setMostComparedCells(1);  // a call reads one path or computes one distance
  pb::Request set, show;
  set.mutable_set_reference()->set_exercise_id("knee-recess");
  for (const Uuid& id : experts) set.mutable_set_reference()->add_session_ids(test::bytesOfId(id));
  show.mutable_get_reference()->set_exercise_id("knee-recess");
  const auto bandIn = [](const pb::Reference& reference) {
    return std::find_if(reference.bands().begin(), reference.bands().end(),
                        [](const auto& b) { return b.measure() == "dtw_distance_m"; });
  };
  auto reference = get(instructor, set).reference();
  // 5 paths, each before its first distance, and 5·4/2 distances
  const std::vector<std::uint64_t> after = {0, 0, 1, 1, 2, 2, 3, 3, 4, 5, 6, 7, 8, 9, 10};
  for (std::size_t call = 0; call + 1 < after.size(); ++call) {
    EXPECT_EQ(computed(), after[call]) << call;
    ASSERT_EQ(reference.pending_size(), 1) << call;
    EXPECT_EQ(reference.pending(0), "dtw_distance_m");
    EXPECT_EQ(bandIn(reference), reference.bands().end()) << "no band of some of the distances";
    EXPECT_GT(reference.bands_size(), 0) << "the others are there";
    reference = get(instructor, show).reference();
  }
  EXPECT_EQ(computed(), 10u);
  EXPECT_EQ(reference.pending_size(), 0);
  ASSERT_NE(bandIn(reference), reference.bands().end());
  EXPECT_EQ(bandIn(reference)->n(), 5u);
  EXPECT_NEAR(bandIn(reference)->mean(), 0.001, 1e-9);

  // then the session's own distances to the five
  const auto hasRow = [](const pb::Score& score) {
    for (const auto& row : nlohmann::json::parse(score.comparison_json()))
      if (row["measure"] == "dtw_distance_m") return true;
    return false;
  };
  for (std::uint64_t call = 0; call <= 5; ++call) {
    const auto score = scoreOf(novice);
    EXPECT_EQ(computed(), 10 + call) << "its path comes first";
    EXPECT_EQ(score.pending_size(), call < 5 ? 1 : 0) << call;
    EXPECT_EQ(hasRow(score), call == 5) << "not the nearest of some";
  }
  EXPECT_EQ(scoreOf(novice).pending_size(), 0);
  EXPECT_EQ(computed(), 15u);
}

TEST_F(Scoring, aCloseComputesDistancesInStepsAndSkipsABadReference) {
  std::vector<Uuid> experts;
  for (int i = 0; i < 3; ++i) experts.push_back(closed(gestureAside(0.001 * i)));
  for (int i = 3; i < 5; ++i) {
    // sealed, but its last sample's bytes are missing
    Bytes chunk = encodeChunk(Resolution::lossless(), gestureAside(0.001 * i));
    chunk.resize(chunk.size() - 9);
    const std::uint32_t crc = crc32c(chunk);
    for (int byte = 0; byte < 4; ++byte) chunk.push_back(static_cast<std::uint8_t>(crc >> (8 * byte)));
    ASSERT_FALSE(decodeChunk(chunk).ok());
    experts.push_back(closed(chunk, 600));
  }
  ASSERT_OK(change([&](Connection& c) {
    const auto put = ReferenceStore(c).put("knee-recess", experts, 0, "ina", 1);
    return put ? Status() : Status(put.error());
  }));
  store->service().scoring().setMostComparedCells(1);  // a step reads one path or computes one distance
  const auto nearest_m = [](const CloseOutcome& outcome) {
    const auto rows = parseScore(outcome.score_json);
    EXPECT_OK(rows);
    if (rows)
      for (const Measure& row : *rows)
        if (row.name == "dtw_distance_m") return row.value;
    return 0.0;
  };
  const auto first = closedInSteps(gestureAside(0.012));
  EXPECT_EQ(first.steps, 1u + 5u + 3u) << "its path, those of 5 references, and 3 distances";
  EXPECT_NEAR(nearest_m(first.outcome), 0.010, 1e-9);
  EXPECT_EQ(first.outcome.closed.kind, Closed::Kind::kClosed);
  const auto second = closedInSteps(gestureAside(0.022));
  EXPECT_EQ(second.steps, 1u + 3u) << "that two have no path is known";
  EXPECT_NEAR(nearest_m(second.outcome), 0.020, 1e-9);
}

TEST_F(Scoring, forgottenDistancesDoNotAddStepsToAClose) {
  const std::vector<Uuid> experts = {closed(gestureAside(0)), closed(gestureAside(0.001)),
                                     closed(gestureAside(0.002))};
  std::uint32_t revision = 0;
  const auto setReference = [&](const std::vector<Uuid>& sessions) {
    ASSERT_OK(change([&](Connection& c) {
      const auto put = ReferenceStore(c).put("knee-recess", sessions, revision++, "ina", 1);
      return put ? Status() : Status(put.error());
    }));
  };
  setReference(experts);
  store->service().scoring().setMostComparedCells(1);  // a step reads one path or computes one distance
  const auto samples = gestureAside(0.012);
  CloseUnderWay close{delivered(encodeChunk(Resolution::lossless(), samples), samples.size(), "knee-recess"),
                      "station-1"};
  std::size_t steps = 0;
  std::optional<CloseOutcome> done;
  while (!done && ++steps < 100) {
    ASSERT_OK(store->service().retention().daily());  // drops all paths and distances
    auto outcome = store->service().scoring().closeStep(close);
    ASSERT_OK(outcome);
    done = *std::move(outcome);
    // the first step's references apply: the nearest one stays
    setReference({experts[steps % 2]});
  }
  EXPECT_EQ(steps, 1u + 3u + 3u) << "its path, those of 3 references, and 3 distances";
  ASSERT_TRUE(done);
  const auto rows = parseScore(done->score_json);
  ASSERT_OK(rows);
  const auto row =
      std::find_if(rows->begin(), rows->end(), [](const Measure& m) { return m.name == "dtw_distance_m"; });
  ASSERT_NE(row, rows->end());
  EXPECT_NEAR(row->value, 0.010, 1e-9);
}

TEST_F(Scoring, anAbandonedCloseContinuesWhenRequestedAgain) {
  const std::vector<Uuid> experts = {closed(gestureAside(0)), closed(gestureAside(0.001))};
  ASSERT_OK(change([&](Connection& c) {
    const auto put = ReferenceStore(c).put("knee-recess", experts, 0, "ina", 1);
    return put ? Status() : Status(put.error());
  }));
  store->service().scoring().setMostComparedCells(1);
  const auto samples = gestureAside(0.005);
  const auto request = delivered(encodeChunk(Resolution::lossless(), samples), samples.size(), "knee-recess");
  const auto stepsOf = [&](std::size_t most) {
    CloseUnderWay close{request, "station-1"};
    for (std::size_t step = 1; step <= most; ++step) {
      const auto outcome = store->service().scoring().closeStep(close);
      EXPECT_OK(outcome);
      if (outcome && *outcome) {
        EXPECT_THAT((*outcome)->score_json, HasSubstr("dtw_distance_m"));
        return step;
      }
    }
    return std::size_t{0};
  };
  EXPECT_EQ(stepsOf(3), 0u) << "two paths and a distance of 1 + 2 + 2";
  EXPECT_EQ(stepsOf(10), 2u) << "a path and a distance";
  EXPECT_EQ(stepsOf(10), 1u) << "the same score again";
}

TEST_F(Scoring, concurrentRequestsWaitForADistanceInsteadOfRecomputing) {
  std::vector<Uuid> experts;
  for (int i = 0; i < 8; ++i) experts.push_back(closed(gestureAside(0.001 * i)));
  ASSERT_OK(change([&](Connection& c) {
    const auto put = ReferenceStore(c).put("knee-recess", experts, 0, "ina", 1);
    return put ? Status() : Status(put.error());
  }));
  pb::Request show;
  show.mutable_get_reference()->set_exercise_id("knee-recess");
  std::vector<pb::Reference> seen(4);
  std::barrier together(static_cast<std::ptrdiff_t>(seen.size()));
  std::vector<std::thread> people;
  for (auto& reference : seen) {
    people.emplace_back([&] {
      together.arrive_and_wait();
      reference = get(instructor, show).reference();
    });
  }
  for (auto& one : people) one.join();
  EXPECT_EQ(store->service().scoring().distancesComputed(), 28u) << "8·7/2 pairs, for any caller";
  for (const auto& reference : seen)
    EXPECT_EQ(reference.SerializeAsString(), seen[0].SerializeAsString()) << "and all have them";
}

TEST_F(Scoring, aDamagedReferenceIsReadOnceAndNotByEachComparison) {
  std::vector<Uuid> experts;
  for (int i = 0; i < 6; ++i) experts.push_back(closed(gestureAside(0.001 * i)));
  const Uuid novice = closed(gestureAside(0.014));
  damage(5, 1);
  pb::Request set;
  set.mutable_set_reference()->set_exercise_id("knee-recess");
  for (const Uuid& id : experts) set.mutable_set_reference()->add_session_ids(test::bytesOfId(id));
  get(instructor, set);
  const auto nearest_m = [&] {
    for (const auto& row : nlohmann::json::parse(scoreOf(novice).comparison_json()))
      if (row["measure"] == "dtw_distance_m") return row["value"].get<double>();
    return 0.0;
  };
  EXPECT_NEAR(nearest_m(), 0.010, 1e-9) << "the fifth is the nearest that can be read";
  damage(5, -1);
  EXPECT_NEAR(nearest_m(), 0.010, 1e-9) << "reading the sixth again would find it";
  ASSERT_OK(store->service().retention().daily());
  EXPECT_NEAR(nearest_m(), 0.009, 1e-9) << "recordings may have changed: cached results are dropped";
}

TEST_F(Scoring, anUnscorableSessionIsReadOnlyOnce) {
  const Uuid id = closed(gestureAside(0.001));
  makeOld();
  damage(0, 1);
  pb::Request again;
  again.mutable_rescore_session()->set_session_id(test::bytesOfId(id));
  EXPECT_EQ(refusal(instructor, again), ErrorCode::kCorrupt);
  damage(0, -1);
  EXPECT_EQ(refusal(instructor, again), ErrorCode::kCorrupt) << "reading it again would find it sound";
  ASSERT_OK(store->service().retention().daily());
  EXPECT_GT(get(instructor, again).score().definition_version(), 1u);
}

/// A closed session too long to be scored in one step.
class LongScoring : public Scoring {
 protected:
  static constexpr std::uint64_t kEach = 1000, kChunks = kScoredAtOnce / kEach;

  void SetUp() override {
    Scoring::SetUp();
    id = addSession("anna", kChunks, kEach, profile_json_);
    ASSERT_OK(change([&](Connection& c) {
      const auto closed = SessionStore(c).close(test::closeOf(id, kChunks, kEach), 2);
      return closed ? Status() : Status(closed.error());
    }));
    again.mutable_rescore_session()->set_session_id(test::bytesOfId(id));
  }

  Uuid id{};
  pb::Request again;
  RequestUnderWay under_way;
};

TEST_F(LongScoring, steppedScoringIsBitIdentical) {
  std::optional<Outcome> outcome;
  std::uint64_t steps = 0;
  for (; !outcome && steps < 1000; ++steps)
    outcome = store->service().executeStep(instructor, again, under_way);
  ASSERT_TRUE(outcome);
  ASSERT_FALSE(outcome->error) << outcome->error->message;
  EXPECT_GE(steps, 6u) << "each sample is read, counted twice, put into a run, averaged and measured";
  auto reader = store->readers().borrow();
  ASSERT_OK(reader);
  const auto in_one = store->service().scoring().scoreSession(**reader, id);
  ASSERT_OK(in_one);
  EXPECT_EQ(outcome->reply.score().measures_json(), *in_one);
  EXPECT_THAT(*in_one, HasSubstr("peak_force_n"));
}

TEST_F(LongScoring, meetsDamageThatCameBetweenItsSteps) {
  ASSERT_FALSE(store->service().executeStep(instructor, again, under_way));
  damage(0, 1);
  std::optional<Outcome> outcome;
  for (int step = 0; !outcome && step < 1000; ++step)
    outcome = store->service().executeStep(instructor, again, under_way);
  ASSERT_TRUE(outcome);
  ASSERT_TRUE(outcome->error);
  EXPECT_EQ(outcome->error->code, ErrorCode::kCorrupt);
}

TEST_F(LongScoring, getsNoFurtherStepOnceItsPersonIsErased) {
  ASSERT_FALSE(store->service().executeStep(instructor, again, under_way));
  ASSERT_OK(change([](Connection& c) {
    const auto ref = findPerson(c, "anna", Named::kAccountOrTyped);
    const auto erased = ErasureStore(c).erase(ref->value(), {"ada", "", 1});
    return erased ? Status() : Status(erased.error());
  }));
  const auto outcome = store->service().executeStep(instructor, again, under_way);
  ASSERT_TRUE(outcome);
  ASSERT_TRUE(outcome->error);
  EXPECT_EQ(outcome->error->code, ErrorCode::kUnavailable) << outcome->error->message;
}

TEST_F(Scoring, afterAnErasureNothingIsKeptOfTheErasedPaths) {
  addPerson("ada", pb::ADMINISTRATOR);
  addPerson("anna", pb::TRAINEE);
  std::vector<Uuid> experts;
  for (int i = 0; i < 5; ++i) experts.push_back(closed(gestureAside(0.001 * i)));
  pb::Request set;
  set.mutable_set_reference()->set_exercise_id("knee-recess");
  for (const Uuid& id : experts) set.mutable_set_reference()->add_session_ids(test::bytesOfId(id));
  get(instructor, set);
  ASSERT_EQ(store->service().scoring().distancesComputed(), 10u);
  pb::Request erase;
  erase.mutable_erase_person()->set_name("anna");
  erase.mutable_erase_person()->set_confirm("anna");
  erase.mutable_erase_person()->set_reason("asked for it");
  get(admin, erase);
  pb::Request show;
  show.mutable_get_reference()->set_exercise_id("knee-recess");
  const auto shown = get(instructor, show).reference();
  for (const auto& band : shown.bands()) EXPECT_NE(band.measure(), "dtw_distance_m");
}

}  // namespace
}  // namespace needlelab
