/// The parts of a ServerContext, and the context. The owner provides the pools, which must outlive it.
#pragma once

#include "server/live/context.h"
#include "server/live/counters.h"
#include "server/live/hub/hub.h"
#include "server/live/limits/server_limits.h"
#include "server/live/login/login_state.h"
#include "server/live/port/clock_offsets.h"
#include "server/live/work/server_work.h"
#include "server/together/server_together.h"

namespace needlelab {

struct ServerState {
  Store& store;
  ServerWork work;
  ServerLimits limits;
  Hub hub{};
  ServerTogether together{};
  const bool acks_are_safe = false;
  InFlight in_flight{.io = work.io, .bounds = limits.bounds};
  ServerLogins logins{.io = work.io, .bounds = limits.bounds.logins};
  ClockOffsets clock_offsets{};
  ServerCounters counters{};
  WebCounters web{};
  ServerContext context{.io = work.io,
                        .store = store,
                        .work = work,
                        .limits = limits,
                        .in_flight = in_flight,
                        .logins = logins,
                        .together = together,
                        .hub = hub,
                        .clock_offsets = clock_offsets,
                        .counters = counters,
                        .web = web,
                        .acks_are_safe = acks_are_safe};
};

}  // namespace needlelab
