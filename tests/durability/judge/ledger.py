"""The ledgers of stations and harness: *.jsonl, one line per event; `e` names it. `t` is steady ns in s and kill, unix ns elsewhere.

session: id, station, resolution (six steps). s: t, v (FORMAT.md's columns 0-29; null: no wall). ack: id, t, committed, safe.
end: id, chunks, samples, hash, interrupted. closed: id, t, state, hash (if the rude client offered one).
kill: station, t, held_up (the machine's stall, ns). restore: t.
"""
import array
import json
import pathlib

SAMPLE = b'{"e":"s","t":'  # as the station writes it; lines that look different are parsed at once


class Recorded:
    """A session in its station's ledger: where its samples are, and the server's answers."""

    def __init__(self, event):
        self.id, self.station = event["id"], event["station"]
        self.steps = tuple(event["resolution"])
        self.times = array.array("q")  # the samples' times, steady clock, ns
        self.parts = []  # [path, from, to]: bytes of ledgers that contain these samples and no other session's
        self.required = None  # how many samples must arrive if the station was killed
        self.acks = []  # (unix ns, committed, safe)
        self.closed = []  # (unix ns, state, the offered hash if known)
        self.end = None

    def samples(self):
        """Their values by column, in order, read from the files again: a list of samples takes three times their text."""
        values = []
        for path, begin, end in self.parts:
            with open(path, "rb") as file:
                file.seek(begin)
                events = map(json.loads, file.read(end - begin).splitlines())
                values += [event["v"] for event in events if event["e"] == "s"]
        assert len(values) == len(self.times), f"{self.id}: its ledger was changed"
        return values


class Ledgers:
    def __init__(self, folder, loss_ns):
        """`loss_ns`: allowed loss of a killed station, before the kill."""
        self.sessions, self.kills, self.restores, self.backups = {}, [], [], []
        self.loss_ns = loss_ns
        for path in sorted(pathlib.Path(folder).glob("*.jsonl")):
            self._read(path)
        for kill in self.kills:
            self._cut(kill)

    def _read(self, path):
        session, part, end = None, None, 0
        with open(path, "rb") as file:
            for line in file:
                # the station writes a line before it passes the sample to the spool: the sample of a cut-off line does
                # not exist
                if not line.endswith(b"\n"):
                    break
                end += len(line)
                # now only a sample's time is needed
                quick = line.startswith(SAMPLE)
                event = {"e": "s", "t": int(line[len(SAMPLE):line.index(b",", len(SAMPLE))])} if quick else json.loads(line)
                if event["e"] == "s":
                    session.times.append(event["t"])
                    part[2] = end
                elif event["e"] == "session":
                    session, part = self.sessions.setdefault(event["id"], Recorded(event)), [path, end, end]
                    session.parts.append(part)
                else:
                    self._note(event, path)

    def _note(self, event, path):
        kind = event["e"]
        if kind == "ack":
            self.sessions[event["id"]].acks.append((event["t"], event["committed"], event["safe"]))
        elif kind == "closed":
            self.sessions[event["id"]].closed.append((event["t"], event["state"], event.get("hash")))
        elif kind == "end":
            self.sessions[event["id"]].end = event
        elif kind == "kill":
            self.kills.append(event)
        elif kind == "restore":
            self.restores.append(event)
        elif kind == "backup":
            self.backups.append(event)
        else:
            raise ValueError(f"{path}: an event of kind {kind}")

    def _cut(self, kill):
        """The sessions that this station was recording when it was killed."""
        for session in self.sessions.values():
            if session.station != kill["station"] or not session.times or session.required is not None:
                continue
            # it may have written more between that clock reading and its death
            if session.times[0] <= kill["t"] and (session.end is None or session.end["interrupted"]):
                # a sample's line is written before the spool gets it: only the next line proves that the spool has
                # it
                limit = kill["t"] - self.loss_ns - kill.get("held_up", 0)
                session.required = sum(t < limit for t in session.times[1:])

    def acknowledged(self, session, at_end):
        """How many chunks the server acknowledged: in total, or since the database was last replaced."""
        since = 0 if at_end or not self.restores else max(r["t"] for r in self.restores)
        return max((committed for t, committed, _ in session.acks if t >= since), default=0)

    @staticmethod
    def safe(session):
        return max((safe for _, _, safe in session.acks), default=0)
