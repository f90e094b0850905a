#!/usr/bin/env python3
"""Holds the table of folders in ARCHITECTURE.md against the code.

usage: dependencies.py SOURCE_DIR BUILD_DIR

1. Each #include of a product file names a folder that its own folder's row lists.
2. Each folder that a row lists is really included.
3. No folder reaches itself: there is no circle.
4. What the compiler read for an object file (ninja -t deps), of this project and of libraries, is within what the rows
   reach, transitively.
5. Each product folder has a row, each row a folder.
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


def reached(rows, start):
    """All folders that START may use through others, itself only when there is a circle."""
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
    """{(folder, included folder): a file that does it}"""
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
    # Clang lists what it took from precompiled headers, too
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
    """how many objects the product's own sources make"""
    with open(os.path.join(build, "compile_commands.json"), encoding="utf-8") as file:
        commands = json.load(file)
    made = [re.search(r" -o (\S+\.o) ", entry["command"]) for entry in commands]
    return sum(found is not None and found[1].startswith(PRODUCT) and ".pb.cc" not in found[1] for found in made)


def check(source, build):
    rows = read_table(os.path.join(source, "ARCHITECTURE.md"))
    faults = []
    folders = {os.path.dirname(path) for path in product_files(source)}
    faults += [f"ARCHITECTURE.md has no row for {folder}" for folder in sorted(folders - rows.keys())]
    faults += [f"ARCHITECTURE.md has a row for {folder}, which has no sources" for folder in sorted(rows.keys() - folders)]
    for folder in sorted(rows):
        if folder in reached(rows, folder):
            faults.append(f"a circle: {folder} reaches itself through {', '.join(sorted(f for f in rows[folder][0] if folder in {f} | reached(rows, f)))}")
    includes = own_includes(source)
    for (folder, other), where in sorted(includes.items()):
        if folder in rows and other not in rows[folder][0]:
            faults.append(f"{folder} may not include {other}: {where}")
    for folder, (uses, _) in sorted(rows.items()):
        faults += [f"{folder} lists {other}, and includes nothing of it" for other in sorted(uses) if (folder, other) not in includes]
    if faults:
        return faults, 0
    objects = 0
    used = collections.defaultdict(set)
    for target, sources, read, libraries in compiled(source, build):
        objects += 1
        allowed = set().union(*({folder} | reached(rows, folder) for folder in sources))
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
