"""Power cuts below PostgreSQL: cut_shim.cpp is preloaded into its processes and records what each write replaces, and each sync. After killing all of
them, any part of what was written since a file's last sync is undone. File names survive, as with LazyFS; tests/powercut covers more states."""
import struct

from clusters import Failed
from scenarios import MISSING, TWO_DISKS, CannotPlay, new_standby, sound, streaming

RECORD = struct.Struct("<5Q")
SECTOR = 512


def unsynced(log):
    """inode → what was replaced since its last sync: (offset, file size, old bytes), in order."""
    files = {}
    with open(log, "rb") as records:
        while len(head := records.read(RECORD.size)) == RECORD.size:
            kind, inode, offset, size, length = RECORD.unpack(head)
            if len(data := records.read(length)) < length:
                break  # its writer was killed before it wrote
            if chr(kind) == "W":
                files.setdefault(inode, []).append((offset, size, data))
            else:
                files.pop(inode, None)
    return files


def synced_bytes(now, replaced):
    old = bytearray(now)
    for offset, size, data in reversed(replaced):
        old[offset:offset + len(data)] = data  # also what was cut off
        del old[size:]
        old.extend(bytes(size - len(old)))
    return bytes(old)


def survivors(now, old, outcome, dice):
    """Some state of the file after the cut."""
    if outcome == "per file":
        outcome = dice.choice(["nothing", "everything"])
    if outcome != "sectors":
        return old if outcome == "nothing" else now
    mixed = bytearray(dice.choice([now, old]))  # whether it has grown or was cut off
    for at in range(0, len(mixed), SECTOR):
        source = dice.choice([now, old])[at:at + SECTOR]
        mixed[at:at + SECTOR] = source.ljust(min(SECTOR, len(mixed) - at), b"\0")[:len(mixed) - at]
    return bytes(mixed)


def cut(cluster, dice, outcome):
    """Kills the cluster and undoes some of its unsynced writes. Returns how many files had unsynced bytes."""
    cluster.kill()
    log = cluster.folder / "cut.log"
    files, touched = unsynced(log), 0
    for path in (p for p in sorted(cluster.data.rglob("*")) if p.is_file() and not p.is_symlink()):
        if (replaced := files.get(path.stat().st_ino)) is None:
            continue
        now = path.read_bytes()
        old = synced_bytes(now, replaced)
        if (left := survivors(now, old, outcome, dice)) != now:
            with open(path, "r+b") as file:  # owner and mode stay
                file.write(left)
                file.truncate(len(left))
        touched += now != old
    log.unlink()
    (cluster.folder / "cut.log.lock").unlink()
    return touched


def such_a_disk(lab, name):
    """The environment of the processes of the cluster of that name."""
    shim = lab.template_of.bin / "needlelab_cut_shim"
    if not shim.exists():
        raise CannotPlay(f"{shim} is not built")
    return {"LD_PRELOAD": str(shim), "NEEDLELAB_CUT_LOG": str(lab.folder / name / "cut.log")}


def cuts(lab, dice, rounds, durability, outcomes, weaken=None):
    """The judgement after the last cut, or after the first with faults."""
    a = lab.cluster("a", such_a_disk(lab, "a"))
    if weaken is not None:
        weaken(a)
    streaming(lab, dice, lab.url(a), durability)
    touched = 0
    for round_number in range(rounds):
        lab.wait_for_more("ack", dice.randrange(3, 20))
        if round_number % 3 == 2:
            a.sql("CHECKPOINT")  # replaces torn data, and makes each page's next change whole in the log
        lab.kill_server()
        lab.faults_played += 1
        touched += cut(a, dice, outcomes[round_number % len(outcomes)])
        a.start()
        judgement = lab.judge(a, False)
        if judgement.faults:
            return judgement
        lab.start_server(lab.url(a), durability)
        lab.wait_for_more("ack", 3)
    if touched == 0:
        raise Failed("no cut met a byte that was not synced")
    # as one piece: other labs run at the same time
    print(f"{rounds} power cuts below PostgreSQL, {touched} files with bytes that were not synced\n", end="", flush=True)
    return lab.finish(a)


def power_cut(lab, dice, rounds):
    return cuts(lab, dice, rounds, "power-cut", dice.sample(["sectors", "nothing", "per file", "everything"], 4))


def power_cut_promotion(lab, dice, rounds):
    """The primary's power is cut, in every second round also its standby's; the standby is promoted and has everything acknowledged."""
    a = lab.cluster("a", such_a_disk(lab, "a"))
    b = lab.standby_of(a, "b", such_a_disk(lab, "b"))
    streaming(lab, dice, lab.url(a, b), TWO_DISKS)
    outcomes, touched = dice.sample(["sectors", "nothing", "per file"], 3), 0
    for round_number in range(rounds):
        lab.wait_for_more("ack", dice.randrange(3, 20))
        outcome = outcomes[round_number % len(outcomes)]
        touched += cut(a, dice, outcome)
        lab.faults_played += 1
        if round_number % 2 == 1:
            touched += cut(b, dice, outcome)
            b.start()
        b.promote()
        sound(lab.judge(b, False, [b]))
        new_standby(a, b)
        lab.wait_for_more("ack", dice.randrange(3, 20))
        a, b = b, a
    if touched == 0:
        raise Failed("no cut met a byte that was not synced")
    print(f"{rounds} power cuts below PostgreSQL, {touched} files with bytes that were not synced\n", end="", flush=True)
    return lab.finish(a, b)


def commits_off(a):
    a.sql("ALTER ROLE needlelab SET synchronous_commit = off")


def fsync_off(a):
    a.setting("fsync", "off")


# name -> what makes it weak; the server is not told to require more
PLANTED = {"synchronous-commit-off": commits_off, "fsync-off": fsync_off}


def play(lab, dice, name, weakened):
    """Returns the judgement; raises Failed if it is not the required one."""
    judgement = cuts(lab, dice, 4 if weakened else 2, "any", ["nothing"], PLANTED[name] if weakened else None)
    if not weakened:
        return sound(judgement)
    if not any(fault == MISSING for fault, _ in judgement.faults):
        raise Failed(f"NOT CAUGHT: {MISSING} was expected, found was {judgement.faults[:3]}")
    return judgement


