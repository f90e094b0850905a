/// Uploads a finished lesson to a server as a station does.
#pragma once

#include <gtest/gtest.h>

#include <span>
#include <string>
#include <vector>

#include "common/gesture/chunk.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab::test {

/// `key` is the key of the station that `info` names. Fails the test if the server does not accept the
/// lesson.
inline void uploadLesson(RunningServer& server, const std::string& key, const pb::SessionInfo& info,
                         const std::vector<GestureSample>& samples) {
  auto station = server.connect(stationLogin(info.description().station(), key));
  ASSERT_TRUE(station.ok()) << station.error().message;
  const std::string& id = info.description().session_id();
  pb::Envelope open;
  *open.mutable_open_session()->mutable_description() = info.description();
  ASSERT_TRUE(station->send(open).ok());
  SessionHash hash;
  std::uint64_t seq = 0;
  for (std::size_t k = 0; k < samples.size(); k += 500, ++seq) {
    const Bytes data =
        encodeChunk(Resolution::standard(),
                    std::span(samples).subspan(k, std::min<std::size_t>(500, samples.size() - k)));
    hash.update(data);
    pb::Envelope chunk;
    chunk.mutable_chunk()->set_session_id(id);
    chunk.mutable_chunk()->set_seq(seq);
    chunk.mutable_chunk()->set_data(data.data(), data.size());
    ASSERT_TRUE(station->send(chunk).ok());
  }
  const Digest digest = hash.digest();
  pb::Envelope close;
  close.mutable_close_session()->set_session_id(id);
  close.mutable_close_session()->set_chunks(seq);
  close.mutable_close_session()->set_samples(samples.size());
  close.mutable_close_session()->set_hash(digest.data(), digest.size());
  ASSERT_TRUE(station->send(close).ok());
  (void)waitFor(*station, [](const pb::Envelope& e) { return e.has_session_closed(); });
}

}  // namespace needlelab::test
