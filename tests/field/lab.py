"""The programs, and a lab with a server for questions that need one."""
import os
import pathlib
import re
import signal
import ssl
import socket
import subprocess
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "db/samples"
PASSWORD = "correct horse battery 15"
PATIENCE_S = 300


class Run:
    def __init__(self, done):
        self.code, self.out, self.err = done.returncode, done.stdout, done.stderr
        self.all = self.out + self.err


class Programs:
    def __init__(self, bin_folder, folder):
        self.bin, self.folder = bin_folder, folder

    def run(self, program, *words, env=None, stdout=None):
        return self.start([self.bin / f"needlelab-{program}", *words], env, stdout)

    def start(self, words, env=None, stdout=None):
        command = [str(word) for word in words]
        output = {"stdout": stdout, "stderr": subprocess.PIPE} if stdout else {"capture_output": True}
        done = subprocess.run(command, stdin=subprocess.DEVNULL, env={**os.environ, **(env or {})}, timeout=PATIENCE_S, check=False, **output)
        done.stdout = (done.stdout or b"").decode(errors="replace")
        done.stderr = done.stderr.decode(errors="replace")
        return Run(done)

    def file(self, name, content):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        path.chmod(0o600)
        return path


class Lab:
    """A data folder and, on demand, a server with one station."""

    def __init__(self, programs):
        self.programs, self.clock, self.server = programs, programs.bin / "needlelab_clock_shim", None
        self.data = programs.folder / "lab"
        self.password = programs.file("password", PASSWORD + "\n")
        self.offline("user", "add", "boss", "--role", "administrator", "--password-file", self.password)

    def offline(self, *words):
        return self.programs.run("admin", "--data", self.data, *words)

    def start(self):
        if self.server:
            return
        for name in ("port", "web"):
            (self.programs.folder / name).unlink(missing_ok=True)
        self.log = self.programs.folder / "server.log"
        with self.log.open("ab") as log:
            self.server = subprocess.Popen(
                [self.programs.bin / "needlelab-server", "--data", self.data, "--listen", "127.0.0.1:0", "--port-file", self.programs.folder / "port",
                 "--web", "127.0.0.1:0", "--web-port-file", self.programs.folder / "web", "--host-name", "localhost", "--retention-every", "0"],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        until(lambda: all((self.programs.folder / name).exists() for name in ("port", "web")), "the server starts")
        self.port = int((self.programs.folder / "port").read_text())
        self.web = int((self.programs.folder / "web").read_text())
        self.ca = self.data / "tls/ca.crt"
        if not (self.programs.folder / "st-1.key").exists():
            self.admin("station", "add", "st-1", "--out", self.programs.folder / "st-1.key")

    def end(self, number):
        """Ends the server by a signal; returns its exit code."""
        self.server.send_signal(number)
        code = self.server.wait(PATIENCE_S)
        self.server = None
        return code

    def stop(self):
        if self.server:
            self.end(signal.SIGTERM)

    def admin(self, *words, port=None, **more):
        self.start()
        return self.programs.run("admin", "--server", f"localhost:{port or self.port}", "--ca", self.ca, "--user", "boss", "--password-file", self.password,
                                 *words, **more)

    def station(self, *words, connected=True, clock_s=0, spool="spool"):
        self.start()
        server = ["--server", f"localhost:{self.port}", "--ca", self.ca] if connected else []
        env = {"LD_PRELOAD": str(self.clock), "NEEDLELAB_CLOCK_AHEAD_S": str(clock_s)} if clock_s else None
        return self.programs.run("station", "--headless", *server, "--key", self.programs.folder / "st-1.key", "--spool", self.programs.folder / spool, *words,
                                 env=env)

    def tls(self, port, groups=None):
        """A connection with its certificate checked; None if the server refuses the handshake."""
        context = ssl.create_default_context(cafile=str(self.ca))
        plain = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)
        return context.wrap_socket(plain, server_hostname="localhost")

    def http(self, request, port=None):
        """The web port's answer to these bytes, until it closes."""
        self.start()
        with self.tls(port or self.web) as connection:
            connection.sendall(request.encode() if isinstance(request, str) else request)
            got = b""
            while True:
                try:
                    piece = connection.recv(65536)
                except ssl.SSLError:
                    break
                if not piece:
                    break
                got += piece
        return got.decode(errors="replace")

    def get(self, path, headers=""):
        return self.http(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n{headers}Connection: close\r\n\r\n")


def until(holds, what):
    for _ in range(PATIENCE_S * 20):
        if holds():
            return
        time.sleep(0.05)
    raise SystemExit(f"waited in vain: {what}")


def number(text, name):
    """The number after a name in a report."""
    found = re.search(rf"{re.escape(name)}\D*?(-?\d+(?:\.\d+)?(?:e-?\d+)?)", text)
    return float(found.group(1)) if found else float("nan")


def says(run, code, *texts):
    """None if the program ended with this code and printed all of this; otherwise what is wrong."""
    if run.code != code:
        return f"exit {run.code}, not {code}: {run.all.strip()[-300:]}"
    for text in texts:
        if text not in run.all:
            return f"does not say '{text}': {run.all.strip()[-300:]}"
    return ""


def near(value, right, share, what):
    return "" if abs(value - right) <= share * abs(right) else f"{what} is {value}, not {right}"
