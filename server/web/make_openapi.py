#!/usr/bin/env python3
"""Writes openapi.json: schemas from proto/needlelab/*.proto as reply_json.cpp writes them, addresses from the
table below. Run it after a change of either: server/web/make_openapi.py; a test compares with the routes."""
import json
import pathlib
import re

HERE = pathlib.Path(__file__).resolve().parent
PROTO = HERE.parent.parent / "proto" / "needlelab"
NUMBERS = {"double": "number", "float": "number", "bool": "boolean"}
INTEGERS = {"int32", "uint32", "sint32", "int64", "uint64"}


# texts that are JSON themselves: rows of common/scoring/report.h and reference.h
MAYBE = {"type": ["number", "null"]}


def rows(required, **fields):
    return {"type": ["array", "null"], "description": "null: there is none",
            "items": {"type": "object", "properties": fields, "required": required.split(), "additionalProperties": False}}


MEASURES = rows("measure value unit words", measure={"type": "string"}, value=MAYBE, unit={"type": "string"}, min={"type": "number"},
                max={"type": "number"}, passed={"type": "boolean"}, words={"type": "string"})
COMPARISON = rows("measure value unit n mean sd z better standing words", measure={"type": "string"}, value=MAYBE, unit={"type": "string"},
                  n={"type": "integer"}, mean=MAYBE, sd=MAYBE, z=MAYBE, better={"type": "string"}, standing={"type": "string"}, words={"type": "string"})
PROGRESS = rows("measure unit better attempts values trend curve words", measure={"type": "string"}, unit={"type": "string"}, better={"type": "string"},
                attempts={"type": "array", "items": {"type": "integer"}}, values={"type": "array", "items": MAYBE},
                trend={"type": ["object", "null"], "properties": dict.fromkeys(("slope_per_attempt", "tau", "p"), MAYBE), "additionalProperties": False},
                curve={"type": ["object", "null"], "properties": dict.fromkeys(("end", "gain", "attempts", "r_squared"), MAYBE), "additionalProperties": False},
                words={"type": "string"})
INNER = {("Score", "measures"): MEASURES, ("Score", "comparison"): COMPARISON, ("SessionInfo", "score"): MEASURES,
         ("Attempt", "score"): MEASURES}


def without_comments(text):
    return re.sub(r"//[^\n]*", "", text)


def blocks(text, outer=""):
    """All messages and enums of a text: (kind, full name, body without inner blocks)."""
    found, position, rest = [], 0, ""
    for match in iter(lambda: re.compile(r"\b(message|enum|oneof|extend)\s+([\w.]+)\s*\{").search(text, position), None):
        rest += text[position:match.start()]
        depth, end = 1, match.end()
        while depth:
            depth += {"{": 1, "}": -1}.get(text[end], 0)
            end += 1
        kind, name, body = match.group(1), match.group(2), text[match.end():end - 1]
        if kind == "oneof":
            inner, plain = blocks(body, outer)
            found += inner
            rest += re.sub(r"(^|;)(\s*)(\w)", r"\1\2optional \3", plain)
        elif kind != "extend":
            inner, plain = blocks(body, outer + name + ".")
            found += inner + [(kind, outer + name, plain)]
        position = end
    return found, rest + text[position:]


def schemas():
    kinds, bodies = {}, {}
    for path in sorted(PROTO.glob("*.proto")):
        for kind, name, body in blocks(without_comments(path.read_text()))[0]:
            kinds[name], bodies[name] = kind, body
    made = {}

    def resolved(owner, name):
        scope = owner.split(".")
        for depth in range(len(scope), -1, -1):
            full = ".".join(scope[:depth] + [name])
            if full in kinds:
                return full
        raise SystemExit(f"{owner}: unknown type {name}")

    def of_type(owner, type_name, field):
        if field == "unix_ns" or field.endswith("_unix_ns"):
            return {"type": ["number", "null"], "description": "ms since 1970, null: not yet or never"}
        if type_name in NUMBERS:
            return {"type": [NUMBERS[type_name], "null"] if type_name == "double" else NUMBERS[type_name]}
        if type_name in INTEGERS:
            return {"type": "integer", **({"minimum": 0} if type_name.startswith("u") else {})}
        if type_name == "bytes":
            session = field in ("session_id", "session_ids")
            return {"type": "string", **({"format": "uuid"} if session else {})}
        if type_name == "string":
            return {"type": "string"}
        full = resolved(owner, type_name)
        if kinds[full] == "enum":
            return {"enum": re.findall(r"(\w+)\s*=", bodies[full])}
        return {"$ref": "#/components/schemas/" + full.replace(".", "_")}

    for name, kind in kinds.items():
        if kind != "message":
            continue
        fields, needed = {}, []
        for label, type_name, field in re.findall(
                r"(optional|repeated)?\s*([\w.]+)\s+(\w+)\s*=\s*\d+\s*(?:\[[^;]*\])?;", bodies[name]):
            schema = of_type(name, type_name, field)
            key = field
            if field == "unix_ns" or field.endswith("_unix_ns"):
                key = field[:-2] + "ms"
            elif type_name == "string" and label != "repeated" and (field == "json" or field.endswith("_json")):
                key = field if field == "json" else field[:-5]
                schema, label = INNER.get((name, key), {}), "optional"  # lists leave it out
            if field == "records":
                schema = {"type": "object"}
            if label == "repeated":
                schema = {"type": "array", "items": schema}
            fields[key] = schema
            is_message = "$ref" in schema
            if label != "optional" and not is_message:
                needed.append(key)
        made[name.replace(".", "_")] = {"type": "object", "properties": fields,
                                        **({"required": needed} if needed else {}), "additionalProperties": False}
    return made


MADE = schemas()
USED = {}


def ref(name):
    return {"$ref": "#/components/schemas/" + name}


def obj(required, **fields):
    return {"type": "object", "properties": fields, "required": required.split(), "additionalProperties": False}


def list_of(item, **more):
    return obj(" ".join(["items", "next_page", *more]), items={"type": "array", "items": item},
               next_page={"type": "string", "description": "for ?page=; empty: this was the last"}, **more)


def body_of(name, *outside):
    """A request's fields; what stands in the address is not among them."""
    fields = {k: v for k, v in MADE[name]["properties"].items() if k not in outside}
    return {"type": "object", "properties": fields, "additionalProperties": False}


TEXT, NUMBER, FLAG, WHOLE = {"type": "string"}, {"type": "number"}, {"type": "boolean"}, {"type": "integer"}
NUMBERS_LIST = {"type": "array", "items": {"type": ["number", "null"]}}
EMPTY = {"type": "object", "maxProperties": 0}
ROLES = {"enum": re.findall(r"(\w+)\s*=", dict((n, b) for _, n, b in blocks((PROTO / "types.proto").read_text())[0])["Role"])}
SESSION = obj("name full_name role csrf_token expires_unix_ms", name=TEXT, full_name=TEXT, role=ROLES, csrf_token=TEXT, expires_unix_ms=NUMBER)
PLOT = obj("rate_hz samples from_s to_s decimated columns", rate_hz=NUMBER, samples=WHOLE, from_s=NUMBER, to_s=NUMBER, decimated=FLAG,
           columns={"type": "object", "additionalProperties": NUMBERS_LIST, "required": ["t_s", "force_n"]})
REMARK = {**MADE["Annotation"], "properties": {**MADE["Annotation"]["properties"], "t_s": NUMBER}, "required": MADE["Annotation"]["required"] + ["t_s"]}
LOGIN = obj("name password", name=TEXT, password=TEXT)

# method, address, what it does, query, body, reply (a schema; a text: its media type)
TABLE = [
    ("POST", "/session", "Log in; the cookie comes with the reply", "", LOGIN, SESSION),
    ("GET", "/session", "Who is logged in, and until when", "", None, SESSION),
    ("DELETE", "/session", "Log out", "", None, EMPTY),
    ("GET", "/live", "WebSocket: {tiles: […]} every 200 ms", "", None, "101"),
    ("GET", "/openapi.json", "This file", "", None, {"type": "object"}),
    ("GET", "/people", "People", "page", None, list_of(ref("User"))),
    ("POST", "/people", "A new person", "", body_of("AddUser"), obj("name role", name=TEXT, role=ROLES)),
    ("POST", "/people/import", "A class from CSV: name, full_name, role, group, password", "", body_of("ImportPeople"), ref("PeopleImport")),
    ("GET", "/people/{name}", "One person", "", None, ref("User")),
    ("PATCH", "/people/{name}", "Role, name, access (If-Match); or the word on studies, alone", "", {"type": "object"}, ref("User")),
    ("POST", "/people/{name}/password", "A new password; ends the person's sessions", "", obj("password", password=TEXT), EMPTY),
    ("GET", "/people/{name}/consents", "All words on studies", "", None, list_of(ref("Consent"))),
    ("GET", "/people/{name}/export", "Everything that is stored of a person, to download", "", None, obj("items", items={"type": "array", "items": {"type": "object"}})),
    ("DELETE", "/people/{name}/data", "Erases a person; confirm must be the name", "", body_of("ErasePerson", "name"), ref("Erasure")),
    ("GET", "/people/{name}/progress", "Attempts in order of time", "exercise page", None, list_of(ref("Attempt"), measures=PROGRESS)),
    ("GET", "/groups", "Groups", "page", None, list_of(ref("Group"))),
    ("POST", "/groups", "A new group", "", {"type": "object"}, ref("Group")),
    ("GET", "/groups/{id}", "One group", "", None, ref("Group")),
    ("PUT", "/groups/{id}", "A group with all its members", "", {"type": "object"}, ref("Group")),
    ("DELETE", "/groups/{id}", "Removes a group and its assignments", "", None, EMPTY),
    ("GET", "/stations", "Stations, online or not", "page", None, list_of(ref("StationInfo"))),
    ("GET", "/profiles", "Patient profiles", "", None, list_of(ref("ProfileSummary"))),
    ("POST", "/profiles/check", "Everything that is wrong with a profile", "", {"type": "object"}, ref("TextCheck")),
    ("POST", "/profiles/preview", "Force over depth, by the engine", "points", {"type": "object"}, ref("ProfilePreview")),
    ("GET", "/profiles/{id}", "A profile; revision: by default the newest", "revision", None, ref("ProfileText")),
    ("PUT", "/profiles/{id}", "A new revision; If-Match \"0\": a new profile", "", {"type": "object"}, ref("ProfileText")),
    ("GET", "/profiles/{id}/revisions", "Newest first", "page", None, list_of(ref("Revision"))),
    ("GET", "/courses", "Courses", "", None, list_of(ref("CurriculumSummary"))),
    ("POST", "/courses/check", "What is wrong with a course", "", {"type": "object"}, ref("TextCheck")),
    ("GET", "/courses/{id}", "A course; revision: by default the newest", "revision", None, ref("CurriculumText")),
    ("PUT", "/courses/{id}", "A new revision; If-Match \"0\": a new course", "", {"type": "object"}, ref("CurriculumText")),
    ("GET", "/courses/{id}/revisions", "Newest first", "page", None, list_of(ref("Revision"))),
    ("GET", "/exercises", "Exercises of a course, or of all", "course page", None, list_of(ref("ExerciseRow"))),
    ("GET", "/measures", "What scores measure", "", None, list_of(ref("MeasureInfo"), definition_version=WHOLE)),
    ("GET", "/exercises/{id}/reference", "Bands of chosen sessions of experts", "", None, ref("Reference")),
    ("PUT", "/exercises/{id}/reference", "Chooses them (If-Match)", "", obj("session_ids", session_ids={"type": "array", "items": TEXT}), ref("Reference")),
    ("GET", "/assignments", "Who is to do what until when", "trainee course group page", None, list_of(ref("Assignment"))),
    ("POST", "/assignments", "An exercise or a course for a trainee or a group", "", {"type": "object"}, ref("Assignment")),
    ("DELETE", "/assignments/{id}", "Takes it back", "", None, EMPTY),
    ("GET", "/results", "Trainee by exercise", "course group page", None, ref("Results")),
    ("GET", "/scores.csv", "Scores, a measure a line; units in a column", "course group", None, "text/csv"),
    ("POST", "/scores/rescore", "All sessions whose newest score is of older definitions", "", body_of("RescoreAll"), ref("RescoreReport")),
    ("GET", "/studies/{study}", "Records of those who consent, under pseudonyms", "exercise remarks page", None, list_of({"type": "object"})),
    ("GET", "/sessions", "Recorded sessions, newest first", "trainee station exercise from_ms to_ms verdict search limit page", None, list_of(ref("SessionInfo"))),
    ("GET", "/sessions/{id}", "One session", "", None, ref("SessionInfo")),
    ("GET", "/sessions/{id}/score", "Its score; definition_version: by default the newest", "definition_version", None, ref("Score")),
    ("POST", "/sessions/{id}/rescore", "Scores it by the definitions of now", "", None, ref("Score")),
    ("POST", "/sessions/{id}/excuse", "An attempt that shall not count", "", {"type": "object"}, ref("Attempt")),
    ("GET", "/sessions/{id}/events", "Aspirations and injections", "page", None, list_of(ref("SyringeEvent"), stored=FLAG)),
    ("GET", "/sessions/{id}/samples", "Samples for a plot, decimated", "from_s to_s points", None, PLOT),
    ("GET", "/sessions/{id}/samples.csv", "All samples; units in the header", "from_s to_s", None, "text/csv"),
    ("GET", "/sessions/{id}/annotations", "Remarks", "page", None, list_of(REMARK)),
    ("POST", "/sessions/{id}/annotations", "A remark", "", obj("text t_s", text=TEXT, t_s=NUMBER), REMARK),
    ("GET", "/audit", "Who changed what; newest first", "who action page", None, list_of(ref("AuditEntry"))),
    ("POST", "/backup", "A verified copy on the server's machine; without a path beside the database", "", obj("", path=TEXT, keep=WHOLE), ref("BackupDone")),
    ("POST", "/check", "The database and every recording in it", "", None, ref("CheckReport")),
    ("GET", "/retention", "What is kept how long", "", None, ref("Retention")),
    ("PUT", "/retention", "A policy of an exercise, or of all; as_default: the exercise's own is taken away", "", body_of("SetRetention"), EMPTY),
    ("POST", "/retention/run", "Thins and deletes now, or says what it would", "", body_of("RunRetention"), ref("RetentionReport")),
]
CREATED = {("POST", "/people"), ("POST", "/groups"), ("POST", "/assignments"), ("POST", "/sessions/{id}/annotations")}


def operation(method, path, words, query, body, reply):
    parameters = [{"name": n, "in": "path", "required": True, "schema": TEXT} for n in re.findall(r"\{(\w+)\}", path)]
    parameters += [{"name": n, "in": "query", "schema": TEXT} for n in query.split()]
    if method in ("PUT", "PATCH") and path != "/retention" or (method, path) == ("DELETE", "/groups/{id}"):
        parameters.append({"name": "If-Match", "in": "header", "required": method != "PATCH", "schema": TEXT,
                           "description": "the revision that was changed, in quotes; 409 with current_revision when it is not the newest"})
    if method != "GET" and path != "/session" or method == "DELETE":
        parameters.append({"name": "X-CSRF-Token", "in": "header", "required": True, "schema": TEXT})
    status = "101" if reply == "101" else "201" if (method, path) in CREATED else "200"
    content = {} if reply == "101" else {reply: {}} if isinstance(reply, str) else {"application/json": {"schema": reply}}
    return {
        "summary": words, **({"parameters": parameters} if parameters else {}),
        **({"requestBody": {"required": True, "content": {"application/json": {"schema": body}}}} if body else {}),
        "responses": {status: {"description": words, **({"content": content} if content else {})},
                      "default": {"description": "Refused", "content": {"application/json": {"schema": ref("Refused")}}}},
        **({"security": []} if (method, path) == ("POST", "/session") else {}),
    }


def used(node):
    if isinstance(node, dict):
        for key, value in node.items():
            if key == "$ref":
                name = value.rsplit("/", 1)[1]
                if name not in USED and name != "Refused":
                    USED[name] = MADE[name]
                    used(MADE[name])
            else:
                used(value)
    elif isinstance(node, list):
        for item in node:
            used(item)


paths = {}
for row in TABLE:
    paths.setdefault(row[1], {})[row[0].lower()] = operation(*row)
used(paths)
REFUSED = obj("error", error={"type": "object", "required": ["code", "message"], "additionalProperties": False,
                              "properties": {"code": TEXT, "message": TEXT, "field": TEXT, "current_revision": WHOLE}})
document = {
    "openapi": "3.1.0",
    "info": {"title": "needlelab", "version": "1", "description": "Log in by POST /session; the cookie __Host-needlelab comes with the reply. "
             "Everything but GET needs the reply's csrf_token in X-CSRF-Token. Times are ms since 1970. Written by make_openapi.py."},
    "servers": [{"url": "/api/v1"}],
    "security": [{"session": []}],
    "paths": paths,
    "components": {"securitySchemes": {"session": {"type": "apiKey", "in": "cookie", "name": "__Host-needlelab"}},
                   "schemas": {"Refused": REFUSED, **dict(sorted(USED.items()))}},
}
(HERE / "openapi.json").write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n")
