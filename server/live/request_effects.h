/// Server-side parts of a request, for both ports: choosing its thread pool, completing the reply with the
/// running server's data, and effects on other connections.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "needlelab/session.pb.h"
#include "server/live/context.h"
#include "server/live/remote_live.h"

namespace needlelab {

/// Who takes turns on a FairPool: a station and a person of one name are two.
std::string turnNameOf(const Principal& who);

/// A close, on the closers' threads.
struct CloseWork {
  std::function<Result<std::optional<CloseOutcome>>()> step;  ///< nothing: there is more to do
  std::function<bool()> gone;  ///< whether the connection that asked has ended; on any thread
  /// Whether the next step is one of a long score, as are all after it; not during a step. Empty: none is.
  std::function<bool()> is_long{};
};
/// Closes a session for its station, on the closers: nobody else's work waits for it. Each step is a turn
/// among the closes of all stations, those of a long score among the long ones, once it has one of their
/// places (kLongScoresAtOnce). Of a connection that has ended no further step is done (kUnavailable). Thread:
/// the network's.
Task<Result<CloseOutcome>> closeInTurn(ServerContext& context, std::string station, CloseWork work);

/// Where a person's reply of so many bytes is written as text: up to 16 KiB (about a millisecond) on the
/// network's thread, which null says; below 64 KiB on the workers, so that a page of a list waits for
/// nobody's plots; else on the views.
FairPool* poolForWriting(const ServerContext& context, std::size_t reply_bytes);

/// In the budgets that both ports share.
BudgetOwner budgetOwner(const Principal& who);

/// Waits until `bytes` fit beside what others have taken. Nothing: who asks has `gone`.
Task<std::optional<ByteBudget::Share>> waitForRoom(ByteBudget& budget, std::shared_ptr<Signal> freed,
                                                   Principal who, std::size_t bytes,
                                                   std::function<bool()> gone);

/// The room that a reply to this call of `who` takes while it is made: of the longest reply; little where the
/// reply says "done" only. At most what the budget has (ServerContext::replies).
std::size_t replyRoomOf(const ServerContext& context, const Principal& who, pb::Request::CallCase call);

/// Shares the request; wipes a password or code in it when the last owner releases it.
std::shared_ptr<const pb::Request> wipedWhenReleased(pb::Request request);

/// Takes the room of a call that stores something, from the person's share of the day and from the disk's;
/// whatever executes a call asks here first, and says of the disk's when the call is stored: of one that is
/// refused, it is room again. `bytes`: of the request. Errors: kNoRoom. Thread: the network's.
Result<DiskRoom::Share> takeRoom(ServerContext& context, const Principal& who, pb::Request::CallCase call,
                                 std::size_t bytes);

/// Takes the request's room (takeRoom), then executes it on its thread pool (threadsOf in
/// db/service/requests.h), each of its steps in a turn of its own, a long score's once it has a
/// place (kRescoringsAtOnce). Thread: the network's. `gone` says whether the asker has gone, on any thread:
/// of whom it says so when a turn comes, no more is done (kUnavailable). A step that has begun is finished.
/// Ends an erased person's access, and has the hub forget the name, as soon as the person is erased.
Task<std::shared_ptr<Outcome>> executeRequest(ServerContext& context, Principal who,
                                              std::shared_ptr<const pb::Request> request,
                                              std::function<bool()> gone);

/// Adds data of the running server to `outcome`: online stations; a station's confirmation of a message. May
/// return a refusal to send instead of the reply. `request` and `outcome` must outlive it. Thread: the
/// network's.
Task<std::optional<pb::Refusal>> complete(ServerContext& context, const pb::Request& request, Doer by,
                                          Outcome& outcome);

/// After a request, a refused one, too: ends the access of disabled accounts, ends log-ins with a changed
/// password, announces backups. `asker` (may be null) is the requester's connection, which stays open when it
/// changes its own password. Thread: the network's.
void followUp(ServerContext& context, const Outcome& outcome, const Doer& by, const PeerConnection* asker);

/// Tells all stations here what the verified backups cover by now. Thread: the network's.
void tellSafe(ServerContext& context);

/// An access that has ended, and why.
struct EndedAccess {
  std::string name{};  ///< a person's ref, or a station's name
  bool is_station = false;
  const PeerConnection* except = nullptr;  ///< stays open
  std::string text{};                      ///< for the peer and the logs
  /// What was opened since the change with this number stays: with a number as high (Principal). What has
  /// none ends.
  std::int64_t before_number = INT64_MAX;
};

/// Ends all connections and tokens of a name. Thread: the network's.
void endAccess(ServerContext& context, const EndedAccess& ended, const Doer& by);

/// Ends what was opened by exactly this log-in's account, role and number, because it does not hold in the
/// database any more. Thread: the network's.
void endAccessOf(ServerContext& context, const Principal& who);

/// What another server's `remote` brings to the stations of this one. The context outlives it.
RemoteLive::Deliver deliverForOthers(ServerContext& context);

}  // namespace needlelab
