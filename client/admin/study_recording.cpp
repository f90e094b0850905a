#include "client/admin/study_recording.h"

#include "client/admin/sample_sink.h"

namespace needlelab {

Status exportStudyRecording(Backend& backend, Output& output, const std::string& study,
                            const std::string& session, const std::string& format,
                            const std::filesystem::path& file) {
  std::unique_ptr<SampleSink> sink;
  for (std::uint64_t next = 0;;) {
    pb::Request read;
    read.mutable_read_study_recording()->set_study(study);
    read.mutable_read_study_recording()->set_session(session);
    read.mutable_read_study_recording()->set_from_seq(next);
    const auto reply = backend.call(read);
    if (!reply) return reply.error();
    // only now: an unknown session leaves no file
    if (!sink) {
      auto opened = openSampleSink(format, file, Json{{"study", study}, {"session", session}}, {});
      if (!opened) return opened.error();
      sink = std::move(*opened);
    }
    for (const pb::Chunk& chunk : reply->chunks().chunks()) {
      if (chunk.seq() != next)
        return Error{ErrorCode::kCorrupt, "chunk " + std::to_string(next) + " was asked for, " +
                                              std::to_string(chunk.seq()) + " came"};
      if (auto done = sink->take(viewOf(chunk.data())); !done)
        return Error{done.error().code, "chunk " + std::to_string(next) + ": " + done.error().message};
      ++next;
    }
    if (reply->chunks().chunks_size() == 0) break;
  }
  if (auto done = sink->finish(); !done) return done;
  output.done("wrote " + std::to_string(sink->samples()) + " samples to " + file.string());
  return {};
}

}  // namespace needlelab
