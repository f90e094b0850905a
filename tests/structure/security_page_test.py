#!/usr/bin/env python3
"""The check of SECURITY.md finds what it should."""
import os
import tempfile
import unittest

import security_page

PAGE = """# Security
| against | promise | held by |
|---|---|---|
| a stranger | TLS only | `tests/a_test.cpp` |
See `db/b.cpp`, `deploy/c --all`.
"""


class SecurityPage(unittest.TestCase):
    def faults(self, page=PAGE, readme="[s](SECURITY.md)", missing=()):
        with tempfile.TemporaryDirectory() as root:
            for folder in ("db", "deploy", "tests"):
                os.mkdir(os.path.join(root, folder))
            files = {"tests/a_test.cpp": "", "db/b.cpp": "", "deploy/c": "", "SECURITY.md": page, "README.md": readme}
            files["ARCHITECTURE.md"] = "[s](SECURITY.md)"
            for name, text in files.items():
                if name not in missing:
                    with open(os.path.join(root, name), "w", encoding="utf-8") as file:
                        file.write(text)
            return security_page.check(root)[0]

    def test_a_true_page_has_no_faults(self):
        self.assertEqual(self.faults(), [])

    def test_a_file_that_is_gone_is_named_with_its_line(self):
        self.assertEqual(self.faults(missing=("db/b.cpp",)), ["SECURITY.md:5: db/b.cpp is missing"])
        self.assertEqual(self.faults(missing=("deploy/c",)), ["SECURITY.md:5: deploy/c is missing"])

    def test_a_promise_without_a_test_is_named(self):
        for held in ("", "`tests/`", "`db/b.cpp`", "`tests/gone_test.cpp`"):
            found = self.faults(PAGE.replace("`tests/a_test.cpp`", held))
            self.assertIn("SECURITY.md:4: no test holds this promise: TLS only", found, held)

    def test_a_page_without_its_table_is_none(self):
        self.assertEqual(len(self.faults("# Security\n")), 1)

    def test_the_page_is_linked_and_short(self):
        self.assertEqual(self.faults(readme=""), ["README.md does not link to SECURITY.md"])
        self.assertEqual(len(self.faults(PAGE + "\n" * 150)), 1)

    def test_a_limit_without_an_attack_and_an_attack_without_a_test_are_named(self):
        header = "struct Places {\n  std::size_t most = 4;  ///< places\n  double a_second{5};\n};\n"
        row = "Places.{}\tsomebody takes all\ttests/a_test.cpp\t{}\n"
        for rows, faults in (
            (row.format("most", "aTest") + row.format("a_second", "aTest"), 0),
            (row.format("most", "aTest"), 1),
            (row.format("most", "aTest") + row.format("a_second", "another"), 1),
            (row.format("most", "aTest") + row.format("a_second", "aTest") + row.format("gone", "aTest"), 1),
        ):
            with tempfile.TemporaryDirectory() as root:
                files = {"server/live/limits/limits.h": header, "tests/security/limits.tsv": "limit\n" + rows, "tests/a_test.cpp": "TEST(A, aTest) {\n"}
                for name, text in files.items():
                    os.makedirs(os.path.dirname(os.path.join(root, name)), exist_ok=True)
                    with open(os.path.join(root, name), "w", encoding="utf-8") as file:
                        file.write(text)
                self.assertEqual(len(security_page.limits(root)), faults, rows)


if __name__ == "__main__":
    unittest.main()
