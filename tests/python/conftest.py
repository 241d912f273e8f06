"""Starts plicad on a free loopback port, with a scene of the tests' own."""

import os
import pathlib
import signal
import socket
import subprocess
import time

import pytest
import zenoh

from client import Client, wait_until

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
PROGRAMS = pathlib.Path(os.environ.get("PLICA_BIN", REPOSITORY / "target" / "release"))
STALE_S = 1.0


@pytest.fixture(scope="session")
def plicad():
    path = PROGRAMS / "plicad"
    assert path.exists(), f"{path} is missing: run `cargo build --release`, or set PLICA_BIN to the folder that holds it"
    return str(path)


@pytest.fixture(scope="session")
def scene(tmp_path_factory):
    """The documented wedge, with a frame per tick and a stale time that outlasts a busy machine."""
    text = (REPOSITORY / "configs" / "scenes" / "wedge.toml").read_text()
    for key, value in (("publish_hz", "1000.0"), ("stale_after_ms", str(1000 * STALE_S))):
        lines = [f"{key} = {value}" if line.startswith(f"{key} =") else line for line in text.splitlines()]
        text = "\n".join(lines) + "\n"
        assert f"{key} = {value}\n" in text, f"wedge.toml has no {key}"
    path = tmp_path_factory.mktemp("scene") / "wedge.toml"
    path.write_text(text)
    return str(path)


class Daemon:
    """A running plicad, with a data folder beside its log unless it gets another one."""

    def __init__(self, plicad, scene, log, data=None, options=()):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
        self.log = log
        self.data = data or log.with_suffix(".data")
        with open(log, "w") as out:
            command = [plicad, "serve", scene, "--listen", self.endpoint, "--data", str(self.data), *options]
            self.process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT)

    def wait(self, session="main"):
        wait_until(lambda: self.answers(session), f"{self.endpoint} to answer", 60)

    def answers(self, session="main"):
        assert self.process.poll() is None, f"plicad ended:\n{self.log.read_text()}"
        try:
            with Client(self.endpoint, session) as client:
                return client.samples("status")
        except zenoh.ZError:
            return False

    def stop(self, how=signal.SIGINT):
        """Seconds that a clean stop took."""
        began = time.monotonic()
        self.process.send_signal(how)
        code = self.process.wait(timeout=30)
        assert code == 0, f"plicad ended with {code}:\n{self.log.read_text()}"
        return time.monotonic() - began

    def kill(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


@pytest.fixture
def daemon(plicad, scene, tmp_path):
    running = Daemon(plicad, scene, tmp_path / "plicad.log")
    try:
        running.wait()
        yield running
        if running.process.poll() is None:
            running.stop()
    finally:
        running.kill()


@pytest.fixture
def client(daemon):
    with Client(daemon.endpoint) as connected:
        yield connected
