"""Clients that break rules of the wire: the daemon notices, ends if it must, and says why."""

import json
import os
import shutil
import socket
import threading
import time

from client import Client, wait_until
from conftest import REPOSITORY, Daemon
from test_jobs import SCENE, running, submit, until

DEAF = 76
# Submissions and cancellations of the test of the disk; 1,500 by hand.
ROUNDS = int(os.environ.get("PLICA_ROUNDS", "100"))


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


def memory_kib(daemon):
    """Resident memory of the daemon."""
    with open(f"/proc/{daemon.process.pid}/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmRSS:"))


def unharmed(daemon, client, before_kib, most_kib=64 * 1024):
    """The daemon lives, answers, ticks, and has taken next to no memory."""
    assert daemon.process.poll() is None, daemon.log.read_text()
    tick = client.status()["tick"]
    wait_until(lambda: client.status()["tick"] > tick, "ticks to go on")
    grown = memory_kib(daemon) - before_kib
    assert grown < most_kib, f"memory grew by {grown} KiB"
    return grown


def test_no_file_of_the_machine_is_activated_by_its_path(daemon, client, tmp_path):
    with open(tmp_path / "sparse", "wb") as sparse:
        sparse.truncate(4 << 30)
    os.mkfifo(tmp_path / "pipe")
    before = memory_kib(daemon)
    for path in ("/proc/self/pagemap", "/proc/kmsg", "/dev/zero", str(tmp_path / "sparse"), str(tmp_path / "pipe"), "x"):
        error = client.refused("activate", {"database": path})
        assert error.code == "bad_database" and "--databases" in error.body["message"], error
    print(f"\nmemory grew by {unharmed(daemon, client, before)} KiB")


def test_a_scene_that_names_a_file_20000_times_costs_nothing(plicad, scene, tmp_path):
    folder = tmp_path / "served"
    folder.mkdir()
    shutil.copy(scene, folder / "wedge.toml")
    (folder / "mesh.obj").write_bytes(b"v 0 0 0\n" * (1 << 17))
    with running(plicad, str(folder / "wedge.toml"), tmp_path / "plicad.log") as daemon, Client(daemon.endpoint) as client:
        text = (folder / "wedge.toml").read_text()
        tool = lambda i: f'[tools.t{i}]\nshape = {{ mesh = {{ file = "mesh.obj" }} }}\n'
        nested = "[" + ".".join("a" * 70) + "]\nx = [" + "1," * 200_000 + "]\n"
        scenes = (
            ("".join(f'[a{i}]\nfile="mesh.obj"\n' for i in range(20000)), "scene.toml:"),
            (text + "".join(tool(i) for i in range(10000)), "10001 tools; the allowed range is 0 to 16"),
            (text + "".join(tool(i) for i in range(15)), "mesh.obj: there is no face"),
            (nested, "scene.toml:"),
        )
        # The parsed texts leave the heap larger, once; a second round of them does not.
        for most_kib in (128 * 1024, 64 * 1024):
            before = memory_kib(daemon)
            for scene_text, why in scenes:
                error = client.refused("job_submit", {"client_id": "x", "kind": "training", "scene": scene_text})
                assert error.code == "bad_scene" and why in error.body["message"], error
                assert str(tmp_path) not in error.body["message"], error
            print(f"\nmemory grew by {unharmed(daemon, client, before, most_kib)} KiB")
        assert client.rpc("job_list")["jobs"] == []


def test_words_of_a_file_beside_the_scene_do_not_come_back(plicad, tmp_path):
    folder = tmp_path / "served"
    folder.mkdir()
    (folder / "small.toml").write_text(SCENE)
    (folder / "secret.csv").write_text("time_s,tool,px,py,pz,qx,qy,qz,qw\nhunter2,probe,0,0,0,0,0,0,1\n")
    (folder / "tool.csv").write_text("time_s,tool,px,py,pz,qx,qy,qz,qw\n0,hunter2,0,0,0.1,0,0,0,1\n")
    with running(plicad, str(folder / "small.toml"), tmp_path / "plicad.log") as daemon, Client(daemon.endpoint) as client:
        for name, why in (("secret.csv", "secret.csv:2: "), ("tool.csv", "tool.csv: names a tool")):
            scene = SCENE.replace("training = { ", f'training = {{ recorded = {{ file = "{name}" }}, ')
            made = submit(client, name.split(".")[0], scene=scene)
            failed = until(client, made["id"], "failed")
            assert why in failed["reason"], failed
            assert "hunter2" not in failed["reason"] and str(tmp_path) not in failed["reason"], failed
            log = (daemon.data / "jobs" / made["id"] / "log.txt").read_text()
            assert "hunter2" in log, "the operator reads all of it"
        daemon.stop()


def test_submitting_and_cancelling_does_not_fill_the_disk(plicad, tmp_path):
    (tmp_path / "small.toml").write_text(SCENE)
    keep = ["--keep-jobs", "20", "--keep-bytes", "4MiB"]
    padded = SCENE + "#" * 500_000
    with running(plicad, str(tmp_path / "small.toml"), tmp_path / "plicad.log", options=keep) as daemon:
        with Client(daemon.endpoint) as client:
            most = 0
            folders = lambda: [f for f in (daemon.data / "jobs").iterdir() if not f.name.startswith(".")]
            for i in range(ROUNDS):
                made = submit(client, f"churn-{i}", scene=padded)
                client.rpc("job_cancel", {"id": made["id"]})
                most = max(most, len(folders()))
            kept = lambda: len(folders()) <= 8
            wait_until(kept, "old jobs to be removed")
            listed = client.rpc("job_list")
            assert listed["removed"] == ROUNDS - len(listed["jobs"]) > 0, listed["removed"]
            assert listed["jobs"][-1]["id"] == made["id"], "the newest stays"
            assert most < 40, most
            error = client.refused("job_get", {"id": "0001"})
            assert error.code == "unknown_job" and "--keep-jobs" in error.body["message"], error
            huge = SCENE + "#" * 1_000_000
            refused = [client.rpc("job_submit", {"client_id": f"q{i}", "kind": "training", "scene": huge}) for i in range(4)]
            error = client.refused("job_submit", {"client_id": "full", "kind": "training", "scene": huge})
            assert error.code == "too_many_jobs" and "at most 4194304 are kept" in error.body["message"], error
            for made in refused:
                client.rpc("job_cancel", {"id": made["id"]})
            print(f"\n{ROUNDS} rounds: at most {most} folders, {len(folders())} at the end")
        daemon.stop()
    assert "is removed: 20 jobs and 4194304 bytes are kept" in (tmp_path / "plicad.log").read_text()


def test_a_pipe_or_device_in_a_jobs_folder_does_not_keep_the_daemon_from_starting(plicad, tmp_path):
    (tmp_path / "small.toml").write_text(SCENE)
    jobs = tmp_path / "data" / "jobs"
    for i, name in enumerate(("job.json", "state.json", "progress.json"), 1):
        for j, make in enumerate((os.mkfifo, lambda path: os.symlink("/dev/zero", path))):
            folder = jobs / f"{10 * i + j:04}"
            folder.mkdir(parents=True)
            make(folder / name)
    log = tmp_path / "plicad.log"
    with running(plicad, str(tmp_path / "small.toml"), log, data=tmp_path / "data") as daemon:
        with Client(daemon.endpoint) as client:
            assert client.rpc("job_list")["jobs"] == []
        daemon.stop()
    assert "job.json is no regular file" in log.read_text() and "job.json is a link" in log.read_text()
