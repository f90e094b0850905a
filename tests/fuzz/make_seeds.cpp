// Writes the seeds that are not files of the project: frames, spools, live operations. usage: make_seeds
// FOLDER
#include <cstdio>
#include <cstring>
#include <fstream>
#include <vector>

#include "client/net/spool/lesson_cache.h"
#include "client/net/spool/spool.h"
#include "common/base/files/files.h"
#include "common/gesture/chunk.h"
#include "common/haptics/cut_snapshot.h"
#include "common/wire/protocol.h"
#include "tests/fuzz/target.h"

namespace {

using namespace needlelab;
namespace fs = std::filesystem;

Bytes someChunk(std::uint64_t first_tick, std::size_t count) {
  std::vector<GestureSample> samples(count);
  for (std::size_t i = 0; i < count; ++i) {
    samples[i].tick = first_tick + i;
    samples[i].time_ns = static_cast<std::int64_t>(samples[i].tick) * 1'000'000;
    samples[i].p_WT_m[2] = 1e-5 * static_cast<double>(i * i % 17);
    samples[i].force_W_N[2] = 0.1 * static_cast<double>(i % 5);
  }
  return encodeChunk(Resolution::standard(), samples);
}

CutSnapshot twoCuts(std::uint64_t tick) {
  CutSnapshot snapshot;
  snapshot.tick = tick;
  snapshot.insertions = 2;
  snapshot.cuts.count = snapshot.cuts.next = 2;
  snapshot.cuts.tracks[0] = {{0, 0, 0.1}, {0, 0, -1}, 0.02, 1};
  snapshot.cuts.tracks[1] = {{0.01, 0, 0.1}, {0.6, 0, -0.8}, 0.03, 3};
  return snapshot;
}

void save(const fs::path& file, ByteView bytes) {
  fs::create_directories(file.parent_path());
  fuzz::writeFile(file, bytes);
}

void putFrame(Bytes& out, const pb::Envelope& envelope) {
  std::string text = envelope.SerializeAsString(), head;
  appendFrameHeader(head, text.size());
  out.insert(out.end(), head.begin(), head.end());
  out.insert(out.end(), text.begin(), text.end());
}

void frames(const fs::path& folder) {
  // one envelope of each body with default values, and some with content
  const auto* body = pb::Envelope::descriptor()->FindOneofByName("body");
  Bytes all = {0x61};
  for (int i = 0; i < body->field_count(); ++i) {
    pb::Envelope envelope;
    (void)envelope.GetReflection()->MutableMessage(&envelope, body->field(i));
    putFrame(all, envelope);
  }
  save(folder / "every_body", all);

  pb::Envelope hello, login, subscribe, chunk, request, open;
  hello.mutable_hello()->mutable_version()->set_major(1);
  hello.mutable_hello()->set_program("seed");
  hello.mutable_hello()->add_abilities("x");
  login.mutable_login()->mutable_person()->set_user("anna");
  login.mutable_login()->mutable_person()->set_password("long enough");
  subscribe.mutable_subscribe()->set_subscription(3);
  subscribe.mutable_subscribe()->set_station("bench-1");
  subscribe.mutable_subscribe()->set_rate_hz(100);
  const Bytes data = someChunk(0, 3);
  chunk.mutable_chunk()->set_session_id(std::string(16, 's'));
  chunk.mutable_chunk()->set_seq(7);
  chunk.mutable_chunk()->set_data(data.data(), data.size());
  request.mutable_request()->set_id(5);
  request.mutable_request()->mutable_add_user()->set_name("bert");
  request.mutable_request()->mutable_add_user()->set_role(pb::TRAINEE);
  open.mutable_open_session()->mutable_description()->set_station("bench-1");
  open.mutable_open_session()->mutable_description()->set_profile_json("{}");
  Bytes lesson = {0x01};
  for (const auto* each : {&hello, &login, &subscribe, &chunk, &request, &open}) putFrame(lesson, *each);
  save(folder / "lesson", lesson);
  pb::Envelope aids, stop, set, ended, search;
  aids.mutable_request()->set_id(6);
  aids.mutable_request()->mutable_set_aids()->set_station("bench-1");
  aids.mutable_request()->mutable_set_aids()->add_aids(pb::Exercise::ULTRASOUND);
  aids.mutable_request()->mutable_set_aids()->set_session_id(std::string(16, 's'));
  stop.mutable_request()->set_id(7);
  stop.mutable_request()->mutable_stop_lesson()->set_station("bench-1");
  stop.mutable_request()->mutable_stop_lesson()->set_reason("enough");
  set.mutable_set_aids()->set_from("ines");
  set.mutable_set_aids()->set_reset(true);
  ended.mutable_stop_lesson()->set_from("ines");
  ended.mutable_stop_lesson()->set_reason("enough");
  search.mutable_request()->set_id(8);
  search.mutable_request()->mutable_list_sessions()->set_from_unix_ns(1'700'000'000'000'000'000);
  search.mutable_request()->mutable_list_sessions()->set_verdict(pb::ListSessions::FAILED);
  search.mutable_request()->mutable_list_sessions()->set_search("ann");
  Bytes talk = {0x01};
  for (const auto* each : {&aids, &stop, &set, &ended, &search}) putFrame(talk, *each);
  save(folder / "talk", talk);
  Bytes pieces = {0x02};
  putFrame(pieces, hello);
  putFrame(pieces, login);
  save(folder / "byte_by_byte", pieces);
  save(folder / "too_long", Bytes{0x00, 0x00, 0x00, 0x10, 0x01, 0x08});
  save(folder / "empty_frame", Bytes{0x00, 0, 0, 0, 0});
}

std::string wire(const google::protobuf::Message& message) {
  return message.SerializeAsString();
}

void put(Bytes& out, std::uint8_t kind, std::uint8_t who, std::uint8_t number, ByteView data) {
  ByteWriter writer(out);
  if (!out.empty()) writer.put(viewOf(fuzz::kPartMark));
  writer.put(kind);
  writer.put(who);
  writer.put(number);
  writer.put(data);
}

void lives(const fs::path& folder) {
  pb::StationStatus status;
  status.set_trainee("tina");
  status.set_session_id(std::string(16, 'a'));
  status.set_force_n(1.5);
  pb::Subscribe full, slow;
  full.set_subscription(1);
  full.set_station("bench-1");
  slow.set_subscription(2);
  slow.set_rate_hz(100);
  const Bytes chunk = someChunk(100, 4);
  Bytes out;
  put(out, 0, 0, 0, {});
  put(out, 4, 0, 0, viewOf(wire(full)));
  put(out, 4, 1, 1, viewOf(wire(slow)));
  put(out, 4, 2, 0, viewOf(wire(slow)));
  put(out, 2, 0, 0, viewOf(wire(status)));
  put(out, 3, 0, 0, chunk);
  put(out, 3, 0, 3, chunk);
  put(out, 7, 0, 1, {});
  put(out, 8, 0, 0, {});
  put(out, 5, 0, 1, {});
  put(out, 6, 1, 0, {});
  put(out, 1, 0, 0, {});
  save(folder / "watched", out);
  pb::Envelope passed_on;
  passed_on.mutable_live_frame()->set_session_id(std::string(16, 'a'));
  passed_on.mutable_live_frame()->set_frame_seq(9);
  passed_on.mutable_live_frame()->set_due_steady_ns(-1);
  passed_on.mutable_live_frame()->set_capture_unix_ns(5);
  passed_on.mutable_live_frame()->set_data(chunk.data(), chunk.size());
  Bytes as_bytes;
  put(as_bytes, 0, 0, 0, {});
  put(as_bytes, 4, 0, 0, viewOf(wire(full)));
  put(as_bytes, 9, 0, 0, viewOf(wire(passed_on)));
  save(folder / "passed_on", as_bytes);
  pb::Envelope with_cuts = passed_on;
  const Bytes cuts = encodeCuts(twoCuts(103));
  with_cuts.mutable_live_frame()->set_cut_memory(cuts.data(), cuts.size());
  Bytes remembered;
  put(remembered, 0, 0, 0, {});
  put(remembered, 4, 0, 0, viewOf(wire(full)));
  put(remembered, 9, 0, 0, viewOf(wire(with_cuts)));
  save(folder / "with_cuts", remembered);
  // the same frame twice, of a station with a high frame count
  passed_on.mutable_live_frame()->set_frame_seq(2'000'000'000);
  put(as_bytes, 9, 0, 0, viewOf(wire(passed_on)));
  put(as_bytes, 9, 0, 0, viewOf(wire(passed_on)));
  save(folder / "counted_for_long", as_bytes);
  Bytes by_session;
  put(by_session, 4, 0, 128, viewOf(wire(slow)));
  put(by_session, 0, 1, 0, {});
  put(by_session, 7, 1, 0, {});
  put(by_session, 3, 1, 0, chunk);
  put(by_session, 3, 1, 255, chunk);
  save(folder / "by_session", by_session);
}

bool spools(const fs::path& folder) {
  const fs::path where = fuzz::scratchFolder() / "seed-spool";
  pb::SessionDescription d;
  const auto id = parseUuid("01890a5d-ac96-774b-bcce-b302099a8057");
  d.set_session_id(std::string(id->begin(), id->end()));
  d.set_station("bench-1");
  d.set_trainee("tina");
  d.set_exercise_id("practice");
  d.set_profile_id("p");
  d.set_profile_json("{}");
  d.set_engine_version("seed");
  d.set_rate_hz(1000);
  d.set_started_unix_ns(1'000'000'000);
  setResolution(d, Resolution::standard());
  pb::Lesson lesson;
  lesson.set_exercise_json("{\"id\": \"practice\"}");
  const auto pack = [&](const std::string& name) {
    Bytes out;
    const fs::path session = where / "01890a5d-ac96-774b-bcce-b302099a8057";
    for (const auto& file : {session / "session.json", session / "chunks", session / "tail",
                             session / "end.json", session / "acked.json", session / "lost",
                             where / "lessons/practice.json", session / "session.copy.json"}) {
      const auto text = fs::exists(file) ? readWholeFile(file) : Result<std::string>(std::string());
      ByteWriter writer(out);
      if (!out.empty()) writer.put(viewOf(fuzz::kPartMark));
      writer.put(viewOf(*text));
    }
    save(folder / name, out);
  };
  auto opened = Spool::open(where);
  if (!opened.ok()) return false;
  auto session = (*opened)->create(d);
  if (!session.ok()) {
    std::fprintf(stderr, "%s\n", session.error().message.c_str());
    return false;
  }
  bool ok =
      (*session)->appendChunk(someChunk(0, 8), 8).ok() && (*session)->appendChunk(someChunk(8, 8), 8).ok() &&
      (*session)->sync().ok() && (*session)->appendPiece(2, someChunk(16, 3)).ok() &&
      (*session)->appendPiece(2, someChunk(19, 3)).ok() && LessonCache(where).keep("practice", lesson).ok();
  pack("cut_off");
  ok = ok && (*session)->restartTail().ok() && (*session)->setReceipt({1, 1, false, 0}).ok() &&
       (*session)->end(false).ok();
  pack("ended");
  return ok;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const fs::path folder = argv[1];
  frames(folder / "envelope");
  // one second of a hand at rest, as a station sends it
  std::vector<GestureSample> still(1000);
  for (std::size_t i = 0; i < still.size(); ++i) {
    still[i].tick = i;
    still[i].time_ns = static_cast<std::int64_t>(i) * 1'000'000;
  }
  save(folder / "chunk/second_at_rest", encodeChunk(Resolution::standard(), still));
  save(folder / "chunk/with_cuts",
       encodeChunk(Resolution::standard(), std::span(still).first(40), encodeCuts(twoCuts(0))));
  lives(folder / "live");
  if (!spools(folder / "spool")) return 1;
  save(folder / "trajectory/two_rows",
       viewOf(
           "t_s,px_m,py_m,pz_m,qx,qy,qz,qw,plunger\n0,0,0,0.01,0,0,0,1,0\n0.002,0,1e-3,0.02,0,0,0,1,0.5\n"));
  save(folder / "trajectory/windows",
       viewOf("qw,qx,qy,qz,px_m,py_m,pz_m,t_s,more\r\n1,0,0,0,0,0,-.5,1e0,x\r\n"));
  save(folder / "trajectory/bad_cell", viewOf("t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n0,nan,0,0,0,0,0,1\n"));
  return 0;
}
