"""Clients that break rules of the wire: the daemon notices, ends if it must, and says why."""

import json
import socket
import threading
import time

from client import Client, wait_until
from conftest import REPOSITORY, Daemon

DEAF = 76


class Proxy:
    """Passes bytes from a client to the daemon, with `old` replaced by `new` of the same length."""

    def __init__(self, endpoint, old, new):
        self.target = int(endpoint.rsplit(":", 1)[1])
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self.listener.getsockname()[1]}"
        self.old, self.new = old, new
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        client, _ = self.listener.accept()
        server = socket.create_connection(("127.0.0.1", self.target))
        threading.Thread(target=self.pump, args=(server, client, lambda b: b), daemon=True).start()
        self.pump(client, server, lambda b: b.replace(self.old, self.new))

    @staticmethod
    def pump(source, sink, change):
        try:
            while data := source.recv(65536):
                sink.sendall(change(data))
        except OSError:
            pass


def poison(endpoint):
    """Declares a key that no library lets through (a `*` that is no chunk), then asks a question that meets it.

    Zenoh 1.10.2 panics at it while it holds its routing tables, which end there for everybody.
    """
    proxy = Proxy(endpoint, b"QJ", b"*J")
    client = Client(proxy.endpoint)
    subscriber = client.session.declare_subscriber("plica/v1/main/status/QJ", lambda _: None)
    time.sleep(0.3)
    list(client.session.get("plica/v1/main/**", timeout=0.5))
    return client, subscriber


def ends_deaf(daemon):
    """Waits for a poisoned daemon to end; its log."""
    code = daemon.process.wait(timeout=10)
    log = daemon.log.read_text()
    assert code == DEAF, f"ended with {code}:\n{log}"
    assert "the bus is deaf" in log and "start plicad again" in log, log
    return log


def test_a_deaf_bus_ends_the_daemon_and_the_second_time_names_the_peers(plicad, scene, tmp_path, daemon):
    keep = [poison(daemon.endpoint)]
    assert "second time" not in ends_deaf(daemon)
    again = Daemon(plicad, scene, tmp_path / "again.log", data=daemon.data)
    again.wait()
    keep.append(poison(again.endpoint))
    log = ends_deaf(again)
    assert "the second time within a minute, with the same peers connected" in log, log
    assert "127.0.0.1" in log.split("same peers connected")[1], log


def test_a_second_daemon_of_the_same_session_gives_way(plicad, scene, tmp_path, daemon):
    config = (REPOSITORY / "configs" / "zenoh" / "default.json5").read_text()
    connected = config.replace("connect: { endpoints: [] }", f'connect: {{ endpoints: ["{daemon.endpoint}"] }}')
    assert connected != config
    file = tmp_path / "connected.json5"
    file.write_text(connected)
    second = Daemon(plicad, scene, tmp_path / "second.log", options=("--zenoh-config", str(file)))
    assert second.process.wait(timeout=60) == 1
    log = second.log.read_text()
    assert "another plicad answers for `plica/v1/main`" in log and "--session" in log, log
    other = Daemon(plicad, scene, tmp_path / "other.log", options=("--zenoh-config", str(file), "--session", "other"))
    other.wait(session="other")
    other.stop()
    with Client(daemon.endpoint) as client:
        assert client.ask("status"), "the first one serves on"


def test_a_daemon_notices_another_one_that_came_by_itself(daemon):
    with Client(daemon.endpoint) as client:
        answer = json.dumps({"scene": "forged", "uptime_s": 1e6}).encode()
        other = client.session.declare_queryable("plica/v1/main/status", lambda q: q.reply(q.key_expr, answer))
        own = lambda: [json.loads(r.payload.to_bytes()) for r in client.samples("status")]
        counted = lambda: any(status.get("rejected", {}).get("other_daemon") for status in own())
        wait_until(counted, "the other one to be counted", 10)
        other.undeclare()
    assert daemon.process.poll() is None, "whoever says so does not end a daemon that runs"
    assert "another plicad answers" in daemon.log.read_text()
