"""Class lists, secrets, and half a file."""
import json

from lab import PASSWORD, says

PEOPLE = [("name", "full_name", "role"), ("anna", "Anna Köhler", "trainee"), ("ben", "Ben B", "trainee")]


def table(separator=",", end="\n"):
    return "".join(separator.join(row) + end for row in PEOPLE)


def rows(lab):
    file = lab.programs.file

    def console(csv, lines_above=0):
        lab.start()
        body = json.dumps({"csv": csv, "lines_above": lines_above, "dry_run": True})
        cookie, token = log_in(lab)
        return lab.http(f"POST /api/v1/people/import HTTP/1.1\r\nHost: localhost:{lab.web}\r\nOrigin: https://localhost:{lab.web}\r\nCookie: {cookie}\r\n"
                        f"X-CSRF-Token: {token}\r\nContent-Type: application/json\r\nContent-Length: {len(body)}\r\nConnection: close\r\n\r\n{body}")

    def imported(content, *words):
        return lab.admin("user", "import", file("class.csv", content), "--dry-run", *words)

    shapes = {"commas": table(), "semicolons": table(";"), "tabs": table("\t"), "Windows line ends": table(end="\r\n"), "a byte order mark": "\ufeff" + table(),
              "sep=": "sep=;\n" + table(";"), "empty rows": table().replace("\n", "\n,,\n"), "empty columns": table().replace("\n", ",,\n"),
              "capitals": table().replace("full_name", "Full Name").replace("name,", "NAME,", 1),
              "quotes": "".join(",".join(f'"{cell}"' for cell in row) + "\n" for row in PEOPLE)}
    for name, content in shapes.items():
        yield f"a list with {name}, by needlelab-admin", lambda content=content: says(imported(content), 0, "2 added")
        yield f"a list with {name}, by the console", lambda content=content: "" if '"added":2' in (got := console(content)) else got[-300:]
    titled = "Class of 2026\n\n" + table()
    yield "a list with a title above, by needlelab-admin", lambda: says(imported(titled, "--lines-above", "2"), 0, "2 added")
    yield "a list with a title above, by the console", lambda: "" if '"added":2' in (got := console(titled, 2)) else got[-300:]
    yield "UTF-16 with its mark is read", lambda: says(imported(table().encode("utf-16")), 0, "2 added")
    yield "Windows-1252 is refused with what helps", lambda: says(imported(table().encode("cp1252")), 2, "line 2", "windows-1252")
    yield "and read when a person says so", lambda: says(imported(table().encode("cp1252"), "--encoding", "windows-1252"), 0, "2 added")
    yield "U+FFFD in a name is refused", lambda: "" if "replacement" in (got := console(table().replace("ö", "\ufffd")).lower()) or "u+fffd" in got else got[-300:]
    for code in ("4.71221E+11", "4,71221E+11"):
        yield f"the code {code} is refused", lambda code=code: says(imported(f'name,code\nanna,"{code}"\n'), 2, "format the column as text")
    yield "a code of two people is refused", lambda: says(imported("name,code\nanna,471221\nben,471221\n"), 2, "is the code of line 3, too")
    for number in ("20261234.0", '"20261234,0"', "20261234.00", "2.0261234E+7"):
        for header, row in (("name", number), ("name,code", f"anna,{number}"), ("name,group", f"anna,{number}")):
            if "," in number and "group" in header:
                continue  # the comma is asked about first
            yield f"{number} as {header}", lambda header=header, row=row: says(imported(f"{header}\n{row}\n"), 2, "format the column as text")
    yield "a code that lost its zero", lambda: says(imported("name,code\nanna,0471221\nben,471222\ncem,0471223\n"), 0, "has 6 digits, most have 7")
    yield "a code with signs of thousands", lambda: says(imported('name,code\nanna,"471,221"\n'), 0, "signs of thousands")

    def in_group(group, ask=imported):
        lab.admin("group", "set", "autumn-a")
        return ask(f"name,group\nanna,{group}\n")

    for group in ("Autumn-A", "AUTUMN-A", "autumn\u2011a"):
        yield f"the group {ascii(group)}, by needlelab-admin", lambda group=group: says(in_group(group), 2, "looks like the group 'autumn-a': use it?")
        yield f"the group {ascii(group)}, by the console", lambda group=group: "" if "looks like the group 'autumn-a': use it?" in (got := in_group(group, console)) else got[-300:]
        for words in (("group", "set", group), ("assign", "--group", group, "--course", "rheumatology-basics"), ("group", "remove", group)):
            yield f"{' '.join(words[:2])} {ascii(group)}", lambda words=words: says(lab.admin(*words), 1, "looks like the group 'autumn-a': use it?")
    for space in "\u00a0\u2007\u202f\u3000":
        yield f"a group with U+{ord(space):04X} behind it", lambda space=space: says(in_group("autumn-a" + space), 0, "joins autumn-a\n")
    yield "a new group is called new", lambda: says(in_group("spring"), 0, "joins spring; new group: spring")
    yield "a station in capitals", lambda: says(lab.admin("station", "add", "ST-1", "--out", lab.programs.folder / "ST-1.key"), 1, "looks like the station 'st-1'")
    yield "an exercise in capitals", lambda: says(lab.admin("session", "list", "--exercise", "Shoulder-Bursa"), 1, "looks like the exercise 'shoulder-bursa'")
    memberships = "name,full_name,group\nanna,Anna,autumn-a\nanna,Anna,tuesday\nben,Ben,tuesday\n"
    yield "a row for each membership, by needlelab-admin", lambda: says(imported(memberships), 0, "2 added", "joins autumn-a, tuesday")
    yield "a row for each membership, by the console", lambda: "" if '"added":2' in (got := console(memberships)) else got[-300:]
    yield "groups with a comma are asked about", lambda: says(imported("name;group\nanna;autumn-a,autumn-b\n"), 2, "separated by semicolons")
    registrar = "Matrikelnummer;Nachname;Vorname;E-Mail\n471;Köhler;Anna;a@b\n"
    yield "a registrar's columns are ignored by name", lambda: says(imported(registrar), 0, "1 added", "ignored: E-Mail")
    yield "a header in other words is shown", lambda: says(imported("nom;role\nanna;trainee\n"), 2, "'nom;role', separated by semicolons")

    def with_password(content):
        return lab.programs.run("admin", "--server", f"localhost:{lab.port}", "--ca", lab.ca, "--user", "boss", "--password-file", file("pw", content), "lab", "show")

    for name, content in (("a mark", b"\xef\xbb\xbf" + PASSWORD.encode() + b"\n"), ("Windows line ends", PASSWORD.encode() + b"\r\n"), ("no line end", PASSWORD.encode())):
        yield f"a password file with {name}", lambda content=content: says(with_password(content), 0)

    def with_key():
        lab.start()
        key = (lab.programs.folder / "st-1.key").read_bytes()
        marked = file("marked.key", b"\xef\xbb\xbf" + key.strip() + b"\r\n")
        said = lab.programs.run("station", "--list-exercises", "--server", f"localhost:{lab.port}", "--ca", lab.ca, "--key", marked, "--spool", lab.programs.folder / "k")
        return says(said, 0, "shoulder-bursa")

    yield "a station's key with a mark", with_key
    yield from halves(lab)


def log_in(lab):
    lab.start()
    body = json.dumps({"name": "boss", "password": PASSWORD})
    got = lab.http(f"POST /api/v1/session HTTP/1.1\r\nHost: localhost:{lab.web}\r\nOrigin: https://localhost:{lab.web}\r\nContent-Type: application/json\r\n"
                   f"Content-Length: {len(body)}\r\nConnection: close\r\n\r\n{body}")
    head, _, answer = got.partition("\r\n\r\n")
    cookie = next(line.split(": ", 1)[1].split(";")[0] for line in head.split("\r\n") if line.lower().startswith("set-cookie:"))
    return cookie, json.loads(answer)["csrf_token"]


def halves(lab):
    """Standard output on a full disk, and exports that were cut."""
    def full(program, *words):
        with open("/dev/full", "wb") as disk:
            return lab.programs.run(program, *words, stdout=disk)

    lab.programs.run("admin", "--data", lab.programs.folder / "alone", "user", "add", "x", "--role", "administrator", "--password-file", lab.password)
    for words in (("export-all",), ("session", "list", "--json"), ("audit",), ("user", "list"), ("--help",)):
        yield f"needlelab-admin {words[0]} onto a full disk", lambda words=words: says(full("admin", "--data", lab.programs.folder / "alone", *words), 1, "cannot write to standard output")
    for program, words in (("server", ("--openapi",)), ("sim", ("--help",)), ("station", ("--list-devices",)), ("instructor", ("--help",))):
        yield f"needlelab-{program} {words[0]} onto a full disk", lambda program=program, words=words: says(full(program, *words), 1, "cannot write to standard output")

    def cut(lines):
        whole = lab.admin("export-all").out.splitlines()
        part = lab.programs.file("part.jsonl", "\n".join(whole[:lines]) + "\n")
        return lab.programs.run("admin", "--data", lab.programs.folder / "alone", "audit", "verify", "--anchor", part)

    yield "an export ends with a line that counts", lambda: "" if '"kind":"end","records":' in lab.admin("export-all").out.splitlines()[-1] else "it does not"
    yield "a cut export is refused as an anchor", lambda: says(cut(-1), 2, "a part is missing")
