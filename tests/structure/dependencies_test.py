#!/usr/bin/env python3
"""The dependency check finds what it should: each fault is planted in a small tree and must be named."""
import json
import os
import sys
import tempfile
import unittest
from unittest import mock

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import dependencies  # noqa: E402

TABLE = """
| folder | what it is | may include | libraries |
|---|---|---|---|
| `common/base` | basics | | |
| `common/wire` | wire | `common/base` | Boost |
| `client/net` | net | `common/{base,wire}` | |
| `db` | store | `common/base` | |
"""
FILES = {
    "common/base/words.h": "",
    "common/wire/channel.h": '#include "common/base/words.h"\n',
    "client/net/link.cpp": '#include "common/wire/channel.h"\n#include "common/base/words.h"\n',
    "db/store.cpp": '#include "common/base/words.h"\n',
}
ROOMS = TABLE + """
| folder | its rooms |
|---|---|
| `db` | `store` rows, `people` who is who |
"""
PRECOMPILED = "common/headers.dir/cmake_pch.hxx"
ALL_READ = ["client/net/link.cpp", "common/wire/channel.h", "common/base/words.h", "/usr/include/boost/asio.hpp"]


class Dependencies(unittest.TestCase):
    def faults(self, table=TABLE, files=None, read=None, compiled=60, precompiled=(), start=None):
        with tempfile.TemporaryDirectory() as root:
            root = os.path.realpath(root)
            listed = start or root  # how a listed path begins
            for path, text in {**FILES, **(files or {})}.items():
                os.makedirs(os.path.join(root, os.path.dirname(path)), exist_ok=True)
                with open(os.path.join(root, path), "w", encoding="utf-8") as file:
                    file.write(text)
            with open(os.path.join(root, "ARCHITECTURE.md"), "w", encoding="utf-8") as file:
                file.write(table)
            commands = [{"command": f"c++ -c link.cpp -o client/net/link{number}.cpp.o -MD"} for number in range(60)]
            os.makedirs(os.path.join(root, "build"))
            with open(os.path.join(root, "build/compile_commands.json"), "w", encoding="utf-8") as file:
                json.dump(commands, file)
            blocks = []
            for number in range(compiled):
                paths = "\n".join("    " + os.path.join(listed, path) for path in (read or ALL_READ))
                blocks.append(f"client/net/link{number}.cpp.o: #deps 4, deps mtime 1 (VALID)\n{paths}\n")
            headers = "\n".join("    " + os.path.join(listed, path) for path in precompiled)
            blocks.append(f"{PRECOMPILED}.pch: #deps 1, deps mtime 1 (VALID)\n{headers}\n")
            listing = mock.Mock(stdout="\n".join(blocks))
            with mock.patch.object(dependencies.subprocess, "run", return_value=listing):
                return dependencies.check(root, os.path.join(root, "build"))[0]

    def test_a_tree_that_keeps_to_its_table_has_no_fault(self):
        self.assertEqual(self.faults(), [])

    def test_a_build_that_is_not_whole(self):
        found = self.faults(compiled=59)
        self.assertTrue(any("only 59 of 60 object files" in fault for fault in found), found)

    def test_an_include_that_the_row_does_not_list(self):
        found = self.faults(files={"db/store.cpp": '#include "common/base/words.h"\n#include "common/wire/channel.h"\n'})
        self.assertTrue(any("db may not include common/wire" in fault for fault in found), found)

    def test_a_message_counts_as_proto(self):
        found = self.faults(files={"db/rows.cpp": '#include "needlelab/types.pb.h"\n'})
        self.assertTrue(any("db may not include proto" in fault for fault in found), found)

    def test_a_row_that_lists_what_nobody_includes(self):
        found = self.faults(table=TABLE.replace("| `db` | store | `common/base`", "| `db` | store | `common/{base,wire}`"))
        self.assertTrue(any("db lists common/wire" in fault for fault in found), found)

    def test_a_circle(self):
        found = self.faults(table=TABLE.replace("| basics | |", "| basics | `client/net` |"))
        self.assertTrue(any(fault.startswith("a circle: common/base") for fault in found), found)

    def test_a_folder_without_a_row_and_a_row_without_a_folder(self):
        found = self.faults(files={"server/main.cpp": ""}, table=TABLE + "| `server/web` | gone | | |\n")
        self.assertIn("ARCHITECTURE.md has no row for server", found)
        self.assertTrue(any("row for server/web" in fault for fault in found), found)

    def test_a_room_includes_rooms_before_it_only(self):
        people, store = {"db/people/people.h": '#include "db/store/rows.h"\n'}, {"db/store/rows.h": '#include "db/people/people.h"\n'}
        self.assertEqual(self.faults(table=ROOMS, files={**people, "db/store/rows.h": ""}), [])
        found = self.faults(table=ROOMS, files={"db/people/people.h": "", **store})
        self.assertTrue(any("db/store may not include db/people, a later room" in fault for fault in found), found)

    def test_a_room_keeps_to_the_row_of_its_folder(self):
        rooms = {"db/people/people.h": "", "db/store/rows.h": '#include "common/wire/channel.h"\n'}
        self.assertIn("db/store may not include common/wire: db/store/rows.h includes common/wire/channel.h", self.faults(table=ROOMS, files=rooms))

    def test_a_room_that_no_table_names_and_one_without_sources(self):
        found = self.faults(table=ROOMS, files={"db/people/people.h": "", "db/audit/audit.h": ""})
        self.assertIn("ARCHITECTURE.md has no row for db/audit", found)
        self.assertIn("ARCHITECTURE.md has a row for db/store, which has no sources", found)

    def test_a_folder_with_too_many_files(self):
        found = self.faults(files={f"db/row{number}.h": "" for number in range(25)})
        self.assertIn("db has 26 files; give them rooms, 25 files each at most", found)

    def test_a_header_that_the_compiler_read_beyond_the_rows(self):
        found = self.faults(files={"db/store.h": ""}, read=ALL_READ + ["db/store.h"])
        self.assertTrue(any("read a header of db" in fault for fault in found), found)

    def test_what_came_with_the_precompiled_headers_is_nobodys_own(self):
        with_them = ALL_READ + [f"build/{PRECOMPILED}", "db/store.h"]
        self.assertEqual(self.faults(files={"db/store.h": ""}, read=with_them, precompiled=["db/store.h"]), [])
        without = ALL_READ + ["db/store.h"]
        self.assertNotEqual(self.faults(files={"db/store.h": ""}, read=without, precompiled=["db/store.h"]), [])

    def test_paths_may_be_relative_to_the_build_folder(self):
        with_them = ALL_READ + [f"build/{PRECOMPILED}", "db/store.h"]
        self.assertEqual(self.faults(files={"db/store.h": ""}, read=with_them, precompiled=["db/store.h"], start=".."), [])
        without = ALL_READ + ["db/store.h"]
        self.assertNotEqual(self.faults(files={"db/store.h": ""}, read=without, precompiled=["db/store.h"], start=".."), [])

    def test_a_library_that_no_row_names(self):
        found = self.faults(read=ALL_READ + ["/usr/include/eigen3/Eigen/Core"])
        self.assertTrue(any("Eigen" in fault for fault in found), found)

    def test_a_build_that_was_not_made(self):
        with mock.patch.object(dependencies, "compiled", return_value=iter(())):
            self.assertTrue(any("build everything first" in fault for fault in self.faults()))


if __name__ == "__main__":
    unittest.main()
