#include "client/net/uplink/uplink_session.h"

#include <gmock/gmock.h>

#include <fstream>

#include "client/net/spool/spool_json.h"
#include "common/base/files/files.h"
#include "common/gesture/chunk.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/client/net/spool/spool_samples.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

// A spooled session of three chunks and its uplink state.
class UplinkSessionTest : public testing::Test {
 protected:
  UplinkSessionTest() : spool_(std::move(Spool::open(folder_.path())).value()) {
    session_ = *spool_->create(describeSession(makeUuidV7()));
    for (std::uint64_t seq = 0; seq < 3; ++seq)
      EXPECT_TRUE(
          session_->appendChunk(encodeChunk(Resolution::standard(), samplesFrom(seq * 10, 10)), 10).ok());
    EXPECT_TRUE(session_->sync().ok());
    upload_ = std::make_unique<UplinkSession>(session_, "", time_);
  }
  // Returns the names of the messages it sends next.
  std::vector<std::string> sends(bool room = true) {
    std::vector<std::string> names;
    while (auto message = upload_->next(room)) {
      if (message->has_open_session()) names.push_back("open");
      if (message->has_chunk()) names.push_back("chunk " + std::to_string(message->chunk().seq()));
      if (message->has_close_session()) names.push_back("close");
    }
    return names;
  }
  void ack(std::uint64_t committed, std::uint64_t safe = 0) {
    pb::Ack message;
    message.set_committed_seqs(committed);
    message.set_safe_seqs(safe);
    upload_->onAck(message);
  }
  void refuse(pb::Refusal::Reason reason, std::uint64_t expected = 0) {
    pb::Refusal refusal;
    refusal.set_reason(reason);
    refusal.set_expected_seq(expected);
    refusal.set_text("says the test");
    upload_->onRefusal(refusal);
  }
  using Names = std::vector<std::string>;
  TempFolder folder_;
  std::unique_ptr<Spool> spool_;
  std::shared_ptr<SpoolSession> session_;
  FakeTime time_;
  std::unique_ptr<UplinkSession> upload_;
};

TEST_F(UplinkSessionTest, aSessionThatLostSamplesIsClosedAsInterruptedWithTheirNumber) {
  ASSERT_TRUE(session_->setLoss({321, 30}).ok());
  ASSERT_TRUE(session_->end(false).ok());
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(3);
  const auto close = upload_->next(true);
  ASSERT_TRUE(close && close->has_close_session());
  EXPECT_TRUE(close->close_session().interrupted()) << "an older server shows it, too";
  EXPECT_EQ(close->close_session().samples_lost(), 321u);
  EXPECT_EQ(close->close_session().lost_from_tick(), 30u);
}

// Three chunks of ten samples, ended or cut off; then the disk damages the second. `hash`: of all three.
class DamagedUpload : public UplinkSessionTest {
 protected:
  void damage(bool ended) {
    for (std::uint64_t seq = 0; seq < 3; ++seq) hash_.update(*session_->readChunk(seq));
    if (ended) {
      ASSERT_TRUE(session_->end(false).ok());
    }
    const auto file = session_->folder() / "chunks";
    upload_.reset();
    session_.reset();
    spool_.reset();
    std::string text = *readWholeFile(file);
    text[text.size() / 2] = static_cast<char>(~text[text.size() / 2]);
    std::ofstream(file, std::ios::binary) << text;
    start();
  }
  void start() {
    upload_.reset();
    session_.reset();
    spool_.reset();
    spool_ = std::move(Spool::open(folder_.path())).value();
    ASSERT_EQ(spool_->unfinished().size(), 1u);
    session_ = spool_->unfinished()[0];
    upload_ = std::make_unique<UplinkSession>(session_, "", time_);
  }
  /// The end message, after the server has named the next chunk and acknowledged all.
  pb::CloseSession endAfter(std::uint64_t next_seq, const Names& sent) {
    EXPECT_EQ(sends(), Names{"open"});
    upload_->onOpened(next_seq);
    if (!sent.empty()) {
      EXPECT_EQ(sends(), sent);
      ack(session_->contents().chunks);
    }
    const auto close = upload_->next(true);
    EXPECT_TRUE(close && close->has_close_session()) << upload_->trouble();
    return close ? close->close_session() : pb::CloseSession();
  }
  SessionHash hash_;
};

TEST_F(DamagedUpload, chunksBehindDamageCloseUpAndTheEndReportsTheLoss) {
  damage(false);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(0);
  SessionHash sent;
  for (std::uint64_t seq = 0; seq < 2; ++seq) {
    const auto message = upload_->next(true);
    ASSERT_TRUE(message && message->has_chunk());
    EXPECT_EQ(message->chunk().seq(), seq);
    const auto samples = decodeChunk(viewOf(message->chunk().data()));
    EXPECT_EQ(samples->front().tick, seq == 0 ? 0u : 20u);
    sent.update(viewOf(message->chunk().data()));
  }
  ack(2);
  const auto message = upload_->next(true);
  ASSERT_TRUE(message && message->has_close_session());
  const pb::CloseSession& close = message->close_session();
  EXPECT_EQ(close.chunks(), 2u);
  EXPECT_EQ(close.samples(), 20u);
  EXPECT_EQ(close.samples_lost(), 10u);
  EXPECT_EQ(close.samples_damaged(), 10u);
  EXPECT_EQ(close.chunks_damaged(), 1u);
  EXPECT_EQ(close.lost_from_tick(), 10u);
  EXPECT_TRUE(close.interrupted());
  const Digest digest = sent.digest();
  EXPECT_EQ(close.hash(), std::string(digest.begin(), digest.end()));
}

TEST_F(DamagedUpload, aDamagedLossCountPreventsClosingAsComplete) {
  ASSERT_TRUE(session_->end(false).ok());
  std::ofstream(session_->folder() / "lost", std::ios::binary) << "";
  start();
  const pb::CloseSession close = endAfter(3, {});
  EXPECT_EQ(close.samples(), 30u);
  EXPECT_TRUE(close.interrupted());
  EXPECT_EQ(close.samples_lost(), 0u) << "no one knows how many";
}

TEST_F(DamagedUpload, unexpectedSamplesCloseASessionAsInterrupted) {
  ASSERT_TRUE(session_->end(false).ok());
  auto end = *readSpoolJson(session_->folder() / "end.json");
  end["samples"] = 35;
  ASSERT_TRUE(writeSpoolJson(session_->folder() / "end.json", end).ok());
  start();
  const pb::CloseSession close = endAfter(0, {"chunk 0", "chunk 1", "chunk 2"});
  EXPECT_EQ(close.chunks(), 3u);
  EXPECT_EQ(close.samples(), 30u);
  EXPECT_TRUE(close.interrupted());
  EXPECT_EQ(close.samples_lost(), 5u);
  EXPECT_EQ(close.samples_damaged(), 5u);
  EXPECT_EQ(close.lost_from_tick(), 30u);
}

TEST_F(DamagedUpload, whatTheServerHasOfItIsNotLost) {
  damage(true);
  const pb::CloseSession close = endAfter(2, {"chunk 2"});
  EXPECT_EQ(close.chunks(), 3u);
  EXPECT_EQ(close.samples(), 30u);
  EXPECT_EQ(close.samples_lost(), 0u);
  EXPECT_FALSE(close.interrupted()) << "its end was written before the damage";
  const Digest digest = hash_.digest();
  EXPECT_EQ(close.hash(), std::string(digest.begin(), digest.end()));
}

TEST_F(DamagedUpload, withoutAnEndTheServersHashIsUnknown) {
  damage(false);
  const pb::CloseSession close = endAfter(2, {"chunk 2"});
  EXPECT_EQ(close.chunks(), 3u);
  EXPECT_EQ(close.hash(), "");
  EXPECT_TRUE(close.interrupted());
  EXPECT_EQ(close.samples_lost(), 0u);
}

TEST_F(DamagedUpload, theNumbersThatWereSettledStayAfterARestart) {
  damage(true);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(1);
  EXPECT_EQ(sends(), Names{"chunk 1"}) << "the third closes up";
  start();
  const pb::CloseSession close = endAfter(2, {});
  EXPECT_EQ(close.chunks(), 2u);
  EXPECT_EQ(close.samples(), 20u);
  EXPECT_EQ(close.samples_damaged(), 10u);
  EXPECT_NE(close.hash(), "");
}

TEST_F(UplinkSessionTest, aSessionRecordedWithoutAKeyGetsTheLogInsName) {
  auto description = describeSession(makeUuidV7());
  UplinkSession named(*spool_->create(description), "s9");
  EXPECT_EQ(named.next(true)->open_session().description().station(), description.station());
  description = describeSession(makeUuidV7());
  description.clear_station();
  UplinkSession nameless(*spool_->create(description), "s9");
  EXPECT_EQ(nameless.next(true)->open_session().description().station(), "s9");
}

TEST_F(UplinkSessionTest, opensSendsInOrderAndClosesWhenAllIsCommitted) {
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(0);
  EXPECT_EQ(sends(), (Names{"chunk 0", "chunk 1", "chunk 2"}));
  EXPECT_EQ(upload_->inFlight(), 3u);
  ASSERT_TRUE(session_->end(false).ok());
  EXPECT_EQ(sends(), Names{}) << "not everything is committed yet";
  ack(2);
  EXPECT_EQ(upload_->inFlight(), 1u);
  ack(3);
  EXPECT_EQ(sends(), Names{"close"});
  EXPECT_EQ(sends(), Names{}) << "once";
  upload_->onClosed({});
  EXPECT_TRUE(upload_->finished());
  EXPECT_TRUE(session_->receipt().closed);
}

TEST_F(UplinkSessionTest, withoutRoomNoChunkButEverythingElse) {
  EXPECT_EQ(sends(false), Names{"open"});
  upload_->onOpened(0);
  EXPECT_EQ(sends(false), Names{});
}

TEST_F(UplinkSessionTest, theServersNextSeqCountsMoreThanTheReceipt) {
  ASSERT_TRUE(session_->setReceipt({3, 0, false, 0}).ok());
  UplinkSession again(session_);
  EXPECT_EQ(again.committed(), 3u);
  ASSERT_TRUE(again.next(true)->has_open_session());
  again.onOpened(1);  // restored from a backup older than its acks
  EXPECT_EQ(again.takeMissingCount(), 2u);
  EXPECT_EQ(again.takeMissingCount(), 0u);
  EXPECT_EQ(again.next(true)->chunk().seq(), 1u);
}

TEST_F(UplinkSessionTest, aRestoredServerGetsItsClosedSessionsAgain) {
  ASSERT_TRUE(session_->end(false).ok());
  ASSERT_TRUE(session_->setReceipt({3, 1, true, 7}).ok());
  // In the next program run: a closed session's chunks are not read unless they are needed.
  const auto hash = session_->contents().hash;
  session_.reset();
  spool_.reset();
  spool_ = std::move(Spool::open(folder_.path())).value();
  ASSERT_TRUE(spool_->unfinished().empty());
  ASSERT_EQ(spool_->closedButNotSafe().size(), 1u);
  session_ = spool_->closedButNotSafe()[0];
  upload_ = std::make_unique<UplinkSession>(session_, "", time_);
  EXPECT_EQ(sends(), Names{"open"}) << "asks whether the server still has it";
  EXPECT_TRUE(upload_->asking());
  EXPECT_TRUE(upload_->finished()) << "no one waits for the answer";
  upload_->onOpened(1);  // the restored backup has one chunk
  EXPECT_FALSE(session_->receipt().closed) << "from now on the spool keeps it at any age";
  EXPECT_EQ(session_->contents().hash, hash);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(1);
  EXPECT_EQ(sends(), (Names{"chunk 1", "chunk 2"}));
  ack(3);
  EXPECT_EQ(sends(), Names{"close"});
  upload_->onClosed({});
  EXPECT_TRUE(session_->receipt().closed);
}

TEST_F(UplinkSessionTest, aRestoredServerThatHasAllButTheEndClosesItAgain) {
  ASSERT_TRUE(session_->end(false).ok());
  ASSERT_TRUE(session_->setReceipt({3, 0, true, 7}).ok());
  upload_ = std::make_unique<UplinkSession>(session_, "", time_);
  upload_->onConnected(UplinkSession::AtServer::kOpen);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(3);
  EXPECT_EQ(sends(), Names{"close"});
}

// None of its chunks can be called Safe, so the spool keeps it for the next program run, too.
TEST_F(UplinkSessionTest, aRestoredServerGetsAnEmptySessionsEndAgain) {
  auto empty = *spool_->create(describeSession(makeUuidV7()));
  ASSERT_TRUE(empty->end(true).ok());
  ASSERT_TRUE(session_->end(false).ok());
  ASSERT_TRUE(session_->setReceipt({3, 3, true, 7}).ok());
  ASSERT_TRUE(empty->setReceipt({0, 0, true, 7}).ok());
  const std::string id = empty->idText();
  empty.reset();
  session_.reset();
  upload_.reset();
  spool_.reset();
  spool_ = std::move(Spool::open(folder_.path())).value();
  ASSERT_EQ(spool_->closedButNotSafe().size(), 1u);
  session_ = spool_->closedButNotSafe()[0];
  EXPECT_EQ(session_->idText(), id);
  upload_ = std::make_unique<UplinkSession>(session_, "", time_);
  upload_->onConnected(UplinkSession::AtServer::kNotOpen);
  EXPECT_EQ(sends(), Names{}) << "the server has its end";
  upload_->onConnectionLost();
  upload_->onConnected(UplinkSession::AtServer::kOpen);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(0);
  EXPECT_EQ(sends(), Names{"close"});
  upload_->onClosed({});
  EXPECT_TRUE(session_->receipt().closed);
}

TEST_F(UplinkSessionTest, aLostEndIsResentAndSafeOnlyAfterABackup) {
  ASSERT_TRUE(session_->end(false).ok());
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(3);
  EXPECT_EQ(sends(), Names{"close"});
  upload_->onClosed({});
  ack(3, 3);
  ASSERT_EQ(session_->receipt().safe, 3u);
  // The server was restored from a backup with all chunks but without the end.
  upload_->onConnectionLost();
  upload_->onConnected(UplinkSession::AtServer::kOpen);
  EXPECT_FALSE(session_->receipt().closed);
  EXPECT_EQ(session_->receipt().safe, 2u);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(3);
  ack(3, 2);
  EXPECT_EQ(sends(), Names{"close"});
  upload_->onClosed({});
  EXPECT_TRUE(session_->receipt().closed);
  EXPECT_EQ(spool_->cleanUp({}), Names{}) << "no backup has this end";
  EXPECT_EQ(spool_->closedButNotSafe().size(), 1u);
  // It is sent on each new connection until a backup covers it.
  upload_->onConnectionLost();
  upload_->onConnected(UplinkSession::AtServer::kNotOpen);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(3);
  ack(3, 3);
  EXPECT_EQ(session_->receipt().safe, 3u);
  EXPECT_EQ(spool_->cleanUp({}).size(), 1u);
}

TEST_F(UplinkSessionTest, aClosedSessionIsQueriedOncePerConnection) {
  ASSERT_TRUE(session_->end(false).ok());
  ASSERT_TRUE(session_->setReceipt({3, 0, true, 7}).ok());
  upload_ = std::make_unique<UplinkSession>(session_, "", time_);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(3);
  EXPECT_EQ(sends(), Names{}) << "the server has it";
  EXPECT_FALSE(upload_->asking());
  upload_->onConnectionLost();
  upload_->onConnected(UplinkSession::AtServer::kNotOpen);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(3);
  ack(3, 3);
  EXPECT_EQ(session_->receipt().safe, 3u) << "so that the spool may let it go";
  upload_->onConnected(UplinkSession::AtServer::kNotOpen);
  // the data reported as Safe may be gone: a lagging standby was promoted
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(1);
  EXPECT_FALSE(session_->receipt().closed);
  EXPECT_LT(session_->receipt().safe, 3u);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(1);
  EXPECT_EQ(upload_->takeMissingCount(), 0u)
      << "it was reported when the closed session turned out to be gone";
  EXPECT_EQ(sends(), (Names{"chunk 1", "chunk 2"}));
}

TEST_F(UplinkSessionTest, aSessionMissingFromAFullWelcomeResendsItsEnd) {
  ASSERT_TRUE(session_->end(false).ok());
  ASSERT_TRUE(session_->setReceipt({3, 3, true, 7}).ok());
  upload_ = std::make_unique<UplinkSession>(session_, "", time_);
  upload_->onConnected(UplinkSession::AtServer::kUnknown);
  EXPECT_EQ(sends(), Names{"open"}) << "also of one that was safe: which backup was restored is unknown";
  upload_->onOpened(3);
  EXPECT_TRUE(upload_->asking()) << "the next old session waits";
  EXPECT_EQ(session_->receipt().safe, 2u) << "whether the server has its end is not known yet";
  EXPECT_TRUE(session_->receipt().closed);
  ack(3, 3);
  EXPECT_EQ(session_->receipt().safe, 3u);
  EXPECT_EQ(sends(), Names{"close"});
  EXPECT_EQ(sends(), Names{}) << "once";
  upload_->onClosed({});
  EXPECT_FALSE(upload_->asking());
  EXPECT_EQ(sends(), Names{});
  // A server that also lost chunks gets them again, as usual.
  upload_->onConnectionLost();
  upload_->onConnected(UplinkSession::AtServer::kUnknown);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(2);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(2);
  EXPECT_EQ(sends(), Names{"chunk 2"});
}

TEST_F(UplinkSessionTest, aRateLimitedSessionRetriesBeforeAllOthers) {
  ASSERT_TRUE(session_->end(false).ok());
  ASSERT_TRUE(session_->setReceipt({3, 0, true, 7}).ok());
  upload_ = std::make_unique<UplinkSession>(session_, "", time_);
  EXPECT_EQ(sends(), Names{"open"});
  refuse(pb::Refusal::RATE_LIMITED);
  EXPECT_TRUE(upload_->asking());
  EXPECT_EQ(sends(), Names{}) << "not at once";
  time_.advance(1'999'999'999);
  EXPECT_EQ(sends(), Names{}) << "nor before 2 s have passed";
  time_.advance(1);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(3);
  EXPECT_FALSE(upload_->asking());
  // After any other refusal it tries again on the next connection.
  upload_->onConnected(UplinkSession::AtServer::kNotOpen);
  EXPECT_EQ(sends(), Names{"open"});
  refuse(pb::Refusal::INTERNAL);
  EXPECT_FALSE(upload_->asking());
  EXPECT_EQ(sends(), Names{});
}

TEST_F(UplinkSessionTest, aServerThatHasMoreThanTheSpoolIsNotArguedWith) {
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(4);
  EXPECT_TRUE(upload_->refused());
  EXPECT_THAT(upload_->trouble(), HasSubstr("4 chunks"));
  EXPECT_EQ(sends(), Names{});
}

TEST_F(UplinkSessionTest, manyRefusalsForOneGapAskOnce) {
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(0);
  EXPECT_EQ(sends().size(), 3u);
  refuse(pb::Refusal::GAP, 1);  // for chunk 1, and soon for chunk 2 as well
  EXPECT_EQ(sends(), Names{"open"});
  refuse(pb::Refusal::GAP, 1);
  EXPECT_EQ(sends(), Names{});
  upload_->onOpened(1);
  EXPECT_EQ(sends(), (Names{"chunk 1", "chunk 2"}));
}

TEST_F(UplinkSessionTest, endlessGapsEndInAWord) {
  for (int i = 0; i < 100 && !upload_->refused(); ++i) {
    static_cast<void>(sends());
    upload_->onOpened(0);
    static_cast<void>(sends());
    refuse(pb::Refusal::GAP, 0);
  }
  EXPECT_TRUE(upload_->refused());
  EXPECT_THAT(upload_->trouble(), HasSubstr("says the test"));
}

TEST_F(UplinkSessionTest, everyRefusalForGoodParksItAndKeepsTheSpool) {
  for (const auto reason : {pb::Refusal::CONTRADICTION, pb::Refusal::INVALID, pb::Refusal::ROLE,
                            pb::Refusal::TOO_LARGE, pb::Refusal::CONFLICT, pb::Refusal::NOT_FOUND}) {
    UplinkSession upload(session_);
    static_cast<void>(upload.next(true));
    pb::Refusal refusal;
    refusal.set_reason(reason);
    refusal.set_text("no");
    upload.onRefusal(refusal);
    EXPECT_TRUE(upload.refused()) << reason;
    upload.onConnectionLost();
    EXPECT_FALSE(upload.next(true)) << "not in this run again";
    EXPECT_FALSE(session_->receipt().closed);
  }
}

TEST_F(UplinkSessionTest, aRefusalOfTheMomentIsNotForGood) {
  EXPECT_EQ(sends(), Names{"open"});
  refuse(pb::Refusal::INTERNAL);
  EXPECT_FALSE(upload_->refused());
  EXPECT_EQ(sends(), Names{}) << "asked again, but not at once";
}

TEST_F(UplinkSessionTest, aServerWithoutRoomIsAskedAgainLater) {
  ASSERT_TRUE(session_->end(false).ok());
  EXPECT_EQ(sends(), Names{"open"});
  refuse(pb::Refusal::NO_ROOM);
  EXPECT_FALSE(upload_->finished());
  EXPECT_EQ(upload_->waitsFor(), "says the test");
  time_.advance(14'900'000'000);
  EXPECT_EQ(sends(), Names{}) << "not often: a full disk lasts";
  time_.advance(200'000'000);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(0);
  EXPECT_EQ(upload_->waitsFor(), "");
  EXPECT_EQ(sends(), (Names{"chunk 0", "chunk 1", "chunk 2"}));
  ack(1);
  // meanwhile the disk fills up
  refuse(pb::Refusal::NO_ROOM);
  EXPECT_EQ(upload_->inFlight(), 0u) << "those in flight are not stored";
  time_.advance(15'100'000'000);
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(1);
  EXPECT_EQ(sends(), (Names{"chunk 1", "chunk 2"}));
  EXPECT_FALSE(session_->receipt().closed);
}

TEST_F(UplinkSessionTest, aChunkOverItsQuotaIsDeliveredOnALaterConnection) {
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(0);
  EXPECT_EQ(sends(), (Names{"chunk 0", "chunk 1", "chunk 2"}));
  ack(1);
  refuse(pb::Refusal::NO_ROOM);
  upload_->onConnectionLost();  // for a chunk the refusal is fatal
  EXPECT_FALSE(upload_->refused());
  time_.advance(14'900'000'000);
  EXPECT_EQ(sends(), Names{}) << "the new connection is not a reason to ask at once";
  time_.advance(200'000'000);
  EXPECT_EQ(sends(), Names{"open"});
  refuse(pb::Refusal::NO_ROOM);
  time_.advance(15'100'000'000);
  EXPECT_EQ(sends(), Names{"open"}) << "as long as it lasts";
  upload_->onOpened(1);
  EXPECT_EQ(sends(), (Names{"chunk 1", "chunk 2"}));
}

TEST_F(UplinkSessionTest, acksBeyondWhatThereIsAreNotBelieved) {
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(0);
  EXPECT_EQ(sends().size(), 3u);
  ack(1'000'000, 2'000'000);
  EXPECT_EQ(upload_->committed(), 3u);
  upload_->saveReceipt(true);
  EXPECT_EQ(session_->receipt().safe, 3u);
}

TEST_F(UplinkSessionTest, newsOfABackupReachTheReceiptOfAClosedSession) {
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(3);
  ASSERT_TRUE(session_->end(false).ok());
  EXPECT_EQ(sends(), Names{"close"});
  upload_->onClosed({});
  ack(3, 3);
  EXPECT_EQ(session_->receipt().safe, 3u);
}

TEST_F(UplinkSessionTest, aLostConnectionSendsTheUncommittedAgain) {
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(0);
  EXPECT_EQ(sends().size(), 3u);
  ack(1);
  upload_->onConnectionLost();
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(1);
  EXPECT_EQ(sends(), (Names{"chunk 1", "chunk 2"}));
}

TEST_F(UplinkSessionTest, theReceiptIsWrittenAtMostEveryTwoSeconds) {
  EXPECT_EQ(sends(), Names{"open"});
  upload_->onOpened(0);
  EXPECT_EQ(sends(), (Names{"chunk 0", "chunk 1", "chunk 2"}));
  upload_->saveReceipt(true);
  ack(1);
  time_.advance(1'999'999'999);
  upload_->saveReceipt(false);
  EXPECT_EQ(session_->receipt().committed, 0u);
  time_.advance(1);
  upload_->saveReceipt(false);
  EXPECT_EQ(session_->receipt().committed, 1u);
  ack(2);
  upload_->saveReceipt(true);
  EXPECT_EQ(session_->receipt().committed, 2u) << "at once, where it matters";
}

}  // namespace
}  // namespace needlelab::test
