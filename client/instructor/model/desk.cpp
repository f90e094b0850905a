#include "client/instructor/model/desk.h"

#include <utility>

#include "common/base/text.h"
#include "common/profile/profile.h"

namespace needlelab {

Desk::Desk(ScenePreparer prepare, LabConnectionSettings settings)
    : lab_(std::move(settings)),
      prepare_(std::move(prepare)),
      talk(lab_, notices),
      sessions(lab_),
      bench(lab_, notices, prepare_) {}

Desk::~Desk() = default;

void Desk::logIn() {
  form_trouble.clear();
  const auto server = parseEndpoint(form.server);
  if (!server.ok())
    form_trouble = "Server: " + server.error().message;
  else if (form.ca_file.empty())
    form_trouble =
        "The CA file is missing: the tls/ca.crt of the server's folder. Who runs the server has it.";
  else if (form.user.empty())
    form_trouble = "Type your name as an instructor.";
  else if (form.password.empty())
    form_trouble = "Type your password.";
  if (!form_trouble.empty()) return;
  lab_.logIn({*server, form.ca_file, form.user, form.password});
  lab_.watchAll(10);
  link_ = lab_.state();
}

void Desk::logOut() {
  lab_.logOut();
  if (live_) lab_.unwatch(live_->station());
  live_.reset();
  overview = {};
  inside_ = false;
  form.password.clear();
  screen = DeskScreen::kLogin;
  link_ = lab_.state();
}

void Desk::update(double now_s) {
  last_s_ = std::exchange(now_s_, now_s);
  notices.tick(now_s);
  const LabNews news = lab_.poll();
  link_ = lab_.state();
  if (link_.phase == LinkPhase::kOnline && phase_before_ != LinkPhase::kOnline) {
    // a form that was right once is the way in; after a loss the view stays as it was
    if (!inside_) screen = DeskScreen::kLab;
    inside_ = true;
    readLists();
  }
  if (link_.phase != LinkPhase::kOnline && phase_before_ == LinkPhase::kOnline) {
    overview.connectionLost();
    if (live_) live_->connectionLost();
  }
  phase_before_ = link_.phase;
  for (const pb::StationStatus& status : news.statuses) {
    overview.onStatus(status, now_s);
    if (live_) live_->onStatus(status);
  }
  overview.tick(now_s);
  if (live_) {
    for (const LiveArrival& arrival : news.frames) live_->feed(arrival);
    askForScene();
  }
  bench.poll();
  bench.player.advance(now_s - last_s_);
}

void Desk::presented(std::int64_t now_unix_ns) {
  if (!live_) return;
  if (screen == DeskScreen::kLive && !live_->paused())
    live_->presented(now_unix_ns);
  else
    live_->latency().discard();
}

void Desk::askForScene() {
  const std::string wanted = live_->sessionToAskFor(now_s_);
  if (wanted.empty()) return;
  pb::Request request;
  request.mutable_get_session()->set_session_id(wanted);
  lab_.ask(request, [this, alive = std::weak_ptr(alive_)](Result<pb::Reply> reply) {
    // the server may not have the session yet: it is asked for again
    if (alive.expired() || !live_ || !reply.ok()) return;
    live_->setSession(reply->session(), prepare_);
  });
}

void Desk::readLists() {
  pb::Request stations;
  stations.mutable_list_stations();
  lab_.ask(stations, [this, alive = std::weak_ptr(alive_)](Result<pb::Reply> reply) {
    if (!alive.expired() && reply.ok()) overview.setStations(reply->stations(), now_s_);
  });
  pb::Request exercises;
  exercises.mutable_list_exercises();
  lab_.ask(exercises, [this, alive = std::weak_ptr(alive_)](Result<pb::Reply> reply) {
    if (alive.expired() || !reply.ok()) return;
    exercises_.clear();
    exercise_aids_.clear();
    for (const auto& row : reply->exercises().exercises()) {
      const auto exercise = parseExercise(row.json(), "exercise");
      if (!exercise.ok()) continue;
      exercises_.push_back({exercise->id(), printable(exercise->name())});
      exercise_aids_[exercise->id()] = aidsOfExercise(*exercise);
    }
  });
  pb::Request profiles;
  profiles.mutable_list_profiles();
  lab_.ask(profiles, [this, alive = std::weak_ptr(alive_)](Result<pb::Reply> reply) {
    if (alive.expired() || !reply.ok()) return;
    profiles_.clear();
    for (const auto& profile : reply->profiles().profiles()) profiles_.push_back(profile.id());
  });
}

void Desk::open(const std::string& station) {
  screen = DeskScreen::kLive;
  if (live_ && live_->station() == station) return;
  if (live_) lab_.unwatch(live_->station());
  live_ = std::make_unique<LiveStation>(station);
  aids_.reset();
  lab_.watch(station);
}

void Desk::annotate(const std::string& text) {
  if (screen == DeskScreen::kLive && live_) {
    const std::uint64_t tick = live_->shownTick();
    const std::string session = live_->sessionId();
    talk.annotate(session, tick, text, [this, session, tick, text] {
      if (live_ && live_->sessionId() == session) live_->addRemark(tick, text);
    });
    return;
  }
  if (!bench.first()) {
    notices.trouble("there is nothing to annotate: look over a station or load a session");
    return;
  }
  const auto& gesture = *bench.first();
  if (gesture.samples.empty()) return;
  const std::uint64_t tick = gesture.samples[gesture.sampleAt(bench.player.at_s())].tick;
  talk.annotate(gesture.info.description().session_id(), tick, text, [this] { bench.readRemarks(); });
}

AidList Desk::aidsNow() const {
  if (!live_) return usualAids();
  if (aids_ && aids_session_ == live_->sessionId()) return *aids_;
  const auto found = exercise_aids_.find(live_->info().description().exercise_id());
  return found == exercise_aids_.end() ? usualAids() : found->second;
}

void Desk::setAids(const AidList& aids) {
  if (!live_) return;
  aids_ = aids;
  aids_session_ = live_->sessionId();
  talk.setAids(live_->station(), live_->sessionId(), aids);
}

void Desk::resetAids() {
  if (!live_) return;
  aids_.reset();
  talk.resetAids(live_->station(), live_->sessionId());
}

}  // namespace needlelab
