"""Starting and stopping: the liveliness token, a taken port, clean stops, clients that freeze or crash."""

import os
import signal
import socket
import subprocess
import sys
import time

import pytest

from client import Client, Source, read_wrench, wait_until
from conftest import Daemon


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_clean_stop_takes_less_than_three_seconds(daemon, how):
    with Client(daemon.endpoint) as client:
        wrenches = client.collect("tool/probe/wrench", read_wrench)
        client.publisher().put(Source().pose((0.06, 0.03, 0.08)))
        wait_until(lambda: len(wrenches) > 10, "wrenches")
        assert daemon.stop(how) < 3.0


def test_the_liveliness_token_is_there(client):
    # The daemon declares it last, when it already answers.
    ask = lambda: any(reply.ok for reply in client.session.liveliness().get(f"{client.root}/alive", timeout=5.0))
    wait_until(ask, "the token")


def test_a_taken_port_is_named(daemon, plicad, scene, tmp_path):
    command = [plicad, "serve", scene, "--listen", daemon.endpoint, "--data", str(tmp_path / "other")]
    second = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert second.returncode != 0
    port = daemon.endpoint.rsplit(":", 1)[1]
    assert port in second.stderr and "--listen" in second.stderr, second.stderr
    assert str(daemon.process.pid) in second.stderr, "the message names the owner of the port"


FROZEN = """
import sys, time
sys.path.insert(0, {folder!r})
from client import Client
client = Client({endpoint!r})
skins = client.collect("object/wedge/skin", lambda data: data)
while len(skins) < 10:
    time.sleep(0.01)
print("ready", flush=True)
time.sleep(600)
"""


def test_a_frozen_subscriber_delays_no_tick(daemon, client):
    code = FROZEN.format(folder=os.path.dirname(__file__), endpoint=daemon.endpoint)
    frozen = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    try:
        source, publisher = Source(), client.publisher()
        wake = lambda i: publisher.put(source.pose((0.06, 0.03, 0.03 + 0.002 * (i % 2))))
        deadline = time.monotonic() + 30
        os.set_blocking(frozen.stdout.fileno(), False)
        i = 0
        while frozen.stdout.read() is None:
            assert time.monotonic() < deadline, "the subscriber never heard a frame"
            wake(i := i + 1)
            time.sleep(0.02)
        frozen.send_signal(signal.SIGSTOP)
        skipped, tick, began = client.status()["skipped_ticks"], client.status()["tick"], time.monotonic()
        while time.monotonic() < began + 3:
            wake(i := i + 1)
            time.sleep(0.02)
        status, elapsed = client.status(), time.monotonic() - began
        advanced = status["tick"] - tick + status["skipped_ticks"] - skipped
        print(f"\n{advanced} ticks, {status['skipped_ticks'] - skipped} of them skipped, in {elapsed:.2f} s beside a frozen subscriber")
        # A wait for the subscriber would show as seconds without a tick: one put can block for five of them.
        assert advanced > 0.8 * 1000 * elapsed
    finally:
        frozen.kill()
        frozen.wait()
    assert daemon.stop() < 3.0


def test_a_second_daemon_on_another_port_is_another_one(daemon, plicad, scene, tmp_path):
    other = Daemon(plicad, scene, tmp_path / "other.log")
    try:
        other.wait()
        with Client(daemon.endpoint) as here, Client(other.endpoint) as there:
            here.rpc("pause")
            assert here.status()["paused"] and not there.status()["paused"]
        other.stop()
    finally:
        if other.process.poll() is None:
            other.process.kill()


def test_a_service_manager_is_told_of_start_life_and_stop(plicad, scene, tmp_path, monkeypatch):
    told = []
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(30)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "400000")
        running = Daemon(plicad, scene, tmp_path / "plicad.log")
        while told.count("WATCHDOG=1") < 3:
            told += manager.recv(4096).decode().splitlines()
        assert told[0] == "READY=1", told
        running.stop()
        while "STOPPING=1" not in told:
            told += manager.recv(4096).decode().splitlines()
