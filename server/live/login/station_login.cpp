#include "server/live/login/station_login.h"

#include <functional>
#include <utility>

#include "db/sessions/session_store.h"
#include "server/live/work/server_work.h"
#include "server/live/work/turn_queue.h"

namespace needlelab {
namespace {

std::string claimedTurnOf(const pb::Login& login, const std::string& address) {
  return "log-in of station " + login.station().station() + " from " + address;
}

}  // namespace

Task<Result<Principal>> checkStationKey(ServerContext& context, std::shared_ptr<const pb::Login> login,
                                        std::string address) {
  std::function<Result<Principal>()> check = [&service = context.store.service(), login] {
    return service.logins().loginStation(login->station().station(), login->station().key());
  };
  return offload(*context.work.logins_in_turn, claimedTurnOf(*login, address), std::move(check));
}

Task<Result<bool>> claimsKnownStation(ServerContext& context, std::shared_ptr<const pb::Login> login,
                                      std::string address) {
  std::function<Result<bool>()> look = [&service = context.store.service(), login] {
    return service.logins().isKnownStation(login->station().station());
  };
  return offload(*context.work.logins_in_turn, claimedTurnOf(*login, address), std::move(look));
}

Task<Result<std::vector<pb::Welcome::OpenSession>>> openSessionsOf(ServerContext& context,
                                                                   std::string station) {
  using Open = std::vector<pb::Welcome::OpenSession>;
  std::string turn = turnNameOf({station, pb::STATION});
  std::function<Result<Open>()> read = [&store = context.store, station]() -> Result<Open> {
    ASSIGN_OR_RETURN(auto reader, store.readers().borrow());
    return SessionStore(*reader).openSessions(station);
  };
  return offload(*context.work.logins_in_turn, std::move(turn), std::move(read));
}

}  // namespace needlelab
