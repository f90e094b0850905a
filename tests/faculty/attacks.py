"""Attacks on a faculty while its stations send and people watch. Each scenario runs in its own lab and returns its final judgement; up to then
nothing acknowledged has been missing. A number from `dice` decides everything that a seed must repeat."""
import functools
import signal
import time

from faculty_lab import CLOCK_SHIM, GROUPS, GUARD_NS, OTHER, SERVERS, CannotPlay, Viewer, stopped, until
from fault_lab import PASSWORD, Judgement
from measures import Fault, longest_silence, median_ms
from peers import Person, Refused, StationPeer
from scenarios import kill_and_promote, new_standby

PAUSE_S = 10
UNTOUCHED_S = 10  # longer than a busy machine delays a station that is not affected
LONG_CUT_EVERY, LONG_CUT_S = 3, (34, 38)  # longer than the 30 s after which a server considers a silent peer dead
PRESENCE_ENDS_S = 8  # a server that is silent for 3 s counts as having no stations
ACCESS_ENDS_S = 5  # the promise is 1 s
HOUR = 3600


def now_ns():
    return time.time_ns()


def again_and_again(lab, dice, rounds, fault, **how):
    """`fault(lab, dice, round_number)` returns a Fault once the lab again has everything it needs."""
    lab.open(**how)
    lab.stream(dice)
    for round_number in range(rounds):
        lab.place_viewers(dice)
        time.sleep(dice.uniform(0, 0.5))
        done = fault(lab, dice, round_number)
        lab.faults_played += 1
        lab.measure(done)
        done.restore()
        lab.nothing_missing()
        if is_caught(lab):
            return lab.with_findings(Judgement())
    return lab.finish()


def is_caught(lab):
    """A planted bug counts as found; its other effects do not matter."""
    return lab.plant is not None and bool(lab.findings)


def no_acks(lab, seconds):
    """Waits first for work in progress."""
    time.sleep(0.3)
    lab.silent_for(seconds)


def untouched(lab, fault):
    """Lessons and their storage are not affected."""
    lab.acks.read()
    end = now_ns()
    for name in lab.names:
        since, until_ns = longest_silence(lab.acks.times[name], fault.begin, end)
        if (until_ns or end) - max(since, fault.begin) > UNTOUCHED_S * 10**9:
            lab.findings.append(("lesson-touched", f"{name} heard no ack for {UNTOUCHED_S} s of a fault that is not to touch it"))
    return fault


# --- killed

def kill_server(lab, dice, _):
    """Its stations go to the other one."""
    name = lab.busier(dice)
    there, begin = lab.stations_at(name), now_ns()
    lab.kill(name)

    def restore():
        lab.start(name)
        lab.hear_each_other()
    return Fault(begin, begin, there, restore)


def kill_primary(lab, _dice, _):
    """Its standby is promoted; the lost one becomes the new standby."""
    a, b, begin = lab.primary, lab.standby, now_ns()
    kill_and_promote(a, b)
    lab.nothing_missing(b)
    new_standby(a, b)
    lab.primary, lab.standby = b, a
    return Fault(begin, now_ns(), lab.names)


def kill_standby(lab, dice, _):
    """Nothing is acknowledged without it."""
    begin = now_ns()
    lab.standby.kill()
    no_acks(lab, dice.uniform(1, 3))
    lab.standby.start()
    until(lab.is_followed, "the standby follows")
    return Fault(begin, now_ns(), lab.names)


def kill_nats(lab, dice, _):
    """Lessons and their storage are not affected."""
    begin = now_ns()
    lab.nats.kill()
    lab.nats.wait()
    time.sleep(dice.uniform(2, 5))
    lab.start_nats()
    return untouched(lab, Fault(begin, now_ns(), lab.names))


# --- stopped for a while

def pause_server(lab, dice, _):
    """Its stations wait for it: a peer counts as dead after 30 s."""
    name = lab.busier(dice)
    there, begin = lab.stations_at(name), now_ns()
    with stopped(lab.servers[name]):
        time.sleep(PAUSE_S)
    return Fault(begin, now_ns(), there)


def pause_cluster(lab, which):
    cluster, begin = getattr(lab, which), now_ns()
    cluster.signal_all(signal.SIGSTOP)
    no_acks(lab, PAUSE_S - 0.3)
    cluster.signal_all(signal.SIGCONT)
    return Fault(begin, now_ns(), lab.names)


def pause_primary(lab, _dice, _):
    return pause_cluster(lab, "primary")


def pause_standby(lab, _dice, _):
    return pause_cluster(lab, "standby")


def pause_nats(lab, _dice, _):
    begin = now_ns()
    with stopped(lab.nats):
        time.sleep(PAUSE_S)
    return untouched(lab, Fault(begin, now_ns(), lab.names))


def depose_server(lab, dice, _):
    """It hangs, holding what its stations have sent, until they are at the other one; then it continues and must acknowledge none of it."""
    name = lab.busier(dice)
    there, begin = lab.stations_at(name), now_ns()
    repeated, deposed = lab.chunks(name, "repeated"), lab.metric("needlelab_stations_deposed_total", name)
    with stopped(lab.servers[name]):
        until(lambda: set(there) <= set(lab.stations_at(OTHER[name])), "all stations are at the other server", 60, 0.1)
        lab.all_acknowledged(there, now_ns())
        time.sleep(dice.uniform(0, 2))
    goes_on, end = now_ns(), time.monotonic() + 5
    while time.monotonic() < end and lab.chunks(name, "repeated") == repeated:
        time.sleep(0.2)
    lab.deposed += int(lab.metric("needlelab_stations_deposed_total", name) - deposed)
    if (more := lab.chunks(name, "repeated") - repeated) > 0:
        lab.findings.append(("acknowledged-by-a-deposed-server", f"server {name} acknowledged {more} chunks that the other one had stored"))
    return Fault(begin, begin, there, viewers_healed=goes_on)  # people at that server wait for it


def deposed_server(lab, dice, rounds):
    lab.deposed = 0
    judgement = again_and_again(lab, dice, rounds, depose_server)
    lab.notes.append(f"{lab.deposed} connections were told that they are deposed")
    return judgement


# --- networks

def long_or_short(dice, round_number):
    return dice.uniform(*LONG_CUT_S) if round_number % LONG_CUT_EVERY == LONG_CUT_EVERY - 1 else dice.uniform(4, 10)


def cut_server_from_postgres(lab, dice, _):
    """It acknowledges nothing; the other server's stations continue."""
    name, way = lab.busier(dice), dice.choice(["to", "from", "both"])
    there, begin = lab.stations_at(name), now_ns()
    for cluster in (lab.primary, lab.standby):
        lab.cables.cut(name, f"db-{cluster.folder.name}", way)
    time.sleep(1)
    quiet = now_ns()
    time.sleep(dice.uniform(3, 9))
    # first what was received, then which stations are there: one that has left by then may have acks from the other server
    heard = lab.acks.read()
    still = [one for one in there if one in lab.stations_at(name)]
    if (acks := heard.since(still, quiet)) > 0:
        lab.findings.append(("acknowledged-without-a-store", f"server {name} sent {acks} acks while cut off ({way}) from PostgreSQL"))
    lab.cables.heal()
    return Fault(begin, now_ns(), there)


def cut_server_from_nats(lab, dice, _):
    name, way, begin = dice.choice(sorted(SERVERS)), dice.choice(["to", "from", "both"]), now_ns()
    lab.cables.cut(name, "nats", way)
    time.sleep(dice.uniform(4, 12))
    lab.cables.heal()
    return untouched(lab, Fault(begin, now_ns(), lab.names))


def cut_stations_from_server(lab, dice, round_number):
    """Every third time longer than TCP and both ends tolerate: the stations go to the other server."""
    name, way = lab.busier(dice), dice.choice(["to", "from", "both"])
    at = lab.stations_at(name)
    group = dice.choice([one for one in GROUPS if any(lab.group_of(station) == one for station in at)])
    there, begin = [one for one in at if lab.group_of(one) == group], now_ns()
    lab.cables.cut(group, name, way)
    time.sleep(long_or_short(dice, round_number))
    lab.cables.heal()
    return Fault(begin, now_ns(), there)


def depose_primary(lab, dice, _):
    """One server sees only the old primary, which is still running; its standby is promoted and has its own standby. The old primary's server
    acknowledges nothing, the other one continues."""
    a, b, c = lab.primary, lab.standby, lab.spare
    name = lab.busier(dice)
    there, others, begin = lab.stations_at(name), lab.stations_at(OTHER[name]), now_ns()
    lab.cables.cut(name, f"db-{b.folder.name}")
    lab.cables.cut(name, f"db-{c.folder.name}")
    lab.cables.cut(OTHER[name], f"db-{a.folder.name}")
    b.promote()
    lab.nothing_missing(b)
    promoted = now_ns()
    c.follow(b)
    lab.primary, lab.standby, lab.spare = b, c, a
    followed = now_ns()
    lab.all_acknowledged(others, followed)
    if others:
        lab.notes.append(f"the other server's stations stream {(now_ns() - followed) / 1e9:.1f} s after the promoted one has a standby")
    time.sleep(dice.uniform(2, 6))
    heard, gone = lab.acks.read(), lab.stations_at(OTHER[name])
    if (acks := heard.since([one for one in there if one not in gone], promoted + 3 * GUARD_NS)) > 0:
        lab.findings.append(("acknowledged-by-a-deposed-primary", f"server {name} sent {acks} acks with a primary that another one has replaced"))
    lab.nothing_missing(b)
    a.kill()
    lab.cables.heal()
    return Fault(begin, now_ns(), there)


# --- others

def slow_viewers(lab, dice, _):
    """People at the other server request all samples of all stations and read nothing: nothing else is affected."""
    name = lab.busier(dice)
    at, begin = OTHER[name], now_ns()
    dropped = lab.metric("needlelab_live_frames_dropped_total", at)
    slow = [Person(lab, at, "ada", PASSWORD, receive_bytes=4096) for _ in range(3)]
    try:
        for one in slow:
            one.watch(lab.names)
        time.sleep(8)  # a peer that accepts nothing is cut off after 10 s
        queued = lab.metric("needlelab_live_queue_bytes", at)
        more = lab.metric("needlelab_live_frames_dropped_total", at) - dropped
    finally:
        for one in slow:
            one.socket.close()
    if more <= 0 or queued > len(slow) * 2**20 + 2**20:
        lab.findings.append(("slow-viewer", f"{more:.0f} frames dropped, {queued:.0f} bytes queued at server {at}"))
    return untouched(lab, Fault(begin, begin, lab.names))


def clocks_apart(lab, dice, rounds):
    """Server a is five hours behind, b four ahead, each station somewhere between: no clock decides which data are newer."""
    if not (lab.template_of.bin / CLOCK_SHIM).exists():
        raise CannotPlay(f"{lab.template_of.bin / CLOCK_SHIM} is not built")
    lab.ahead_s.update({"a": -5 * HOUR, "b": 4 * HOUR})
    # the certificates are made with the clock that is furthest behind
    lab.ahead_s.update({name: dice.randrange(-4 * HOUR, 5 * HOUR) for name in lab.names})
    lab.acks.ahead_ns.update({name: lab.ahead_s[name] * 10**9 for name in lab.names})
    return again_and_again(lab, dice, rounds, kill_server)


# --- without a storm of stations

def presence_ends(lab, dice, rounds):
    """A server dies whose stations know no other: the other server's overview soon shows them offline."""
    lab.servers_of_stations = "a"
    lab.open()
    seconds = []
    lab.stream(dice)
    for _ in range(rounds):
        lab.viewers = [Viewer(lab, "b", None, 5)]
        lab.all_seen(now_ns())
        begin = time.monotonic()
        lab.kill("a")
        lab.faults_played += 1
        view = lab.viewers[0]
        while online := [name for name in lab.names if not view.says_offline(name)]:
            if time.monotonic() - begin > (most := lab.within(PRESENCE_ENDS_S)):
                lab.findings.append(("online-for-ever", f"{len(online)} stations of a dead server are online at the other one after {most} s"))
                break
            time.sleep(0.05)
        if is_caught(lab):
            return lab.with_findings(Judgement())
        seconds.append(time.monotonic() - begin)
        lab.start("a")
        lab.hear_each_other()
        lab.all_acknowledged(lab.names, now_ns())
        lab.all_seen(now_ns())
        lab.end_viewers()
    lab.notes.append(f"offline at the other server after {median_ms(seconds)} ms (median)")
    return lab.finish()


def access_ends(lab, _dice, rounds):
    """An account and a station's key are ended at server a: their connections and tokens end at b."""
    lab.open(standby=False)
    judgement, ended, most = Judgement(), [], lab.within(ACCESS_ENDS_S)
    lab.admin("a", "user", "add", "mia", "--role", "instructor", "--password-file", lab.template / "password")
    for number in range(rounds):
        station = lab.names[number]  # a revoked one stays revoked: the key is the template's
        first = Person(lab, "a", "mia", PASSWORD)
        here = Person(lab, "b", token=first.token)  # b knows the token now
        there = StationPeer(lab, "b", station)
        begun = time.monotonic()
        lab.admin("a", "user", "disable", "mia")
        lab.faults_played += 1
        after = here.ended_after(most)
        ended.append(time.monotonic() - begun)
        if after is None:
            judgement.faults.append(("connection-outlives-access", f"server b keeps the connection of a disabled account for {most} s"))
        try:
            Person(lab, "b", token=first.token).socket.close()
            judgement.faults.append(("token-outlives-access", "server b takes the token of an account that was disabled at server a"))
        except (Refused, ConnectionError):
            pass
        revoked = time.monotonic()
        lab.admin("a", "station", "revoke", station)
        while there.ended_at is None and time.monotonic() - revoked < most:
            time.sleep(0.02)
        if there.ended_at is None:
            judgement.faults.append(("connection-outlives-access", f"server b keeps the connection of a revoked station for {most} s"))
        for one in (first, here):
            one.socket.close()
        there.close()
        lab.admin("a", "user", "enable", "mia")
    lab.notes.append(f"ended at the other server after {median_ms(ended)} ms (median), with the command")
    return judgement


def stop_after_a_takeover(lab, dice, rounds):
    """A station has moved from a hung server to the other one, and its old connection still exists: a stop reaches only the new one, whichever server
    is asked."""
    lab.open(standby=False)
    judgement = Judgement()
    for number in range(rounds):
        station, old_at = lab.names[number % len(lab.names)], dice.choice(sorted(SERVERS))
        new_at = OTHER[old_at]
        old = StationPeer(lab, old_at, station)
        with stopped(lab.servers[old_at]):
            new = StationPeer(lab, new_at, station)
            time.sleep(dice.uniform(0.5, 1.5))
        time.sleep(2)  # both have heard of it
        lab.faults_played += 1
        for asked in sorted(SERVERS):
            reason = f"round {number}, asked at {asked}"
            person = Person(lab, asked, "ada", PASSWORD)
            try:
                person.stop_lesson(station, reason)
            except Refused as why:
                judgement.faults.append(("stop-refused", f"server {asked}: {why}"))
            person.socket.close()
            time.sleep(0.5)  # the server answers once the station has confirmed it
            if reason in old.stops:
                judgement.faults.append(("stop-at-the-wrong-place", f"asked at server {asked}: the connection at {old_at}, which had lost the station, got it"))
            elif reason not in new.stops:
                judgement.faults.append(("stop-lost", f"asked at server {asked}: the station at {new_at} did not get it"))
        old.close()
        new.close()
    return judgement


def of(fault, **how):
    return functools.partial(again_and_again, fault=fault, **how)
