#include "server/web/live_board.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "common/base/text/uuid.h"
#include "common/base/time/clock.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/phase_words.h"
#include "common/profile/layer_names.h"
#include "common/profile/profile.h"
#include "db/login/credentials.h"
#include "db/sessions/session_store.h"
#include "server/base/http_message.h"
#include "server/base/log.h"
#include "server/live/hub/hub.h"
#include "server/live/work/server_work.h"

namespace needlelab {
namespace {

constexpr std::int64_t kStationsEvery_ns = 2'000'000'000;

struct BoardFacts {
  pb::Stations stations;
  std::map<std::string, std::vector<std::string>> layer_names;  // by session
};

/// Reads the existing stations, and the layers of new sessions. On a worker's thread.
Result<BoardFacts> readBoardFacts(Store& store, bool stations_too, const std::vector<std::string>& sessions) {
  ASSIGN_OR_RETURN(auto reader, store.readers().borrow());
  BoardFacts facts;
  if (stations_too) {
    ASSIGN_OR_RETURN(const auto stations, StationStore(*reader).list());
    for (const Station& station : stations) {
      if (!station.revoked) facts.stations.add_stations()->set_name(station.name);
    }
  }
  for (const std::string& bytes : sessions) {
    Uuid id;
    if (bytes.size() != id.size()) continue;
    std::copy(bytes.begin(), bytes.end(), id.begin());
    const auto info = SessionStore(*reader).info(id);
    if (!info) continue;  // its first status arrived before it was stored: retried later
    const auto profile = parseProfile(info->description().profile_json(), "profile");
    facts.layer_names[bytes] = profile ? layerNames(*profile) : std::vector<std::string>();
  }
  return facts;
}

std::string boardSessionText(const std::string& bytes) {
  Uuid id;
  if (bytes.size() != id.size()) return {};
  std::copy(bytes.begin(), bytes.end(), id.begin());
  return uuidText(id);
}

}  // namespace

void LiveBoard::onViewerJoined() {
  ++viewers_;
  if (std::exchange(running_, true)) return;
  asio::co_spawn(context_.io, run(shared_from_this()), rethrow);
}

void LiveBoard::onViewerLeft() {
  --viewers_;
}

void LiveBoard::stop() {
  stopping_ = true;
  tick_.cancel();
  wakeAll();
}

Task<> LiveBoard::run(std::shared_ptr<LiveBoard> self) {
  LiveBoard& board = *self;
  auto next = std::chrono::steady_clock::now();
  while (board.viewers_ > 0 && !board.stopping_) {
    co_await board.readStore();
    if (board.stopping_) break;
    board.newest_ = std::make_shared<const std::string>(board.make());
    ++board.number_;
    board.wakeAll();
    // after a stall, do not send a burst to catch up
    next = std::max(next + board.period_, std::chrono::steady_clock::now() + board.period_ / 2);
    board.tick_.expires_at(next);
    co_await board.tick_.async_wait(kUseTuple);
  }
  board.running_ = false;
  board.newest_.reset();
  board.layer_names_.clear();
}

Task<> LiveBoard::readStore() {
  const std::int64_t now = steadyNowNs();
  const bool stations_too = stations_ns_ == 0 || now - stations_ns_ >= kStationsEvery_ns;
  context_.hub.fillStations(stations_);
  std::vector<std::string> unknown;
  std::map<std::string, std::vector<std::string>> known;
  for (const pb::StationInfo& station : stations_.stations()) {
    const std::string& session = station.status().session_id();
    if (session.empty()) continue;
    const auto found = layer_names_.find(session);
    if (found == layer_names_.end())
      unknown.push_back(session);
    else
      known.insert(*found);
  }
  layer_names_ = std::move(known);
  if (!stations_too && unknown.empty()) co_return;
  std::function<Result<BoardFacts>()> read = [&store = context_.store, stations_too, unknown] {
    return readBoardFacts(store, stations_too, unknown);
  };
  auto facts = co_await offload(context_.work.workers, std::move(read));
  if (!facts.ok()) {
    logEvent(LogLevel::kWarning, "live_read_failed", {{"text", facts.error().message}});
    co_return;
  }
  layer_names_.merge(facts->layer_names);
  if (!stations_too) co_return;
  stations_ns_ = now;
  stations_ = std::move(facts->stations);
  context_.hub.fillStations(stations_);
}

std::string LiveBoard::make() {
  WebJson tiles = WebJson::array();
  for (pb::StationInfo& station : *stations_.mutable_stations()) {
    const pb::StationStatus& status = station.status();
    const bool idle = !station.online() || status.session_id().empty();
    const auto names = layer_names_.find(status.session_id());
    std::string layer;
    if (!idle && status.layer() >= 0 && names != layer_names_.end() &&
        static_cast<std::size_t>(status.layer()) < names->second.size())
      layer = names->second[static_cast<std::size_t>(status.layer())];
    const bool trouble = status.trouble().empty() && status.fault() != 0;
    tiles.push_back({{"station", station.name()},
                     {"server", station.online() ? status.server() : std::string()},
                     {"online", station.online()},
                     {"session_id", boardSessionText(status.session_id())},
                     {"trainee", idle ? std::string() : status.trainee()},
                     {"trainee_full_name", idle ? std::string() : status.trainee_full_name()},
                     {"exercise", idle ? std::string() : status.exercise_id()},
                     {"phase", phaseWord(idle ? 0u : status.phase())},
                     {"depth_m", idle ? 0 : status.insertion_m()},
                     {"layer", layer},
                     {"force_n", idle ? 0 : status.force_n()},
                     {"peak_force_n", idle ? 0 : status.peak_force_n()},
                     {"fault", trouble ? faultText(static_cast<Fault>(std::min(status.fault(), 255u)))
                                       : status.trouble()},
                     {"drops", status.missed_ticks()}});
    // the status is older than its station's connection: discard it
    station.clear_status();
    station.set_online(false);
  }
  return WebJson{{"live_trouble", stations_.live_trouble()}, {"tiles", std::move(tiles)}}.dump(
      -1, ' ', false, WebJson::error_handler_t::replace);
}

}  // namespace needlelab
