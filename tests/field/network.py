"""Ports, proxies, signals and TLS."""
import contextlib
import signal
import socket
import ssl
import subprocess
import threading

from lab import says


def rows(lab):
    def curl(port):
        lab.start()
        done = subprocess.run(["curl", "-sS", "--cacert", str(lab.ca), "--max-time", "60", f"https://localhost:{port}/"], capture_output=True, text=True, check=False)
        return done.stdout + done.stderr

    yield "a browser at the stations' port learns the console's", lambda: "" if f"port {lab.web}" in (got := curl(lab.port)) else got
    yield "a program at the browsers' port learns of it", lambda: says(lab.admin("user", "list", port=lab.web), 2, "the port for browsers")

    def from_page(origin, host):
        return lab.http(f"POST /api/v1/groups HTTP/1.1\r\nHost: {host}\r\nOrigin: {origin}\r\nContent-Type: application/json\r\nContent-Length: 2\r\nConnection: close\r\n\r\n{{}}")

    for origin, host in (("https://lab.example.org", "lab.example.org"), ("https://lab.example.org", "lab.example.org:443"), ("https://lab.example.org:443", "lab.example.org")):
        yield f"Origin {origin} is a page of Host {host}", lambda origin=origin, host=host: "" if " 401 " in (got := from_page(origin, host))[:20] else got[:200]

    def refused():
        got = from_page("https://evil.example.org", "lab.example.org")
        text = lab.log.read_text(errors="replace")
        return "" if " 403 " in got[:20] and "evil.example.org" in text and "Host 'lab.example.org'" in text else got[:200]

    yield "a page of another host is refused, and the log has both", refused
    yield "two Hosts are 400", lambda: "" if " 400 " in (got := lab.http("GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n"))[:20] else got[:200]
    yield "an absolute target is taken", lambda: "" if " 401 " in (got := lab.get(f"https://localhost:{lab.web}/api/v1/people"))[:20] else got[:200]
    yield "401 says how to log in", lambda: "" if "WWW-Authenticate: " in (got := lab.get("/api/v1/people")) else got[:300]
    yield "answers have the date", lambda: "" if "\r\nDate: " in (got := lab.get("/")) else got[:300]
    yield "a WebSocket without a key is refused", lambda: "" if " 101 " not in (
        got := lab.get("/api/v1/live", "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: x\r\n"))[:20] else got[:200]

    def server(address, code, words):
        lab.start()
        return says(asked(address.format(port=lab.port), lab.ca), code, words)

    def asked(address, ca):
        return lab.programs.run("admin", "--server", address, "--ca", ca, "--user", "boss", "--password-file", lab.password, "user", "list")

    for address in ("//localhost:{port}", "localhost:{port}/", " localhost : {port} "):
        yield f"--server '{address}' is taken", lambda address=address: server(address, 0, "boss")
    for address in ("https://localhost", "https://localhost:{port}/#/people", "localhost:{port}/#/people"):
        yield f"--server '{address}' is a browser's: it says what to write", lambda address=address: server(address, 2, "e.g. localhost:7750")

    def der():
        lab.start()
        ca = lab.programs.folder / "ca.cer"
        ca.write_bytes(ssl.PEM_cert_to_DER_cert(lab.ca.read_text()))
        return says(asked(f"localhost:{lab.port}", ca), 0, "boss")

    yield "--ca as a browser saves it (DER) is taken", der

    def self_signed():
        lab.start()
        key, own = lab.programs.folder / "own.key", lab.programs.folder / "own.crt"
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-keyout", key, "-out", own,
                        "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost"], check=True, capture_output=True)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(own, key)
        with socket.create_server(("127.0.0.1", 0)) as listener:
            def answer():
                connection, _ = listener.accept()
                with contextlib.suppress(OSError), context.wrap_socket(connection, server_side=True) as tls:
                    tls.recv(1)
            answering = threading.Thread(target=answer)
            answering.start()
            said = asked(f"localhost:{listener.getsockname()[1]}", lab.ca)
            answering.join()
        return says(said, 1, "is not signed by the CA of --ca")

    yield "a server with a certificate of its own is not the lab's", self_signed

    def groups(name, port):
        lab.start()
        done = subprocess.run(["openssl", "s_client", "-connect", f"localhost:{port}", "-groups", name], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
        return "Cipher is TLS_" in done.stdout

    for port in ("port", "web"):
        for name in ("X25519", "P-256", "P-384"):
            yield f"TLS at {port} takes {name}", lambda name=name, port=port: "" if groups(name, getattr(lab, port)) else "refused"
        for name in ("ffdhe2048", "ffdhe8192"):
            yield f"TLS at {port} refuses {name}", lambda name=name, port=port: "taken" if groups(name, getattr(lab, port)) else ""

    def hang_up():
        lab.start()
        code = lab.end(signal.SIGHUP)
        text = lab.log.read_text(errors="replace")
        return "" if code == 0 and "stopping" in text else f"exit {code}"

    yield "SIGHUP ends the server as SIGTERM does", hang_up
    yield "a similar name is suggested in a lab without assignments", lambda: says(
        lab.station("--trainee", "tomm", "--exercise", "shoulder-bursa", "--seconds", "1"), 1, "Did you mean 'tom'?")
