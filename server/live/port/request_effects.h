/// Server-side parts of a request, for both ports: choosing its thread pool, completing the reply with the
/// running server's data, and effects on other connections.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "needlelab/session.pb.h"
#include "server/live/context.h"
#include "server/live/limits/byte_budget.h"
#include "server/live/limits/disk_room.h"
#include "server/live/work/offload.h"
#include "server/together/remote_live.h"

namespace needlelab {

/// A close, on the closers' threads.
struct CloseWork {
  std::function<Result<std::optional<CloseOutcome>>()> step;  ///< nothing: more steps remain
  std::function<bool()> gone;  ///< whether the requesting connection has ended; thread: any
  /// Whether the next step, and so all later ones, belong to a long score. Not called during a step. Empty:
  /// never.
  std::function<bool()> is_long{};
};
/// Closes a session for its station, on the closers, so that it delays no other work. Each step is a turn
/// among the closes of all stations; steps of a long score are turns among the long ones, after it has a
/// place (kLongScoresAtOnce). When the connection has ended, no further step is done (kUnavailable). Thread:
/// the network's.
Task<Result<CloseOutcome>> closeQueued(ServerContext& context, std::string station, CloseWork work);

/// Where a person's reply of this size is written as text. Up to 16 KiB (about a millisecond): null, on the
/// network's thread. Below 64 KiB: on the workers, so that a page of a list does not wait for plots.
/// Otherwise: on the views.
FairPool* poolForWriting(const ServerContext& context, std::size_t reply_bytes);

/// The owner in the budgets that both ports share.
BudgetOwner budgetOwner(const Principal& who);

/// Waits until `bytes` fit into the budget. Nothing: the requester has `gone`.
Task<std::optional<ByteBudget::Share>> waitForRoom(ByteBudget& budget, std::shared_ptr<Signal> freed,
                                                   Principal who, std::size_t bytes,
                                                   std::function<bool()> gone);

/// Room reserved for the reply to this call of `who` while it is made: that of the longest reply, or little
/// if the reply only says "done". At most what the budget has (InFlight::replies).
std::size_t replyRoomOf(const ServerContext& context, const Principal& who, pb::Request::CallCase call);

/// Shares the request; wipes a password or code in it when the last owner releases it.
std::shared_ptr<const pb::Request> wipedWhenReleased(pb::Request request);

/// Takes room for a call that stores something, from the person's daily share and the disk. Must be called
/// before executing any call. Mark the share as stored if the call was; otherwise its end frees the disk's
/// room. `bytes`: of the request. Errors: kNoRoom. Thread: the network's.
Result<DiskRoom::Share> takeRoom(ServerContext& context, const Principal& who, pb::Request::CallCase call,
                                 std::size_t bytes);

/// Takes the request's room (takeRoom), then executes it on its thread pool (threadsOf in
/// db/service/requests/requests.h). Each step has its own turn; a long score first gets a place
/// (kRescoringsAtOnce). `gone`, called on any thread: when it is true at a turn, no further step starts
/// (kUnavailable); a started step is completed. As soon as a person is erased, ends their access and makes
/// the hub forget the name. Thread: the network's.
Task<std::shared_ptr<Outcome>> executeRequest(ServerContext& context, Principal who,
                                              std::shared_ptr<const pb::Request> request,
                                              std::function<bool()> gone);

/// Adds data of the running server to `outcome`: online stations; a station's confirmation of a message. May
/// return a refusal to send instead of the reply. `request` and `outcome` must outlive it. Thread: the
/// network's.
Task<std::optional<pb::Refusal>> complete(ServerContext& context, const pb::Request& request, Doer by,
                                          Outcome& outcome);

/// After a request, even a refused one: ends the access of disabled accounts, ends log-ins with a changed
/// password, announces backups. `asker` (may be null) is the requester's connection, which stays open when it
/// changes its own password. Thread: the network's.
void followUp(ServerContext& context, const Outcome& outcome, const Doer& by, const LivePeer* asker);

/// Reports to all stations here what the verified backups cover now. Thread: the network's.
void sendSafe(ServerContext& context);

/// An access that has ended, and why.
struct EndedAccess {
  std::string name{};  ///< a person's ref, or a station's name
  bool is_station = false;
  const LivePeer* except = nullptr;  ///< stays open
  std::string text{};                ///< for the peer and the logs
  /// Access with at least this number was opened after the change and stays (Principal). Access without a
  /// number ends.
  std::int64_t before_number = INT64_MAX;
};

/// Ends all connections and tokens of a name. Thread: the network's.
void endAccess(ServerContext& context, const EndedAccess& ended, const Doer& by);

/// Ends everything opened with exactly this account, role and number, because it is no longer valid in the
/// database. Thread: the network's.
void endAccessOf(ServerContext& context, const Principal& who);

/// Delivers what another server sends to this one's stations through `remote`. The context must outlive it.
RemoteLive::Deliver remoteDelivery(ServerContext& context);

}  // namespace needlelab
