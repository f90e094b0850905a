#!/usr/bin/env python3
"""Holds the table of folders in ARCHITECTURE.md against the code.

usage: dependencies.py SOURCE_DIR BUILD_DIR

1. Each #include of a product file names a folder that its own folder's row lists.
2. Each folder that a row lists is really included.
3. No folder reaches itself: there is no circle.
4. What the compiler read for an object file (ninja -t deps), of this project and of libraries, is within what the rows
   reach, transitively.
5. Each product folder has a row or is a room in the table of rooms; each row and each room has sources.
6. A room includes only rooms that its table names before it. Files beside the rooms come last, or where "." stands.
7. No product folder has more than 25 files.
"""
import collections
import functools
import json
import os
import re
import subprocess
import sys

# a library's name in the table, and where its headers are
LIBRARIES = {
    "Boost": "/usr/include/boost/",
    "CHOLMOD": "/usr/include/suitesparse/",
    "CLI11": "/usr/include/CLI/",
    "EGL": "/usr/include/EGL/",
    "Eigen": "/usr/include/eigen3/",
    "GLFW": "/usr/include/GLFW/",
    "HDF5": "/usr/include/hdf5/",
    "ImGui": "/usr/include/imgui/",
    "JSON": "/usr/include/nlohmann/",
    "OpenGL": "/usr/include/epoxy/",
    "OpenSSL": "/usr/include/openssl/",
    "Protobuf": "/usr/include/google/protobuf/",
    "NATS": "/usr/include/nats",
    "PostgreSQL": "/usr/include/postgresql/",
    "SQLite": "/usr/include/sqlite3",
    "fmt": "/usr/include/fmt/",
    "libusb": "/usr/include/libusb-1.0/",
    "sodium": "/usr/include/sodium",
    "spdlog": "/usr/include/spdlog/",
    "stb": "/usr/include/stb/",
    "utf8proc": "/usr/include/utf8proc.h",
}
PRODUCT = ("client", "common", "db", "proto", "server")
MOST_FILES = 25


def read_table(path):
    """{folder: (folders it may include, libraries)} from the table under the heading that names it."""
    rows = {}
    with open(path, encoding="utf-8") as file:
        for line in file:
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            if len(cells) != 4 or not re.fullmatch(r"`[a-z_/]+`", cells[0]):
                continue
            uses = set()
            for name, inner in re.findall(r"([a-z_]+(?:/[a-z_]+)*)(?:/\{([a-z_,/ ]+)\})?", cells[2].replace("`", "")):
                uses |= {f"{name}/{part.strip()}" for part in inner.split(",")} if inner else {name}
            rows[cells[0].strip("`")] = (uses, {name for name in LIBRARIES if re.search(rf"\b{name}\b", cells[3])})
    return rows


def read_rooms(path):
    """{folder: [its rooms, as paths, in order]} from the table of rooms; the folder itself stands for the files beside them."""
    rooms = {}
    with open(path, encoding="utf-8") as file:
        for line in file:
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            if len(cells) != 2 or not re.fullmatch(r"`[a-z_/]+`", cells[0]):
                continue
            folder = cells[0].strip("`")
            listed = [os.path.normpath(os.path.join(folder, name)) for name in re.findall(r"`((?:\.\./)?[a-z_/]+|\.)`", cells[1])]
            rooms[folder] = listed if folder in listed else [*listed, folder]
    return rooms


def owner_of(folder, rows, rooms=None):
    """The row that a folder belongs to: its own, or that of the folder whose room it is. None: it has no row."""
    for owner, listed in (rooms or {}).items():
        if folder in listed and owner in rows:
            return owner
    while folder and folder not in rows:
        folder = os.path.dirname(folder)
    return folder or None


def reached(rows, start):
    """All folders that START may use through others; includes itself only if there is a circle."""
    seen, todo = set(), list(rows[start][0])
    while todo:
        folder = todo.pop()
        if folder not in seen:
            seen.add(folder)
            todo.extend(rows.get(folder, (set(), set()))[0])
    return seen


def product_files(source):
    for top in PRODUCT:
        for folder, _, names in os.walk(os.path.join(source, top)):
            for name in names:
                if name.endswith((".h", ".cpp")):
                    yield os.path.relpath(os.path.join(folder, name), source)


def own_includes(source):
    """{(folder, included folder): a file with such an include}"""
    found = {}
    for path in product_files(source):
        folder = os.path.dirname(path)
        with open(os.path.join(source, path), encoding="utf-8") as file:
            for name in re.findall(r'^\s*#\s*include "([^"]+)"', file.read(), re.M):
                # messages are generated from proto/needlelab/*.proto
                other = "proto" if name.startswith("needlelab/") else os.path.dirname(name)
                if other != folder:
                    found.setdefault((folder, other), f"{path} includes {name}")
    return found


def compiled(source, build):
    """(object, folders of the project's sources in it, folders read, libraries read), for each object of the product"""
    listing = subprocess.run(["ninja", "-C", build, "-t", "deps"], check=True, capture_output=True, text=True).stdout
    # a path may be absolute or, with ccache's base_dir, relative to the build folder
    whole = functools.cache(lambda line: os.path.realpath(os.path.join(build, line)))
    read = {}
    for block in listing.split("\n\n"):
        lines = block.strip().split("\n")
        read[lines[0].split(":")[0]] = {whole(line.strip()) for line in lines[1:]}
    # Clang also lists what it read from precompiled headers
    precompiled = {whole(target.removesuffix(".pch")): paths for target, paths in read.items() if target.endswith(".hxx.pch")}
    for target, paths in read.items():
        if not target.startswith(PRODUCT) or not target.endswith(".o"):
            continue
        sources, folders, libraries = set(), set(), set()
        generated = False
        for path in paths.difference(*(found for header, found in precompiled.items() if header in paths)):
            libraries |= {name for name, start in LIBRARIES.items() if path.startswith(start)}
            if not path.startswith(source + os.sep):
                continue
            if path.startswith(build + os.sep):
                if path.endswith(".pb.h"):
                    folders.add("proto")
                generated |= path.endswith(".cpp")
                continue
            folder = os.path.dirname(os.path.relpath(path, source))
            (sources if path.endswith(".cpp") else folders).add(folder)
        if generated and not sources:
            sources.add(target.split("/CMakeFiles/")[0])
        if sources:
            yield target, sources, folders, libraries


def product_objects(build):
    """the number of objects made from the product's own sources"""
    with open(os.path.join(build, "compile_commands.json"), encoding="utf-8") as file:
        commands = json.load(file)
    made = [re.search(r" -o (\S+\.o) ", entry["command"]) for entry in commands]
    return sum(found is not None and found[1].startswith(PRODUCT) and ".pb.cc" not in found[1] for found in made)


def check(source, build):
    table = os.path.join(source, "ARCHITECTURE.md")
    rows, rooms = read_table(table), read_rooms(table)
    faults = []
    files = collections.Counter(os.path.dirname(path) for path in product_files(source))
    named = rows.keys() | {room for listed in rooms.values() for room in listed}
    faults += [f"ARCHITECTURE.md has no row for {folder}" for folder in sorted(files.keys() - named)]
    faults += [f"ARCHITECTURE.md has a row for {folder}, which has no sources" for folder in sorted(named - files.keys())
               if folder not in rooms]
    faults += [f"{folder} has {count} files; give them rooms, {MOST_FILES} files each at most" for folder, count in sorted(files.items())
               if count > MOST_FILES]
    for folder in sorted(rows):
        if folder in reached(rows, folder):
            faults.append(f"a circle: {folder} reaches itself through {', '.join(sorted(f for f in rows[folder][0] if folder in {f} | reached(rows, f)))}")
    included = set()
    for (folder, other), where in sorted(own_includes(source).items()):
        owner, owns = owner_of(folder, rows, rooms), owner_of(other, rows, rooms)
        included.add((owner, owns))
        if owner != owns:
            if owner and owns not in rows[owner][0]:
                faults.append(f"{folder} may not include {other}: {where}")
        elif owner and folder in rooms.get(owner, ()) and other in rooms[owner] and rooms[owner].index(folder) < rooms[owner].index(other):
            faults.append(f"{folder} may not include {other}, a later room: {where}")
    for folder, (uses, _) in sorted(rows.items()):
        faults += [f"{folder} lists {other}, and includes nothing of it" for other in sorted(uses) if (folder, other) not in included]
    if faults:
        return faults, 0
    objects = 0
    used = collections.defaultdict(set)
    for target, sources, read, libraries in compiled(source, build):
        objects += 1
        sources, read = ({owner_of(folder, rows, rooms) or folder for folder in folders} for folders in (sources, read))
        allowed = set().union(*({folder} | reached(rows, folder) for folder in sources if folder in rows))
        faults += [f"{target} read a header of {folder}, which {', '.join(sorted(sources))} does not reach" for folder in sorted(read - allowed)]
        may = set().union(*(rows[folder][1] for folder in allowed))
        faults += [f"{target} read a header of {name}, which no row that it reaches names" for name in sorted(libraries - may)]
        for folder in sources:
            used[folder] |= libraries
    expected = product_objects(build)
    if objects < expected:
        faults.append(f"only {objects} of {expected} object files are known to ninja in {build}: build everything first")
    return faults, objects


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    faults, objects = check(os.path.realpath(sys.argv[1]), os.path.realpath(sys.argv[2]))
    for fault in faults:
        print(fault)
    if faults:
        sys.exit(f"{len(faults)} faults: mend the code, or the table in ARCHITECTURE.md if the dependency is right")
    print(f"{objects} object files keep to the table in ARCHITECTURE.md")


if __name__ == "__main__":
    main()
