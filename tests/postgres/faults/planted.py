"""Planted bugs and settings that break the promise: the judge must catch each, and the same history without it must be sound. The returned judgement
is the first with a fault; the caller knows the possible names."""
import sys
import time

from clusters import Failed, until
from commit_proxy import CommitProxy
from fault_lab import HERE
from scenarios import MISSING, sound, streaming, two_disks

sys.path.insert(0, str(HERE.parents[1] / "durability" / "harness"))
import rude_client  # noqa: E402  pylint: disable=wrong-import-position


def ack_before_commit(lab, dice):
    """The network fails before the COMMIT of data already acknowledged."""
    a = lab.cluster("a")
    proxy = CommitProxy(a)
    try:
        streaming(lab, dice, f"postgresql://needlelab@127.0.0.1:{proxy.port}/lab?sslmode=disable")
        proxy.arm("request")
        until(lambda: proxy.cuts > 0, "a COMMIT is cut")
        return lab.judge(a, False)
    finally:
        proxy.close()


def warning_ignored(lab, dice):
    """Waits for the lost standby are cancelled: PostgreSQL says COMMIT, with a warning. Then the primary is lost, too."""
    a, b = two_disks(lab, dice)
    b.kill()
    end = time.monotonic() + 1.5
    while time.monotonic() < end:
        a.sql("SELECT pg_cancel_backend(pid) FROM pg_stat_activity WHERE wait_event = 'SyncRep'")
        time.sleep(0.02)
    return standby_only(lab, a, b)


def standby_only(lab, a, b):
    """The primary is lost; its standby, which is no longer running, is started and promoted."""
    a.kill()
    b.start()
    b.promote()
    return lab.judge(b, False, [b])


def synchronous_commit_local(lab, dice):
    """The server's role does not wait for a standby, and the server was not told to require two disks."""
    a = lab.cluster("a")
    b = lab.standby_of(a, "b")
    if lab.weakened:
        a.sql("ALTER ROLE needlelab SET synchronous_commit = local")
        streaming(lab, dice, lab.url(a, b), "any")
    else:
        streaming(lab, dice, lab.url(a, b), "two-disks")
    b.kill()
    before, end = lab.count("ack"), time.monotonic() + 1.5
    until(lambda: lab.count("ack") - before >= 10 or time.monotonic() > end, "acks")
    return standby_only(lab, a, b)


def repeated_chunk_overwrites(lab, _dice):
    """A station with somebody else's spool sends other bytes for a stored chunk."""
    a = lab.cluster("a")
    lab.start_server(lab.url(a))
    client = rude_client.RudeClient(lab)
    client.record(3)
    for seq in range(3):
        if client.chunk(seq) != rude_client.ACK:
            raise Failed("a good chunk was refused")
    try:
        client.chunk(1, shift=3)
    except ConnectionError:
        pass  # a contradiction ends the connection
    lab.kill_server()
    return lab.judge(a, False)


# name -> (history, value of NEEDLELAB_PLANT, the faults it may appear as)
PLANTED = {
    "ack-before-commit": (ack_before_commit, "ack-before-commit", {MISSING}),
    "warning-ignored": (warning_ignored, "warning-ignored", {MISSING}),
    "synchronous-commit-local": (synchronous_commit_local, None, {MISSING}),
    "repeated-chunk-overwrites": (repeated_chunk_overwrites, "repeated-chunk-overwrites", {"changed", "gap"}),
}


def play(lab, dice, name, weakened):
    """Returns the judgement; raises Failed if it is not the required one."""
    history, _, names = PLANTED[name]
    lab.weakened = weakened
    lab.faults_played += 1
    judgement = history(lab, dice)
    if not weakened:
        return sound(judgement)
    if not {fault for fault, _ in judgement.faults} & names:
        raise Failed(f"NOT CAUGHT: one of {sorted(names)} was expected, found was {judgement.faults[:3]}")
    return judgement
