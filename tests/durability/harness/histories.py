#!/usr/bin/env python3
"""Generated histories: sessions, disconnections, restarts, kills, backups, restores; at the end the judge.

The seed determines a history: the steps, their order and targets, the number of events (acknowledgements, samples)
between them, and every sample except its time. Two runs of one seed differ only by the machine: the instruction at
which a kill falls, the chunks in a commit, all durations.
"""
import argparse
import os
import random
import sys

from crash_page import IN_CHECKPOINT, IN_COMMIT
from lab import Failed, Lab, Programs, loss_ms, until

STEPS = (("go on", 3), ("kill server", 3), ("stop server", 2), ("kill stations", 3), ("back up", 2), ("restore", 2),
         ("new sessions", 2))


class History:
    def __init__(self, lab, seed):
        self.lab, self.draw = lab, random.Random(seed)
        self.names = lab.programs.stations[:self.draw.randint(2, len(lab.programs.stations))]
        self.told = []

    def tell(self, text):
        self.told.append(text)

    def play(self, steps):
        """Returns the faults, as (name, text)."""
        self.lab.start_server()
        for name in self.names:
            self._station(name)
        for _ in range(steps):
            names, weights = zip(*STEPS)
            step = self.draw.choices(names, weights)[0]
            faults = getattr(self, "_" + step.replace(" ", "_"))()
            if faults:
                return faults
        self.tell("drain")
        self.lab.drain(self.names)
        self.lab.stop_server()
        return self.lab.judge(at_end=True).faults

    def _running(self):
        return [n for n in self.names if self.lab.stations[n].poll() is None]

    def _station(self, name):
        # always drawn: a station's progress depends on the machine, but the next steps must not
        sessions, samples, seed = self.draw.randint(1, 3), self.draw.choice((5, 40, 150, 400)), self.draw.getrandbits(32)
        if name in self.lab.stations and self.lab.stations[name].poll() is None:
            return
        self.tell(f"{name} records {sessions} sessions of at most {samples} samples")
        self.lab.start_station(name, seed=seed, sessions=sessions, samples=samples)

    def _judge(self):
        faults = self.lab.judge(at_end=False).faults
        self.lab.start_server()
        return faults

    def _go_on(self):
        count = self.draw.randint(1, 300)
        self.tell(f"{count} more samples")
        goal = self.lab.count("s") + count
        until(lambda: self.lab.count("s") >= goal or not self._running(), "samples")

    def _kill_server(self):
        self._go_on()
        how = self.draw.choice(("now", "in commit", "in checkpoint"))
        operation = self.draw.randint(1, 6)
        if how != "now":
            self.lab.page.arm(IN_COMMIT if how == "in commit" else IN_CHECKPOINT, operation)
            try:
                until(lambda: self.lab.server.poll() is not None, "the armed operation", seconds=1)
            except Failed:
                how += ", which did not come"
        self.tell(f"kill -9 of the server {how} (operation {operation})")
        self.lab.kill_server()
        return self._judge()

    def _stop_server(self):
        self.tell("SIGTERM to the server")
        self.lab.stop_server()
        return self._judge()

    def _kill_stations(self):
        self._go_on()
        for name in self.draw.sample(self.names, self.draw.randint(1, len(self.names))):
            self.tell(f"kill -9 of {name}")
            self.lab.kill_station(name)
            self._station(name)

    def _back_up(self):
        self.tell("back up")
        self.lab.backup()

    def _restore(self):
        if not self.lab.backups:
            return self._back_up()
        self.tell("restore the newest backup")
        self.lab.stop_server()
        faults = self.lab.judge(at_end=False).faults
        self.lab.restore(self.lab.backups[-1])
        self.lab.start_server()
        return faults

    def _new_sessions(self):
        for name in self.names:
            self._station(name)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--bin", required=True, help="folder of the built programs")
    is_long = os.environ.get("NEEDLELAB_LONG")
    parser.add_argument("--count", type=int, default=60 if is_long else 3)
    parser.add_argument("--steps", type=int, default=12 if is_long else 6)
    parser.add_argument("--seed", type=int, default=int(os.environ.get("NEEDLELAB_SEED", "1")))
    parser.add_argument("--loss-ms", type=float, help="what a killed station may lose (lab.py has the defaults)")
    parser.add_argument("--tell", action="store_true", help="say what is done")
    options = parser.parse_args()
    programs, loss = Programs(options.bin), loss_ms(options.loss_ms)
    for seed in range(options.seed, options.seed + options.count):
        with Lab(programs, loss=loss) as lab:
            history = History(lab, seed)
            try:
                faults = history.play(options.steps)
            except (Failed, OSError) as error:
                faults = [("harness", f"{error}\n{lab.said()}")]
        if faults or options.tell:
            print(f"history {seed}:", *history.told, sep="\n  ")
        for name, text in faults:
            print(f"{name}: {text}")
        if faults:
            print(f"repeat: python3 tests/durability/harness/histories.py --bin {options.bin} --seed {seed} --count 1 --steps {options.steps}")
            return 1
        print(f"history {seed}: {len(history.told)} steps, no fault", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
