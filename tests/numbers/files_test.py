#!/usr/bin/python3 -B
"""What needlelab-admin writes for other programs, HDF5 and Motion-BIDS, beside its CSV; with full disks and kills.

usage: files_test.py --bin DIR --class FOLDER [--npm]
  FOLDER: as in numbers_test.py. --npm: also installs bids-validator and h5wasm (700 MB, removed at the end), and has them read the files.
Exit code 0: every value is right; 1: some differ, each is named.
"""
import argparse
import csv
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import h5py
import numpy as np

from facts import OPEN, Facts
from held import Held
from lab import Lab, run
from numbers_test import newest_class, some_of

UNITS = {"m_s": "m/s", "s": "s", "m": "m", "n": "N", "nm": "N.m", "ns": "ns"}  # by what a column's name ends in
TYPES = "ACCEL ANGACCEL GYRO JNTANG LATENCY MAGN MISC ORNT POS VEL".split()
COMPONENTS = "x y z quat_x quat_y quat_z quat_w n/a".split()
H5WASM = """import h5wasm from "h5wasm/node"; await h5wasm.ready; const f = new h5wasm.File(process.argv[1], "r"), s = f.get("samples");
console.log(JSON.stringify(Object.fromEntries(s.keys().map(k => [k, Array.from(s.get(k).value, Number).map(v => isNaN(v) ? null : v)]))))"""


def table(path, separator=","):
    with open(path, newline="", encoding="utf-8") as lines:
        return list(csv.reader(lines, delimiter=separator))


def hdf5(held, lab, s, node):
    """Each value of each column, rounded to the column's resolution; sizes and times are printed."""
    ident, place = s["uuid"], lab.folder / s["uuid"]
    for ending in ("csv", "json", "h5"):
        lab.admin("session", "export", ident, "--every-tick", "--out", f"{place}.{ending}")
    head, *rows = table(f"{place}.csv")
    told = json.loads(pathlib.Path(f"{place}.json").read_text())["session"]
    with h5py.File(f"{place}.h5") as file:
        held.same("HDF5", "columns", ident, sorted(head), sorted(file["samples"]))
        words = {name: json.loads(file[name][()].decode()) for name in ("session", "profile", "score")}
        held.same("HDF5", "profile, hash", ident, [told.pop("profile"), told["hash"]], [words["profile"], file.attrs["hash"].decode()])
        held.same("HDF5", "session, as in JSON", ident, told, words["session"])
        held.same("HDF5", "score", ident, [(m["measure"], m["value"]) for m in s["score"]], [(m["measure"], m["value"]) for m in words["score"]])
        seen_by_node = json.loads(run([*node, f"{place}.h5"], "UTC0").stdout) if node else None
        for name, texts in zip(head, zip(*rows)):
            column = file["samples"][name]
            step, whole = column.attrs["resolution"], column.dtype.kind in "iu"
            right = np.array(texts, dtype="int64" if whole else "float64")
            for reader, seen in ("HDF5", column[:]), *([("h5wasm", np.array(seen_by_node[name], dtype=column.dtype))] if node else ()):
                same = seen.astype(right.dtype) == right if whole or name == "t_s" else np.rint(seen.astype("f8") / step) == np.rint(right / step)
                held.same(reader, f"values of {name}", ident, 0, int(np.sum(~(same | (seen != seen) & (right != right)))))
                held.values += len(seen)
            unit = UNITS.get(re.sub("^.*?_(?=m_s$)|^.*_", "", name) if "_" in name else "", "1")
            held.same("HDF5", "units, frame", name, [unit, bool(re.match("[pqftw][xyzw]", name))], [column.attrs["units"].decode(), column.attrs.get("frame") == b"W"])
    run(["h5dump", f"{place}.h5"], "UTC0")
    # the yardstick is a CSV of 17 digits, whatever the shortest ones are
    csv_bytes = sum(len(text if text.lstrip("-").isdigit() else f"{float(text):.17g}") + 1 for row in rows for text in row)
    share = pathlib.Path(f"{place}.h5").stat().st_size / csv_bytes
    held.same("HDF5", "at most a tenth of the CSV of 17 digits", ident, True, share <= 0.1)
    return share


def bids(held, lab, folder):
    """The rules of Motion-BIDS, and each value beside `study recording`."""
    lab.admin("study", "export", "files", "--format", "bids", "--out", folder)
    records = [json.loads(line) for line in lab.admin("study", "export", "files").stdout.splitlines()]
    paths = {"README", "dataset_description.json", "participants.json", "participants.tsv", "sourcedata/records.jsonl"}
    for s in (r for r in records if r["kind"] == "session"):
        sub, ses, task = (re.sub("[^0-9A-Za-z]", "", s[key]) for key in ("person", "session", "exercise_id"))
        stem = f"sub-{sub}/ses-{ses}/motion/sub-{sub}_ses-{ses}_task-{task}"
        paths |= {f"{stem}_events.tsv", *(f"{stem}_tracksys-needle_{name}" for name in ("channels.json", "channels.tsv", "motion.json", "motion.tsv"))}
        lab.admin("study", "recording", "files", s["session"], "--out", lab.folder / "one.csv", "--replace")
        (head, *rows), motion = table(lab.folder / "one.csv"), table(f"{folder}/{stem}_tracksys-needle_motion.tsv", "\t")
        held.same("BIDS", "motion.tsv", stem, [[c.replace("nan", "n/a") for c in row] for row in rows], motion)
        fields, *channels = table(f"{folder}/{stem}_tracksys-needle_channels.tsv", "\t")
        held.same("BIDS", "channels' fields and names", stem, [["name", "component", "type", "tracked_point", "units"], head], [fields[:5], [c[0] for c in channels]])
        held.same("BIDS", "components and types", stem, [], [c for c in channels if c[1] not in COMPONENTS or c[2] not in TYPES])
        held.same("BIDS", "forces", stem, [["MISC", "N"]] * 3, [[c[2], c[4]] for c in channels if c[0] in ("fx_n", "fy_n", "fz_n")])
        about = json.loads((folder / f"{stem}_tracksys-needle_motion.json").read_text())
        held.same("BIDS", "task, rate", stem, [s["exercise_id"], s["rate_hz"]], [about["TaskName"], about["SamplingFrequency"]])
        held.same("BIDS", "events", stem, [["onset", "duration", "trial_type"], ["0", f"{float(rows[-1][0]):.6f}", "lesson"]], table(f"{folder}/{stem}_events.tsv", "\t"))
    held.same("BIDS", "files", "", sorted(paths), sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()))
    people = [["participant_id"], *([p.name] for p in sorted(folder.glob("sub-*")))]
    held.same("BIDS", "participants", "", people, table(folder / "participants.tsv"))


def faults(held, lab, ident):
    """A file of that name, a full disk, a kill: nothing is left under the name."""
    disk = lab.folder / "disk"
    disk.mkdir()
    for words in (("session", "export", ident, "--format", "hdf5"), ("study", "export", "files", "--format", "bids")):
        command = [str(w) for w in (lab.bin / "needlelab-admin", "--data", lab.data, *words, "--out", disk / "new")]
        full = subprocess.run(["unshare", "--map-root-user", "--mount", "sh", "-c", 'mount -t tmpfs -o size=100k tmpfs "$0" && "$@"; echo $?; ls -A "$0"', disk, *command],
                              capture_output=True, text=True, check=False)
        held.same("a full disk", "exit code, what is left; the reason", words, ["1\n", True], [full.stdout, "No space left on device" in full.stderr])
        (disk / "new").write_text("old")
        held.same("a file of that name", "exit code", words, 2, subprocess.run(command, capture_output=True, check=False).returncode)
        held.same("a file of that name", "is as it was", words, "old", (disk / "new").read_text())
        left = ["new"]
        while left == ["new"]:  # it was faster than the kill
            (disk / "new").unlink() if (disk / "new").is_file() else shutil.rmtree(disk / "new", ignore_errors=True)
            with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
                while process.poll() is None and not list(disk.iterdir()):
                    pass
                process.kill()
            left = [p.name for p in disk.iterdir()]
        held.same("a kill", "only a temporary name", words, ["new.being-written-"], [name[:-6] for name in left])
        run(["rm", "-r", *disk.iterdir()], "UTC0")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", required=True, type=pathlib.Path)
    parser.add_argument("--class", dest="class_folder", required=True, type=pathlib.Path)
    parser.add_argument("--npm", action="store_true")
    options = parser.parse_args()
    held, node = Held(), []
    held.values = 0
    with tempfile.TemporaryDirectory(prefix="needlelab-files-") as folder:
        lab = Lab(newest_class(options.class_folder), options.bin, folder)
        if options.npm:
            run(["npm", "install", "--no-audit", "--no-fund", "--prefix", folder, "bids-validator@1.15.0", "h5wasm@0.10.3"], "UTC0", timeout=900)
            (lab.folder / "read.mjs").write_text(H5WASM.replace("argv[1]", "argv[2]"))
            node = ["node", lab.folder / "read.mjs"]
        lab.settle()
        sessions = sorted((s for s in Facts(lab.database()).sessions if s["score"] and s["state"] != OPEN), key=lambda s: s["samples"])
        shares = [hdf5(held, lab, s, node) for s in some_of(sessions, 6)]
        bids(held, lab, lab.folder / "study")
        faults(held, lab, sessions[-1]["uuid"])
        if options.npm:
            issues = json.loads(run(["node", lab.folder / "node_modules/.bin/bids-validator", "--json", lab.folder / "study"], "UTC0").stdout)["issues"]
            held.same("bids-validator", "errors", "", [], [e["key"] for e in issues["errors"]])
            print("warnings of bids-validator:", *(w["key"] for w in issues["warnings"]))
    for difference in held.differences[:100]:
        print("DIFFERS ", *map(repr, difference))
    print(f"{held.values} values, {sum(held.counts.values())} comparisons: {len(held.differences)} differ")
    print(f"HDF5 takes {min(shares):.3f} to {max(shares):.3f} of the CSV")
    return 1 if held.differences else 0


if __name__ == "__main__":
    sys.exit(main())
