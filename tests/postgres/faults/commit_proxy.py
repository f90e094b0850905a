"""A network between needlelab-server and PostgreSQL that fails in the middle of a COMMIT."""
import pathlib
import select
import socket
import struct
import threading
import time

MANY_BYTES = 2000  # a transaction that stores chunks has more
HOLD_S = 0.3


class Frontend:
    """A client's messages, as far as the writer's COMMIT is visible; one in a pipeline arrives with everything up to the pipeline's end."""

    def __init__(self):
        self.data, self.started, self.writes, self.bytes, self.held = b"", False, False, 0, b""

    def messages(self, data):
        """Splits received bytes into whole messages; tells for each whether it is a COMMIT of a transaction that stores much."""
        self.data += data
        while True:
            head = 1 if self.started else 0
            if len(self.data) < head + 4:
                return
            length = head + struct.unpack(">I", self.data[head:head + 4])[0]
            if len(self.data) < length:
                return
            message, self.data = self.data[:length], self.data[length:]
            is_commit = self._is_commit(message)
            if self.held or (is_commit and message[:1] == b"P"):
                self.held += message
                if message[:1] == b"S":
                    yield self.held, True
                    self.held = b""
                continue
            yield message, is_commit

    def _is_commit(self, message):
        if not self.started:
            self.started = message[4:8] == struct.pack(">I", 196608)
            return False
        if b"BEGIN ISOLATION LEVEL READ COMMITTED" in message:
            self.writes, self.bytes = True, 0
        self.bytes += len(message)
        if message[:1] + message[5:] != b"QCOMMIT\0" and not (message[:1] == b"P" and message[5:].startswith(b"\0COMMIT\0")):
            return False
        much = self.writes and self.bytes >= MANY_BYTES
        self.writes = False
        return much


class CommitProxy:
    """127.0.0.1:port → the cluster's socket. arm() sets what happens at the next such COMMIT:
    request: it does not reach PostgreSQL, and both ends are cut (after HOLD_S);
    answer: PostgreSQL executes it, its answer does not come back, and both ends are cut;
    silent: PostgreSQL executes it, no answer comes back, and nothing is cut: the connection is half open.
    Afterwards every new connection is cut at once, until heal()."""

    def __init__(self, cluster):
        self.cluster, self.mode, self.away, self.cuts = cluster, None, False, 0
        self._lock = threading.Lock()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def arm(self, mode):
        with self._lock:
            self.mode = mode

    def heal(self):
        self.away = False

    def close(self):
        self.away = True
        self._listener.close()

    def _accept(self):
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client):
        server = socket.socket(socket.AF_UNIX)
        try:
            if not self.away:
                server.connect(str(pathlib.Path(self.cluster.folder) / ".s.PGSQL.5432"))
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._forward(client, server)
        except OSError:
            pass
        finally:
            client.close()
            server.close()

    def _forward(self, client, server):
        frontend = Frontend()
        while not self.away:
            for ready in select.select([client, server], [], [], 0.05)[0]:
                data = ready.recv(1 << 16)
                if not data:
                    return
                if ready is server:
                    client.sendall(data)
                    continue
                for message, is_commit in frontend.messages(data):
                    if is_commit and (mode := self._strikes()):
                        self._commit(mode, message, client, server)
                        return
                    server.sendall(message)

    def _strikes(self):
        """At one COMMIT only."""
        with self._lock:
            mode, self.mode = self.mode, None
            return mode

    def _commit(self, mode, message, client, server):
        if mode == "request":
            time.sleep(HOLD_S)
        else:
            server.sendall(message)
            server.recv(1 << 16)  # it is committed
        self.away = True
        self.cuts += 1
        while mode == "silent" and select.select([client], [], [], 60)[0] and client.recv(1 << 16):
            pass
