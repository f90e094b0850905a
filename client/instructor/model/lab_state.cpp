#include "client/instructor/model/lab_state.h"

#include <utility>

#include <nlohmann/json.hpp>

#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "common/profile/profile.h"

namespace needlelab {

std::vector<ScreenAction> loginActions(bool busy) {
  return {{kActLogIn, "Log in", ActionKey::kEnter, "", !busy}};
}

ScreenAction adviceAction(std::string label) {
  return {kActAdvice, std::move(label), ActionKey::kEnter, "", true};
}

std::vector<ScreenAction> searchActions(bool advised) {
  return {{kActSearch, "Search", advised ? ActionKey::kNone : ActionKey::kEnter, "", true}};
}

std::vector<ScreenAction> stopActions(bool asking, std::size_t lessons) {
  const std::string stop = lessons < 2 ? "Stop lesson …" : "Stop " + std::to_string(lessons) + " lessons …";
  if (!asking) return {{kActStop, stop, ActionKey::kNone, "", lessons > 0}};
  return {{kActGoOn, "Cancel", ActionKey::kEnterOrEscape, "", true},
          {kActStopNow, "■ Stop now", ActionKey::kDelete, "", true}};
}

std::vector<ScreenAction> linkActions(LinkPhase phase) {
  if (phase != LinkPhase::kAway && phase != LinkPhase::kRefused) return {};
  return {
      {kActReconnect, phase == LinkPhase::kRefused ? "Log in again" : "Try now", ActionKey::kNone, "", true}};
}

LabState::LabState(ScenePreparer prepare, LabConnectionSettings settings)
    : connection_(std::move(settings)),
      prepare_(std::move(prepare)),
      commands(connection_, notices),
      sessions([this](pb::Request request, LabConnection::Answer answer) {
        connection_.ask(std::move(request), std::move(answer));
      }),
      analysis(connection_, notices, prepare_) {}

LabState::~LabState() = default;

void LabState::logIn() {
  form_trouble.clear();
  const auto servers = parseEndpoints(form.server);
  if (!servers.ok())
    form_trouble = "Server: " + servers.error().message;
  else if (form.ca_file.empty())
    form_trouble =
        "The CA file is missing: the tls/ca.crt of the server's folder. The person who runs the server has "
        "it.";
  else if (form.user.empty())
    form_trouble = "Type your name as an instructor.";
  else if (form.password.empty())
    form_trouble = "Type your password.";
  if (!form_trouble.empty()) return;
  connection_.logIn({*servers, form.ca_file, form.user, form.password});
  connection_.watchAll(10);
  link_ = connection_.state();
}

void LabState::logOut() {
  connection_.logOut();
  if (live_) connection_.unwatch(live_->station());
  live_.reset();
  stop_question.withdraw();
  chosen.clear();
  overview = {};
  inside_ = false;
  form.password.clear();
  screen = WindowScreen::kLogin;
  link_ = connection_.state();
}

void LabState::update(double now_s) {
  last_s_ = std::exchange(now_s_, now_s);
  notices.tick(now_s);
  const LabNews news = connection_.poll();
  link_ = connection_.state();
  if (link_.phase == LinkPhase::kOnline && phase_before_ != LinkPhase::kOnline) {
    // the first log-in shows the lab; after a lost connection the view stays unchanged
    if (!inside_) screen = WindowScreen::kLab;
    if (inside_ && link_.server != server_before_)
      notices.good("Connected to the server " + link_.server + ", no longer to " + server_before_);
    server_before_ = link_.server;
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
  if (link_.phase == LinkPhase::kOnline) {
    requestVerdicts();
    requestDepthPictures();
  }
  if (live_) {
    for (const LiveArrival& arrival : news.frames) live_->feed(arrival);
    requestScene();
  }
  stop_question.keepOnlyFor(lessonsOf(commanded()));
  analysis.poll();
  analysis.player.advance(now_s - last_s_);
}

void LabState::presented(std::int64_t now_unix_ns) {
  if (!live_) return;
  if (screen == WindowScreen::kLive && !live_->paused())
    live_->presented(now_unix_ns);
  else
    live_->latency().discard();
}

void LabState::requestScene() {
  const std::string wanted = live_->sessionToRequest(now_s_);
  if (wanted.empty()) return;
  pb::Request request;
  request.mutable_get_session()->set_session_id(wanted);
  connection_.ask(request, [this, alive = std::weak_ptr(alive_)](Result<pb::Reply> reply) {
    // the server may not have the session yet: request it again later
    if (alive.expired() || !live_ || !reply.ok()) return;
    live_->setSession(reply->session(), prepare_);
    // this lesson's exercise may be new or changed
    readExercises();
  });
}

void LabState::requestVerdicts() {
  for (const std::string& session : overview.verdictsToRequest(now_s_)) {
    pb::Request request;
    request.mutable_get_session()->set_session_id(session);
    connection_.ask(request, [this, alive = std::weak_ptr(alive_)](Result<pb::Reply> reply) {
      if (!alive.expired() && reply.ok()) overview.takeVerdict(reply->session());
    });
  }
}

void LabState::requestDepthPictures() {
  constexpr double kAgain_s = 5;
  for (const StationTile* tile : overview.tiles()) {
    if (tile->session_id.empty() || tile->exercise.empty()) continue;
    Pictured& pictured = depth_pictures_[tile->exercise];
    if (pictured.picture || now_s_ - pictured.asked_s < kAgain_s) continue;
    pictured.asked_s = now_s_;
    pb::Request request;
    request.mutable_get_session()->set_session_id(tile->session_id);
    connection_.ask(
        request, [this, alive = std::weak_ptr(alive_), exercise = tile->exercise](Result<pb::Reply> reply) {
          if (alive.expired() || !reply.ok()) return;  // the server may not have the session yet
          auto picture = depthPictureOf(reply->session().description(), exerciseOf(exercise));
          if (picture.ok()) depth_pictures_[exercise].picture = *std::move(picture);
        });
  }
}

const DepthPicture* LabState::depthPicture(const std::string& exercise) const {
  const auto found = depth_pictures_.find(exercise);
  return found == depth_pictures_.end() || !found->second.picture ? nullptr : &*found->second.picture;
}

std::string LabState::exerciseName(const std::string& id) const {
  const pb::Exercise* const known = exerciseOf(id);
  return printable(known == nullptr || known->name().empty() ? id : known->name());
}

void LabState::readExercises(std::string page, std::vector<pb::Exercise> read) {
  pb::Request request;
  request.mutable_list_exercises()->set_page(page);
  connection_.ask(request, [this, alive = std::weak_ptr(alive_),
                            read = std::move(read)](Result<pb::Reply> reply) mutable {
    if (alive.expired() || !reply.ok()) return;
    for (const auto& row : reply->exercises().exercises()) {
      auto exercise = parseExercise(row.json(), "exercise");
      if (exercise.ok()) read.push_back(*std::move(exercise));
    }
    const std::string& next = reply->exercises().next_page();
    if (!next.empty()) return readExercises(next, std::move(read));
    exercises_.clear();
    exercise_by_id_.clear();
    for (pb::Exercise& exercise : read) {
      exercises_.push_back({exercise.id(), printable(exercise.name())});
      exercise_by_id_.insert_or_assign(exercise.id(), std::move(exercise));
    }
  });
}

void LabState::readLists() {
  pb::Request stations;
  stations.mutable_list_stations();
  connection_.ask(stations, [this, alive = std::weak_ptr(alive_)](Result<pb::Reply> reply) {
    if (!alive.expired() && reply.ok()) overview.setStations(reply->stations(), now_s_);
  });
  readExercises();
  pb::Request profiles;
  profiles.mutable_list_profiles();
  connection_.ask(profiles, [this, alive = std::weak_ptr(alive_)](Result<pb::Reply> reply) {
    if (alive.expired() || !reply.ok()) return;
    profiles_.clear();
    for (const auto& profile : reply->profiles().profiles())
      profiles_.push_back({profile.id(), printable(profile.name().empty() ? profile.id() : profile.name())});
  });
}

void LabState::open(const std::string& station) {
  screen = WindowScreen::kLive;
  if (live_ && live_->station() == station) return;
  if (live_) connection_.unwatch(live_->station());
  live_ = std::make_unique<LiveStation>(station);
  stop_question.withdraw();
  connection_.watch(station);
}

bool LabState::annotate(const std::string& text) {
  if (screen == WindowScreen::kLive && live_) {
    const std::uint64_t tick = live_->shownTick();
    const std::string session = live_->sessionId();
    return commands.annotate(session, tick, text, [this, session, tick, text] {
      if (live_ && live_->sessionId() == session) live_->addRemark(tick, text);
    });
  }
  if (!analysis.first()) {
    notices.trouble("there is nothing to annotate: watch a station or load a session");
    return false;
  }
  const auto& gesture = *analysis.first();
  if (gesture.samples.empty()) return false;
  const std::uint64_t tick = gesture.samples[gesture.sampleAt(analysis.player.at_s())].tick;
  return commands.annotate(gesture.info.description().session_id(), tick, text,
                           [this] { analysis.readRemarks(); });
}

std::vector<Addressee> LabState::addressees() const {
  std::vector<Addressee> all;
  for (const StationTile* tile : overview.tiles())
    if (chosen.contains(tile->station)) all.push_back({tile->station, tile->session_id});
  return all;
}

std::vector<Addressee> LabState::commanded() const {
  if (screen == WindowScreen::kLab) return addressees();
  if (screen == WindowScreen::kLive && live_) return {{live_->station(), live_->sessionId()}};
  return {};
}

AidList LabState::aidsNow() const {
  const auto to = lessonsOf(commanded());
  if (to.empty()) return usualAids();
  if (const auto set = aids_.find(to.front().session_id); set != aids_.end()) return set->second;
  const StationTile* const tile = overview.find(to.front().station);
  const pb::Exercise* const exercise =
      screen == WindowScreen::kLive ? exerciseNow() : exerciseOf(tile == nullptr ? "" : tile->exercise);
  return exercise == nullptr ? usualAids() : aidsOfExercise(*exercise);
}

std::vector<PlotRequirement> LabState::requirementsNow() const {
  const pb::Exercise* const exercise = exerciseNow();
  return exercise == nullptr ? std::vector<PlotRequirement>() : requirementsOf(*exercise);
}

std::optional<PlanView> LabState::planNow() const {
  const pb::Exercise* const exercise = exerciseNow();
  // without a scene the plan's position in W is unknown
  if (exercise == nullptr || !live_->scene().view) return std::nullopt;
  return planViewOf(*live_->scene().view, *exercise);
}

const pb::Exercise* LabState::exerciseOf(const std::string& id) const {
  const auto found = exercise_by_id_.find(id);
  return found == exercise_by_id_.end() ? nullptr : &found->second;
}

const pb::Exercise* LabState::exerciseNow() const {
  return live_ ? exerciseOf(live_->info().description().exercise_id()) : nullptr;
}

void LabState::setAids(const AidList& aids) {
  const auto to = lessonsOf(commanded());
  for (const Addressee& lesson : to) aids_[lesson.session_id] = aids;
  commands.setAids(to, aids);
}

void LabState::resetAids() {
  const auto to = lessonsOf(commanded());
  for (const Addressee& lesson : to) aids_.erase(lesson.session_id);
  commands.resetAids(to);
}

void recallLogin(const std::filesystem::path& file, LoginForm& form) {
  const auto text = readWholeFile(file, 1u << 16);
  if (!text.ok()) return;
  const auto json = nlohmann::json::parse(*text, nullptr, false);
  if (!json.is_object()) return;
  const auto take = [&](const char* key, std::string& field) {
    const auto found = json.find(key);
    if (found != json.end() && found->is_string()) field = printable(found->get<std::string>());
  };
  take("server", form.server);
  take("ca_file", form.ca_file);
  take("user", form.user);
}

Status rememberLogin(const std::filesystem::path& file, const LoginForm& form) {
  const nlohmann::ordered_json json = {
      {"server", form.server}, {"ca_file", form.ca_file}, {"user", form.user}};
  const std::string text = json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  return writeFileAtomically(file, viewOf(text), 0600);
}

}  // namespace needlelab
