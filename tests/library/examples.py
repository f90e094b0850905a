"""The programs that python3-needlelab installs as examples, from installed files. scipy: deploy/setup unpacks it."""
import ctypes
import os
import pathlib
import subprocess
import sys

SCIPY = "/usr/local/lib/needlelab-test-python"


def environment(prefix):
    packages = [str(prefix / "lib/python3/dist-packages"), SCIPY]
    return dict(os.environ, LD_LIBRARY_PATH=str(prefix / "lib"), PYTHONPATH=os.pathsep.join(packages), OPENBLAS_NUM_THREADS="1")


def installed(build, folder, program):
    """A function that runs the program and returns what it prints; the program can then also be imported here."""
    prefix = folder / "usr"
    for component in ("needlelab-haptics", "needlelab", "python"):
        subprocess.run(["cmake", "--install", build, "--prefix", prefix, "--component", component], check=True, stdout=subprocess.DEVNULL)
    place = prefix / "share/doc/python3-needlelab/examples"
    for library in ("libneedlelab-haptics.so.1", "libneedlelab.so.1"):
        ctypes.CDLL(str(prefix / "lib" / library), ctypes.RTLD_GLOBAL)
    sys.path[:0] = [str(place), str(prefix / "lib/python3/dist-packages"), SCIPY]
    os.environ["OPENBLAS_NUM_THREADS"] = "1"

    def run(*words):
        done = subprocess.run(run.words(*words), capture_output=True, text=True, env=run.environment)
        assert done.returncode == 0, f"{words}: exit {done.returncode}\n{done.stdout}{done.stderr}"
        return done.stdout

    run.words = lambda *words: ["/usr/bin/python3", "-B", str(place / program), *map(str, words)]
    run.environment = environment(pathlib.Path(prefix))
    return run
