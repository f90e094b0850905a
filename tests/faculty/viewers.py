"""Viewers: needlelab-instructor in a terminal, and when each line arrived."""
import bisect
import collections
import json
import subprocess
import threading
import time


class Viewer:
    """Watches a station, or with None an overview of all. The first of `servers` is asked first."""

    def __init__(self, lab, servers, station, rate_hz):
        self.station, self.name = station, f"{station or 'overview'} at {servers[0]}"
        self._lines, self._notes = collections.defaultdict(list), []  # by station: ns since 1970
        self._online = {}
        watched = [] if station is None else ["--station", station]
        self.process = subprocess.Popen(  # pylint: disable=consider-using-with
            [*lab.place("viewers").enter, lab.template_of.bin / "needlelab-instructor", "--server", lab.servers_text(servers), "--ca", lab.ca, "--user", "ada",
             "--password-file", lab.template / "password", "--headless", "--json", "--rate", str(rate_hz), *watched],
            env=lab.environment_of("viewers"), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=lab.viewers_log)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self.process.stdout:
            self.take(line, time.time_ns())

    def take(self, line, now_ns):
        try:
            said = json.loads(line)
        except ValueError:
            return
        if said.get("type") == "note":
            self._notes.append((now_ns, said.get("text", "")))
        elif said.get("type") == "update":
            self._online[said["station"]] = said.get("online", True)
            # frames have no "online"; a station that is offline is not seen
            if said.get("online", True):
                self._lines[said["station"]].append(now_ns)

    def times(self, station):
        """When it saw the station, in order."""
        return list(self._lines[station])

    def sees_since(self, stations, begin):
        return all(len(times := self._lines[name]) > bisect.bisect_right(times, begin) for name in stations)

    def says_offline(self, station):
        return self._online.get(station) is False

    def notes(self):
        return [f"{text}" for _, text in self._notes[-5:]]

    def end(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self._reader.join(5)
        self.process.stdout.close()
