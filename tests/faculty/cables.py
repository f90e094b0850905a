"""The machines of a lab as network namespaces on one switch; traffic from one to another can be dropped silently."""
import ctypes
import os
import subprocess
import threading
import time

NETWORK = "10.77.1"
NOBODY = "02:00:00:00:de:ad"  # no machine's hardware address: the switch forwards the frame to all, and none accepts it
CLONE_NEWNET = 0x40000000
IP = next((path for path in ("/usr/sbin/ip", "/sbin/ip", "/usr/bin/ip") if os.access(path, os.X_OK)), None)


class NoNamespaces(Exception):
    """Why there are no namespaces here."""


class Here:
    """This machine: all programs are on its loopback device."""
    address, enter = "127.0.0.1", []

    @staticmethod
    def call(work):
        return work()


class Machine:
    """A network namespace with one address, held by a process that ends with this one. `enter`: the command to put before a program's."""

    def __init__(self, address):
        self.address = address
        self._holder = subprocess.Popen(["unshare", "--net", "cat"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)  # pylint: disable=consider-using-with
        self.pid, end = self._holder.pid, time.monotonic() + 60
        ours = os.readlink("/proc/self/ns/net")
        while self._holder.poll() is None and time.monotonic() < end:
            try:
                if os.readlink(f"/proc/{self.pid}/ns/net") != ours:
                    break
            except OSError:
                pass
            time.sleep(0.005)
        else:
            self.close()
            raise NoNamespaces("unshare --net: no namespace was made")
        self.enter = ["nsenter", f"--net=/proc/{self.pid}/ns/net"]

    def run(self, *arguments):
        done = subprocess.run([*self.enter, *arguments], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise NoNamespaces(f"{' '.join(arguments)}: {done.stderr.strip()}")

    def call(self, work):
        """Runs `work` in a thread inside this network and returns its result: sockets that it creates stay there."""
        outcome = {}

        def inside():
            try:
                with open(f"/proc/{self.pid}/ns/net", "rb") as space:
                    if ctypes.CDLL(None, use_errno=True).setns(space.fileno(), CLONE_NEWNET) != 0:
                        raise OSError(ctypes.get_errno(), f"setns: {os.strerror(ctypes.get_errno())}")
                outcome["result"] = work()
            except BaseException as error:  # pylint: disable=broad-except
                outcome["error"] = error
        thread = threading.Thread(target=inside)
        thread.start()
        thread.join()
        if "error" in outcome:
            raise outcome["error"]
        return outcome["result"]

    def close(self):
        """The kernel removes the namespace when the last program in it has ended."""
        self._holder.stdin.close()
        self._holder.wait()


def lost_ways(one, other, way):
    """(from, to) of dropped traffic: "to": from `one` to `other`; "from": the answers; "both"."""
    return {"to": [(one, other)], "from": [(other, one)], "both": [(one, other), (other, one)]}[way]


class Switch:
    """The machines by name, each reaching all others."""

    def __init__(self, names):
        if os.getuid() != 0:
            raise NoNamespaces("network namespaces for a whole lab want root")
        if IP is None:
            raise NoNamespaces("no 'ip' (package iproute2)")
        self.machines, self._lost = {}, set()
        self._switch = Machine("")
        try:
            self._switch.run(IP, "link", "add", "br0", "type", "bridge")
            self._switch.run(IP, "link", "set", "br0", "up")
            for number, name in enumerate(names, 1):
                self._plug(number, name)
        except BaseException:
            self.close()
            raise

    def _plug(self, number, name):
        machine = self.machines[name] = Machine(f"{NETWORK}.{number}")
        port = f"port{number}"
        self._switch.run(IP, "link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", str(machine.pid))
        self._switch.run(IP, "link", "set", port, "master", "br0")
        self._switch.run(IP, "link", "set", port, "up")
        machine.run(IP, "addr", "add", f"{machine.address}/24", "dev", "eth0")
        machine.run(IP, "link", "set", "eth0", "up")
        machine.run(IP, "link", "set", "lo", "up")

    def cut(self, one, other, way="both"):
        """From now on drops the traffic named by lost_ways(), also on existing connections."""
        for sender, receiver in lost_ways(one, other, way):
            self.machines[sender].run(IP, "neigh", "replace", self.machines[receiver].address, "lladdr", NOBODY, "nud", "permanent", "dev", "eth0")
            self._lost.add((sender, receiver))

    def heal(self):
        for sender, receiver in sorted(self._lost):
            self.machines[sender].run(IP, "neigh", "del", self.machines[receiver].address, "dev", "eth0")
        self._lost.clear()

    def close(self):
        for machine in [*self.machines.values(), self._switch]:
            machine.close()
