"""The ledgers of stations and harness: *.jsonl, one line per event (README.md has the fields)."""
import json
import pathlib


class Recorded:
    """A session in its station's ledger: samples in order, and the server's answers."""

    def __init__(self, event):
        self.id, self.station = event["id"], event["station"]
        self.steps = tuple(event["resolution"])
        self.samples, self.times = [], []  # values by column; steady clock, ns
        self.required = None  # how many samples have to arrive, when the station was killed
        self.acks = []  # (unix ns, committed, safe)
        self.closed = []  # (unix ns, state, the hash that was offered, where that is known)
        self.end = None


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
        session = None
        lines = path.read_text().split("\n")
        # the station writes a line before it gives the sample to the spool: the sample of a cut-off line does
        # not exist
        for line in lines[:-1]:
            event = json.loads(line)
            kind = event["e"]
            if kind == "session":
                session = self.sessions.setdefault(event["id"], Recorded(event))
            elif kind == "s":
                session.samples.append(event["v"])
                session.times.append(event["t"])
            elif kind == "ack":
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
                # a sample's line comes before the spool gets it: only the next line proves that the spool has
                # it
                limit = kill["t"] - self.loss_ns - kill.get("held_up", 0)
                session.required = sum(t < limit for t in session.times[1:])

    def acknowledged(self, session, at_end):
        """How many chunks the server said that it has: all in all, or since the database was last replaced."""
        since = 0 if at_end or not self.restores else max(r["t"] for r in self.restores)
        return max((committed for t, committed, _ in session.acks if t >= since), default=0)

    @staticmethod
    def safe(session):
        return max((safe for _, _, safe in session.acks), default=0)
