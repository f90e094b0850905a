"""What happens to PostgreSQL while stations send. Each scenario runs in its own lab and returns the judge's last judgement; the judge has found
nothing until then. A number from `dice` decides everything that a seed must repeat."""
import contextlib
import json
import os
import shutil
import signal
import time

from clusters import MOST_CONNECTIONS, Failed, Session, until
from commit_proxy import CommitProxy
from fault_lab import STATIONS, Judgement

MISSING = "acknowledged-but-missing"
ANSWER_TIMEOUT_S = 30  # PostgresOptions::answer_timeout
POWER_CUT, TWO_DISKS = "power-cut", "two-disks"  # what an ack must survive, as named by needlelab-server


class CannotPlay(Exception):
    """Why a scenario cannot be played on this machine."""


def sound(judgement):
    """Returns the judgement; raises Failed if it has a fault."""
    if judgement.faults:
        raise Failed(f"{len(judgement.faults)} faults: " + "; ".join(f"{name}: {text}" for name, text in judgement.faults[:3]))
    return judgement


def streaming(lab, dice, url, durability=POWER_CUT, samples=2000):
    lab.start_server(url, durability)
    lab.start_stations(dice.randrange(1, 1000), samples=samples)
    lab.wait_for_more("ack", 10)
    if durability == TWO_DISKS and (found := lab.health())["ack_survives"] != "the loss of a disk":
        raise Failed(f"{found}")


def two_disks(lab, dice, samples=2000):
    """A primary, its synchronous standby, and a server that requires both."""
    a = lab.cluster("a")
    b = lab.standby_of(a, "b")
    streaming(lab, dice, lab.url(a, b), TWO_DISKS, samples)
    return a, b


# --- one server of PostgreSQL, within two-disks with its standby

def standbys_of(lab, a, durability):
    return [lab.standby_of(a, "b")] if durability == TWO_DISKS else []


def alone_have_all(lab, standbys):
    """While nothing can be acknowledged: acknowledged data are at each standby, whatever happens to the primary."""
    for b in standbys:
        b.replayed()
        sound(lab.judge(b, False, [b]))


def again_and_again(lab, dice, rounds, durability, fault):
    """`fault` is a context in which PostgreSQL is away."""
    a = lab.cluster("a")
    standbys = standbys_of(lab, a, durability)
    streaming(lab, dice, lab.url(a, *standbys), durability)
    for round_number in range(rounds):
        with fault(a):
            lab.faults_played += 1
            if round_number == rounds - 1:
                alone_have_all(lab, standbys)
        lab.wait_for_more("ack", dice.randrange(3, 20))
    return lab.finish(a, *standbys)


def restart(lab, dice, rounds, durability):
    @contextlib.contextmanager
    def fault(a):
        a.stop()
        yield
        a.start()
    return again_and_again(lab, dice, rounds, durability, fault)


def kill(lab, dice, rounds, durability):
    @contextlib.contextmanager
    def fault(a):
        a.kill()
        if lab.health()["healthy"]:
            raise Failed("the server says that it is healthy without PostgreSQL")
        yield
        a.start()
    return again_and_again(lab, dice, rounds, durability, fault)


def pause(lab, dice, rounds, durability):
    @contextlib.contextmanager
    def fault(a):
        a.signal_all(signal.SIGSTOP)
        time.sleep(dice.uniform(0.3, 2))
        yield
        a.signal_all(signal.SIGCONT)
    return again_and_again(lab, dice, rounds, durability, fault)


def pause_long(lab, dice, rounds, durability):
    """Longer than the server waits for an answer: it drops the connection, and later asks about the outcome of a COMMIT."""
    a = lab.cluster("a")
    standbys = standbys_of(lab, a, durability)
    streaming(lab, dice, lab.url(a, *standbys), durability)
    for _ in range(rounds):
        a.signal_all(signal.SIGSTOP)
        lab.faults_played += 1
        time.sleep(0.3)  # acks in progress
        lab.silent_for(ANSWER_TIMEOUT_S + dice.uniform(1, 5))
        if lab.health()["healthy"]:
            raise Failed("the server says that it is healthy while PostgreSQL stands still")
        a.signal_all(signal.SIGCONT)
        lab.wait_for_more("ack", dice.randrange(3, 20), 90)
    return lab.finish(a, *standbys)


def connections(lab, dice, rounds, durability):
    """Others occupy all of PostgreSQL's connections, including the server's."""
    @contextlib.contextmanager
    def fault(a):
        hogs, end = [Session(a)], time.monotonic() + dice.uniform(1, 2)
        # at its end all are occupied: a terminated one frees its slot a moment later
        while time.monotonic() < end or (len(hogs) < MOST_CONNECTIONS and time.monotonic() < end + 60):
            hogs[0].ask("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = 'needlelab'")
            while not (more := Session(a)).refused:
                hogs.append(more)
            more.close()
            time.sleep(0.02)
        if len(hogs) != MOST_CONNECTIONS:
            raise Failed(f"{len(hogs)} connections of {MOST_CONNECTIONS} were taken")
        if lab.health()["healthy"]:
            raise Failed("the server says that it is healthy without a connection")
        yield
        for hog in hogs:
            hog.close()
    return again_and_again(lab, dice, rounds, durability, fault)


def fill(folder, ballast):
    """Takes every free byte, even while PostgreSQL also takes some."""
    with open(ballast, "wb") as file:
        while (free := os.statvfs(folder)).f_bavail > 0:
            with contextlib.suppress(OSError):
                os.posix_fallocate(file.fileno(), 0, free.f_bavail * free.f_bsize)
                return


def disk_full(lab, dice, rounds, durability):
    """PostgreSQL's disk is full: it refuses, or ends and restarts once there is room."""
    if os.getuid() != 0:
        raise CannotPlay("a small disk can only be mounted by root")
    a = lab.room_for("a", 160)
    standbys = standbys_of(lab, a, durability)
    streaming(lab, dice, lab.url(a, *standbys), durability)
    ballast = a.folder / "ballast"
    for _ in range(rounds):
        fill(a.folder, ballast)
        # 1 MiB segments of its log and pages of its tables soon fill up
        until(lambda: not lab.health()["healthy"], "the server says that nothing is stored", 90, 0.2)
        lab.faults_played += 1
        time.sleep(dice.uniform(0, 1))
        ballast.unlink()
        if not a.everybody():
            a.start()
        # a station whose server had no room asks again after 15 s
        lab.wait_for_more("ack", dice.randrange(3, 20))
    return lab.finish(a, *standbys)


def load(lab, dice, rounds, durability):
    """needlelab-load is the judge: it reads all samples back through the server, and exits with 0 if they are those it made."""
    a = lab.cluster("a")
    lab.start_server(lab.url(a, *standbys_of(lab, a, durability)), durability)
    made = lab.start_load(12, 8 * rounds)
    until(lambda: made.poll() is not None or lab.metric('needlelab_chunks_total{result="stored"}') > 0, "the load sends")
    for round_number in range(rounds):
        if made.poll() is not None:
            break
        lab.faults_played += 1
        time.sleep(dice.uniform(0.3, 2))
        if round_number % 3 == 2:
            a.signal_all(signal.SIGSTOP)
            time.sleep(dice.uniform(0.5, 2))
            a.signal_all(signal.SIGCONT)
            continue
        a.kill() if round_number % 3 == 0 else a.stop()  # pylint: disable=expression-not-assigned
        a.start()
    out, err = made.communicate(timeout=300)
    if made.returncode != 0:
        raise Failed(f"needlelab-load: exit code {made.returncode}\n{out[-2000:]}\n{err[-2000:]}")
    judgement, said = Judgement(), json.loads(out)
    judgement.samples, judgement.sessions = said["samples_made"], said["sessions_closed"]
    lab.stop_server()
    return judgement


# --- the network between

def cut_commits(lab, dice, rounds, durability, modes):
    """In the middle of a COMMIT; until PostgreSQL can be asked, the outcome is unknown and not acknowledged."""
    a = lab.cluster("a")
    standbys = standbys_of(lab, a, durability)
    proxy = CommitProxy(a)
    try:
        streaming(lab, dice, f"postgresql://needlelab@127.0.0.1:{proxy.port}/lab?sslmode=disable", durability)
        for round_number in range(rounds):
            cuts = proxy.cuts
            proxy.arm(modes[round_number % len(modes)])
            until(lambda: proxy.cuts > cuts, "a COMMIT is cut")  # pylint: disable=cell-var-from-loop
            lab.faults_played += 1
            lab.silent_for(dice.uniform(0.2, 1))
            for b in standbys:
                b.replayed()
            sound(lab.judge(a, False, standbys))
            if round_number == rounds - 1:
                alone_have_all(lab, standbys)
            proxy.heal()
            lab.wait_for_more("ack", dice.randrange(3, 20), 90)
        return lab.finish(a, *standbys)
    finally:
        proxy.close()


def commit_lost(lab, dice, rounds, durability):
    return cut_commits(lab, dice, rounds, durability, ["answer", "request"])


def commit_silent(lab, dice, rounds, durability):
    """The connection is half open: the server drops it after 30 s."""
    return cut_commits(lab, dice, rounds, durability, ["silent"])


# --- two servers of PostgreSQL

def kill_and_promote(a, b):
    a.kill()
    b.promote()


def new_standby(old, primary):
    """The lost machine becomes a standby of the promoted one; until then nothing is acknowledged."""
    shutil.rmtree(old.data)
    old.follow(primary)


def promotion(lab, dice, rounds):
    """The primary is lost, and its synchronous standby promoted: it has everything acknowledged."""
    a, b = two_disks(lab, dice)
    for _ in range(rounds):
        time.sleep(dice.uniform(0, 0.5))
        kill_and_promote(a, b)
        lab.faults_played += 1
        sound(lab.judge(b, False, [b]))
        new_standby(a, b)
        lab.wait_for_more("ack", dice.randrange(3, 20))
        a, b = b, a
    return lab.finish(a, b)


def standby_lost(lab, dice, rounds):
    """Nothing is acknowledged without the standby, not even when somebody cancels the waits for it; the primary alone is not enough."""
    a, b = two_disks(lab, dice)
    for _ in range(rounds):
        b.kill()
        lab.faults_played += 1
        time.sleep(0.3)  # acks in progress
        before = lab.count("ack")
        end = time.monotonic() + dice.uniform(0.7, 1.5)
        cancelled = 0
        while time.monotonic() < end:
            cancelled += int(a.sql("SELECT count(*) FROM (SELECT pg_cancel_backend(pid) FROM pg_stat_activity WHERE wait_event = 'SyncRep') AS waits"))
            time.sleep(0.02)
        if cancelled == 0 or (more := lab.count("ack") - before) > 0:
            raise Failed(f"{cancelled} waits cancelled" if cancelled == 0 else f"{more} acks without the standby")
        b.start()
        lab.wait_for_more("ack", dice.randrange(3, 20))
    a.kill()
    b.promote()
    sound(lab.judge(b, False, [b]))
    new_standby(a, b)
    return lab.finish(b, a)


def says_why(lab, words):
    """/healthz soon reports a problem with these words."""
    until(lambda: any(words in problem for problem in lab.health()["problems"]), f"/healthz says '{words}'")


def commits_waiting(a):
    """COMMITs done on the primary's disk that wait for the standby."""
    return int(a.sql("SELECT count(*) FROM pg_stat_activity WHERE wait_event = 'SyncRep'"))


def commit_late(lab, dice, rounds):
    """The standby hangs: a COMMIT is answered later than the server waits. It is not acknowledged, and its outcome is queried."""
    a, b = two_disks(lab, dice)
    for _ in range(rounds):
        b.signal_all(signal.SIGSTOP)
        until(lambda: commits_waiting(a) > 0, "a COMMIT waits for the standby")
        lab.faults_played += 1
        time.sleep(0.3)  # acks in progress
        chunks = "SELECT count(*) FROM needlelab.chunks"
        before = int(a.sql(chunks))
        lab.silent_for(ANSWER_TIMEOUT_S + dice.uniform(1, 5))
        if commits_waiting(a) == 0 or int(a.sql(chunks)) != before:
            raise Failed("the COMMIT did not wait that long")
        b.signal_all(signal.SIGCONT)
        until(lambda: int(a.sql(chunks)) > before, "PostgreSQL commits")  # pylint: disable=cell-var-from-loop
        lab.wait_for_more("ack", dice.randrange(3, 20), 90)
    return lab.finish(a, b)


def weak_settings(lab, dice, rounds):
    """Somebody disables the second disk by a setting: nothing is stored until it is restored, and /healthz says why."""
    a, b = two_disks(lab, dice)
    why = "an ack must survive the loss of a disk (--durability), and would survive "
    for _ in range(rounds):
        for weak, strong in (("ALTER ROLE needlelab SET synchronous_commit = local", "ALTER ROLE needlelab RESET synchronous_commit"),
                             ("ALTER DATABASE lab SET synchronous_commit = off", "ALTER DATABASE lab RESET synchronous_commit")):
            a.sql(weak)
            lab.faults_played += 1
            a.sql("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = 'needlelab'")
            time.sleep(0.3)
            lab.silent_for(dice.uniform(0.3, 1))
            says_why(lab, why + ("nothing" if "off" in weak else "a power cut"))
            a.sql(strong)
            a.sql("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = 'needlelab'")
            lab.wait_for_more("ack", dice.randrange(3, 20))
        a.setting("synchronous_standby_names", "")
        lab.faults_played += 1
        time.sleep(0.3)
        lab.silent_for(dice.uniform(0.3, 1))
        says_why(lab, why + "a power cut")
        a.setting("synchronous_standby_names", "ANY 1 (b)")
        lab.wait_for_more("ack", dice.randrange(3, 20))
    return lab.finish(a, b)


def standby_disk_full(lab, dice, rounds):
    """The standby's disk is full: it receives nothing more, so nothing is acknowledged. Then the primary is lost."""
    if os.getuid() != 0:
        raise CannotPlay("a small disk can only be mounted by root")
    a = lab.cluster("a")
    b = lab.small_disk("b", 160)
    b.follow(a)
    streaming(lab, dice, lab.url(a, b), TWO_DISKS)
    ballast = b.folder / "ballast"

    def a_commit_waits():
        before = lab.count("ack")
        time.sleep(1)
        return commits_waiting(a) > 0 and lab.count("ack") == before

    for _ in range(rounds):
        fill(b.folder, ballast)
        # existing segments are filled first
        until(a_commit_waits, "a COMMIT waits for the standby", 90)
        lab.faults_played += 1
        lab.silent_for(dice.uniform(0.5, 2))
        ballast.unlink()
        if not b.everybody():
            b.start()
        lab.wait_for_more("ack", dice.randrange(3, 20), 90)
    fill(b.folder, ballast)
    until(a_commit_waits, "a COMMIT waits for the standby", 90)
    lab.faults_played += 1
    a.kill()
    ballast.unlink()
    if not b.everybody():
        b.start()
    b.promote()
    sound(lab.judge(b, False, [b]))
    new_standby(a, b)
    return lab.finish(b, a)


def lagging(lab, dice, rounds):
    """A lagging standby is promoted by mistake. The server reports that it has less than was acknowledged, stores nothing while
    synchronous_standby_names is empty, and gets the missing data from the spools, including sessions that were closed and Safe."""
    a, b = two_disks(lab, dice, samples=600)
    lab.expect_lacks = True
    for round_number in range(rounds):
        b.stop()
        c = lab.copy_of_stopped(b, f"c{round_number}")
        b.start()
        lab.wait_for_more("ack", dice.randrange(20, 40))
        # at least one station has begun and closed a session that the lagging one never had: no Welcome names it
        lab.wait_for_more("closed", 3 * STATIONS + 1)
        lab.kill_clusters(a, b)
        lab.faults_played += 1
        # what answers at b's address from now on
        b.data, old = c.data, b.data
        b.start()
        b.promote()
        b.setting("synchronous_standby_names", "")
        lab.note(e="restore", t=time.time_ns())
        missing = lab.judge(b, True).faults
        if not any(name == MISSING for name, _ in missing):
            raise Failed("the standby lacked nothing")
        until(lambda: lab.lines("acknowledged_missing") == round_number + 1, "the server says what PostgreSQL lacks")  # pylint: disable=cell-var-from-loop
        lab.silent_for(dice.uniform(0.3, 1))
        shutil.rmtree(old)
        new_standby(a, b)
        lab.wait_for_more("ack", dice.randrange(10, 20))
        if not any("does not have all that was acknowledged" in problem for problem in lab.health()["problems"]):
            raise Failed(f"/healthz does not say it: {lab.health()}")
        if lab.metric("needlelab_acknowledged_missing") != 1:
            raise Failed("the metric does not say it")
        a, b = b, a
    return lab.finish(a, b)
