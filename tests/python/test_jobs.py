"""Jobs over the bus: what becomes of them, whatever happens to their process, their daemon or their disk.

The scene is small: an example takes a fraction of a second. No time is asserted.
"""

import contextlib
import hashlib
import json
import os
import random
import shutil
import signal
import struct
import subprocess
import threading
import time

import pytest

from client import Client, ErrorReply, Source, wait_until
from conftest import PROGRAMS, Daemon

LONG_S = 300
SCENE = """
[objects.wedge]
mesh = { generator = "block", size_m = [0.04, 0.04, 0.02] }
material = { young_modulus_pa = 3e4, poisson_ratio = 0.4, density_kg_per_m3 = 1000.0 }
supports = { fixed = { faces = ["z_min"] } }
coarse = { divisions = [4, 4, 2] }
accurate = { divisions = [10, 10, 5] }
skin = { spacing_m = 0.004 }
publish = { publish_hz = 1000.0 }
training = { examples = 24, seed = 11, candidates_per_example = 2 }

[tools.probe]
shape = { ball = { radius_m = 0.006 } }
friction = 0.5
stale_after_ms = 60000.0
"""
# Nobody waits for it.
SLOW = SCENE.replace("divisions = [10, 10, 5]", "divisions = [20, 20, 10]").replace("examples = 24", "examples = 400")


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "small.toml"
    path.write_text(SCENE)
    return str(path)


@contextlib.contextmanager
def running(plicad, scene, log, options=(), **others):
    """A daemon whose jobs get as much of a busy machine as anybody."""
    daemon = Daemon(plicad, scene, log, options=["--job-priority", "normal", *options], **others)
    try:
        daemon.wait()
        yield daemon
    finally:
        if daemon.process.poll() is None:
            daemon.process.kill()
        daemon.process.wait()


@pytest.fixture
def daemon(plicad, small, tmp_path):
    with running(plicad, small, tmp_path / "plicad.log") as daemon:
        yield daemon
        daemon.stop()


def submit(client, client_id, kind="training", **request):
    return client.rpc("job_submit", {"client_id": client_id, "kind": kind, **request})


def job(client, job_id):
    return client.rpc("job_get", {"id": job_id})


def until(client, job_id, state, timeout_s=LONG_S):
    """Waits for a state; another end is a failure with its reason."""

    def reached():
        now = job(client, job_id)
        assert now["state"] == state or now["state"] not in ("done", "failed", "cancelled"), now
        return now if now["state"] == state else None

    return wait_until(reached, f"job {job_id} to be {state}", timeout_s)


def some_examples(client, job_id, n=1):
    return wait_until(lambda: (now := job(client, job_id))["done"] >= n and now, f"{n} examples", LONG_S)


def process_of(daemon, job_id):
    """The process, as the job's folder tells; nothing once the job is done."""
    state = daemon.data / "jobs" / job_id / "state.json"
    read = lambda: json.loads(state.read_text())
    now = wait_until(lambda: (now := read()) and (now["pid"] or now["state"] == "done") and now, "its process", LONG_S)
    return now["pid"]


def is_alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rsplit(")", 1)[1].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


def fetch(client, job_id, what):
    """Piece by piece, as the protocol says."""
    whole, header = b"", None
    payload = json.dumps({"id": job_id, "what": what}).encode()
    while header is None or len(whole) < header["total_bytes"]:
        sample = client.ask(f"rpc/job_fetch?offset={len(whole)}", payload)
        piece, header = sample.payload.to_bytes(), json.loads(sample.attachment.to_bytes())
        assert header["offset"] == len(whole) and len(piece) <= 524288
        whole += piece
    assert hashlib.sha256(whole).hexdigest() == header["sha256"]
    return whole


def header_of(database):
    """Names, types and shapes of a safetensors file, and the metadata of Plica."""
    (n,) = struct.unpack_from("<Q", database)
    header = json.loads(database[8:8 + n])
    about = json.loads(header.pop("__metadata__")["plica"])["about"]
    assert max(t["data_offsets"][1] for t in header.values()) == len(database) - 8 - n
    return header, about


@pytest.fixture(scope="module")
def undisturbed(plicad, small, tmp_path_factory):
    """The database of a job that nothing happened to."""
    with running(plicad, small, tmp_path_factory.mktemp("undisturbed") / "plicad.log") as daemon:
        with Client(daemon.endpoint) as client:
            made = submit(client, "undisturbed", threads=1)
            until(client, made["id"], "done")
            return fetch(client, made["id"], "database")


class Motion:
    """Keeps the tool moving in the object, so that every tick makes a frame, and checks that every tick did."""

    def __init__(self, client):
        self.client, self.ended = client, threading.Event()
        self.thread = threading.Thread(target=self.move)

    def move(self):
        source, publisher = Source(), self.client.publisher()
        i = 0
        while not self.ended.wait(0.01):
            i += 1
            publisher.put(source.pose((0.02, 0.02, 0.0235 + 0.0002 * (i % 5))))

    def counts(self):
        status = self.client.status()
        return status["tick"], status["objects"]["wedge"]["frames_published"] + status["drops"]["frames"]

    def __enter__(self):
        self.client.rpc("pause")
        self.skins = self.client.collect("object/wedge/skin", lambda data: struct.unpack_from("<QQ", data, 8))
        self.thread.start()
        wait_until(lambda: self.client.status()["tools"]["probe"]["poses_accepted"] > 0, "a pose")
        time.sleep(0.5)  # the daemon learns that somebody listens
        self.before = self.counts()
        self.client.rpc("resume")
        wait_until(lambda: len(self.skins) > 10, "frames")
        return self

    def check_that_ticks_go_on(self):
        tick = self.client.status()["tick"]
        wait_until(lambda: self.client.status()["tick"] > tick + 100, "100 ticks")

    def __exit__(self, failed, *_):
        self.client.rpc("pause")
        self.ended.set()
        self.thread.join()
        time.sleep(0.5)  # the last frame is published
        if not failed:
            self.check_frames()
        self.client.rpc("resume")

    def check_frames(self):
        tick, frames = self.counts()
        assert tick - self.before[0] == frames - self.before[1] > 0, "a frame for each tick, published or dropped"
        ticks = [tick for _, tick in self.skins.messages()]
        assert ticks == sorted(set(ticks)), "frames arrive in order and once"


def test_a_job_from_submission_to_result(daemon, client):
    progress = client.collect("job_progress", json.loads)
    with Motion(client) as motion:
        made = submit(client, "first", examples=4, seed=5, threads=1)
        job_id = made["id"]
        assert made["created"] and made["state"] == "queued" and made["scene_name"] == "small"
        again = submit(client, "first", examples=4, seed=5, threads=1)
        assert again["id"] == job_id and not again["created"]
        motion.check_that_ticks_go_on()
        done = until(client, job_id, "done")
        motion.check_that_ticks_go_on()
    assert done["done"] + done["rejected"] == done["total"] == 4 and done["done"] > 0
    assert done["submitted_unix_s"] <= done["started_unix_s"] <= done["finished_unix_s"] and done["reason"] is None
    assert client.rpc("job_list") == {"jobs": [done], "older": 0, "removed": 0}
    status = client.status()
    assert status["jobs"] == [{key: done[key] for key in ("id", "state", "done", "rejected", "total")}]
    assert status["jobs_unavailable"] is None

    heard = wait_until(lambda: (all_of := progress.messages())[-1:] and all_of[-1]["state"] == "done" and all_of,
                       "the last progress")
    assert {message["id"] for message in heard} == {job_id}
    assert set(heard[0]) == {"id", "state", "reason", "stage", "done", "rejected", "total", "seconds_left"}
    finished = [message["done"] + message["rejected"] for message in heard]
    assert finished == sorted(finished), "progress never runs backwards"
    assert any(message["state"] == "running" for message in heard)

    database = fetch(client, job_id, "database")
    tensors, about = header_of(database)
    assert about["kind"] == "training" and about["seed"] == 5, about
    assert any(t["shape"] and t["shape"][0] == done["done"] for t in tensors.values()), tensors
    report = json.loads(fetch(client, job_id, "report"))
    assert report
    print(f"\n{len(heard)} progress messages; {len(database)} bytes in {len(tensors)} tensors: {sorted(tensors)}")


def test_an_evaluation_is_another_set(client):
    trained, held_out = submit(client, "training", examples=2), submit(client, "evaluation", "evaluation", examples=2)
    for made in (trained, held_out):
        until(client, made["id"], "done")
    (_, one), (_, other) = (header_of(fetch(client, made["id"], "database")) for made in (trained, held_out))
    assert (one["kind"], other["kind"]) == ("training", "evaluation")
    assert one["seed"] != other["seed"] and one["scene_hash"] == other["scene_hash"]


@pytest.mark.parametrize("threads", [1, 2])
def test_a_killed_process_is_a_failed_job_that_goes_on(daemon, client, undisturbed, threads):
    made = submit(client, "killed", threads=threads)
    with Motion(client) as motion:
        some_examples(client, made["id"])
        os.kill(process_of(daemon, made["id"]), signal.SIGKILL)
        failed = until(client, made["id"], "failed")
        motion.check_that_ticks_go_on()
    assert failed["reason"] == "killed by signal 9 (SIGKILL): out of memory, or by hand"
    assert client.refused("job_fetch", {"id": made["id"], "what": "database"}).code == "job_state"
    resumed = client.rpc("job_resume", {"id": made["id"]})
    assert resumed["state"] in ("queued", "running") and resumed["reason"] is None and resumed["done"] >= 1
    until(client, made["id"], "done")
    assert fetch(client, made["id"], "database") == undisturbed, "bit for bit"
    report = json.loads(fetch(client, made["id"], "report"))
    print(f"\nrun after the kill: {report.get('run')}")


@pytest.mark.parametrize("threads", [1, 2])
def test_ten_kills_change_no_bit(daemon, client, undisturbed, threads):
    moments = random.Random(threads)
    made = submit(client, "killed", threads=threads)
    kept = [0]
    over = lambda: (now := job(client, made["id"]))["state"] in ("failed", "done") and now
    while len(kept) <= 10:
        if (pid := process_of(daemon, made["id"])) is None:
            break
        if len(kept) % 2:  # every other time while it solves, else perhaps while it starts
            wait_until(lambda: job(client, made["id"])["done"] > kept[-1] or over(), "one more example", LONG_S)
        time.sleep(moments.uniform(0.0, 0.2))
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
        ended = wait_until(over, "its end", LONG_S)
        if ended["state"] == "failed":
            assert "signal 9" in ended["reason"], ended
            kept.append(ended["done"])
            client.rpc("job_resume", {"id": made["id"]})
    until(client, made["id"], "done")
    assert fetch(client, made["id"], "database") == undisturbed, "bit for bit"
    assert kept == sorted(kept) and kept[-1] > 0, "what is on disk stays there"
    print(f"\n{threads} thread(s), killed {len(kept) - 1} times; examples on disk after each: {kept[1:]}; the same bytes")


def test_a_cancelled_job_can_be_resumed(daemon, client, undisturbed):
    made, waiting = submit(client, "cancelled"), submit(client, "waiting", examples=1)
    some_examples(client, made["id"])
    pid = process_of(daemon, made["id"])
    assert client.rpc("job_cancel", {"id": made["id"]})["state"] == "cancelled"
    wait_until(lambda: not is_alive(pid), "the process to go")
    until(client, waiting["id"], "done")
    assert job(client, made["id"])["state"] == "cancelled"
    assert client.refused("job_cancel", {"id": made["id"]}).code == "job_state"
    client.rpc("job_resume", {"id": made["id"]})
    until(client, made["id"], "done")
    assert fetch(client, made["id"], "database") == undisturbed
    assert client.refused("job_resume", {"id": made["id"]}).code == "job_state"


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_a_job_outlives_its_daemon(plicad, small, tmp_path, undisturbed, how):
    data = tmp_path / "data"
    with running(plicad, small, tmp_path / "1.log", data=data) as daemon:
        with Client(daemon.endpoint) as client:
            made = submit(client, "long")
            some_examples(client, made["id"])
            pid = process_of(daemon, made["id"])
        if how == signal.SIGTERM:
            daemon.stop(how)
            state = json.loads((data / "jobs" / made["id"] / "state.json").read_text())
            assert (state["state"], state["reason"]) == ("paused", "the daemon was stopped"), state
        else:
            daemon.process.kill()
            daemon.process.wait()
        wait_until(lambda: not is_alive(pid), "the process to end with its daemon")
    with running(plicad, small, tmp_path / "2.log", data=data) as daemon, Client(daemon.endpoint) as client:
        assert job(client, made["id"])["done"] >= 1
        until(client, made["id"], "done")
        assert fetch(client, made["id"], "database") == undisturbed
        assert not submit(client, "long")["created"]
        daemon.stop()


def test_jobs_are_refused_for_a_reason(client):
    refusals = [
        ("job_submit", b"{client", "rpc_malformed"),
        ("job_submit", {}, "rpc_malformed"),
        ("job_submit", {"client_id": "a", "kind": "dreaming"}, "rpc_malformed"),
        ("job_submit", {"client_id": "../a", "kind": "training"}, "rpc_malformed"),
        ("job_submit", {"client_id": "a", "kind": "training", "examples": 0}, "rpc_malformed"),
        ("job_submit", {"client_id": "a", "kind": "training", "threads": 5000}, "rpc_malformed"),
        ("job_submit", {"client_id": "a", "kind": "training", "priority": 1}, "rpc_malformed"),
        ("job_submit", {"client_id": "a", "kind": "training", "scene": "#" * (1 << 20)}, "rpc_malformed"),
        ("job_submit", {"client_id": "a", "kind": "training", "scene": "[objects"}, "bad_scene"),
        ("job_submit", {"client_id": "a", "kind": "training", "scene": SCENE.replace("3e4", "-3e4")}, "bad_scene"),
        ("job_submit", {"client_id": "a", "kind": "training",
                        "scene": SCENE.replace("ball = { radius_m = 0.006 }",
                                               'mesh = { file = "/etc/passwd", metres_per_unit = 1 }')}, "bad_scene"),
        ("job_list", {"all": True}, "rpc_malformed"),
        ("job_get", {"id": 1}, "rpc_malformed"),
        *((method, {"id": bad}, "unknown_job") for method in ("job_get", "job_cancel", "job_resume")
          for bad in ("", "0001", "../0001", "0001/..", "/etc", ".", "..", "%2e%2e")),
        ("job_fetch", {"id": "0001", "what": "database"}, "unknown_job"),
        ("job_fetch", {"id": "0001", "what": "job.json"}, "rpc_malformed"),
    ]
    for method, request, code in refusals:
        error = client.refused(method, request)
        assert error.code == code and error.body["retryable"] is False, f"{method} {str(request)[:200]}: {error}"
        assert "/root" not in error.body["message"] and "passwd:" not in error.body["message"]
    error = client.refused("job_submit", {"client_id": "a", "kind": "training", "scene": SCENE.replace("3e4", "-3e4"),
                                          "scene_name": "mine"})
    assert error.body["message"].startswith("mine.toml:4: objects.wedge.material.young_modulus_pa: "), error
    for key in ("rpc/job_$*", "rpc/job_submit/**", "*/job_list"):
        replies = client.samples(key, b"{}")
        assert replies and all(isinstance(r, ErrorReply) and r.code == "rpc_wildcard" for r in replies), (key, replies)
    assert client.rpc("job_list") == {"jobs": [], "older": 0, "removed": 0}

    made = submit(client, "one", examples=1)
    assert client.refused("job_submit", {"client_id": "one", "kind": "training", "examples": 2}).code == "job_conflict"
    counted = client.status()["rejected"]
    assert counted["bad_scene"] == 4 and counted["job_conflict"] == 1 and counted["unknown_job"] == 25, counted
    until(client, made["id"], "done")
    assert client.refused("job_fetch?offset=99999999", {"id": made["id"], "what": "report"}).code == "bad_offset"


def test_what_shows_only_later_fails_the_job(client):
    buried = SCENE.replace("[tools.probe]", "[tools.probe]\nposition_scale = 1.0") + "\n"
    buried = buried.replace("candidates_per_example = 2 }",
                            "candidates_per_example = 2, contact_regions = [{ min_m = [5, 5, 5], max_m = [6, 6, 6] }] }")
    made = submit(client, "nowhere", scene=buried)
    failed = until(client, made["id"], "failed")
    assert failed["reason"].startswith("exit code ") and "region" in failed["reason"], failed
    print(f"\n{failed['reason']}")


def test_an_unwritable_data_folder_costs_the_jobs_and_nothing_else(plicad, small, tmp_path):
    (tmp_path / "file").write_text("in the way")
    log = tmp_path / "plicad.log"
    with running(plicad, small, log, data=tmp_path / "file" / "data") as daemon, Client(daemon.endpoint) as client:
        why = client.status()["jobs_unavailable"]
        assert "the data folder cannot be used: Not a directory" in why and "--data" in why, why
        assert str(tmp_path) not in why, "where the folder is stands in the log"
        for method, request in (("job_submit", {"client_id": "a", "kind": "training"}), ("job_list", {}),
                                ("job_get", {"id": "0001"})):
            error = client.refused(method, request)
            assert error.code == "jobs_unavailable" and why in error.body["message"], error
        tick = client.status()["tick"]
        wait_until(lambda: client.status()["tick"] > tick + 100, "100 ticks")
        daemon.stop()
    assert "no jobs: the data folder" in log.read_text()


def test_a_second_daemon_is_refused_the_data_folder(daemon, plicad, small):
    command = [plicad, "serve", small, "--listen", "tcp/127.0.0.1:0", "--data", str(daemon.data)]
    second = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert second.returncode != 0
    for part in (str(daemon.data), f"process {daemon.process.pid}", "session `main`", "--data", "stop that one"):
        assert part in second.stderr, f"{part} in {second.stderr}"
    with Client(daemon.endpoint) as client:
        assert client.rpc("job_list")["jobs"] == []


def test_a_full_disk_is_named_and_made_room_on(plicad, small, tmp_path, undisturbed):
    """The data folder is a disk of 3 MiB, in a name space of the daemon's own."""
    data = tmp_path / "disk"
    data.mkdir()
    script = tmp_path / "plicad"
    script.write_text(f'#!/bin/sh\nmount -t tmpfs -o size=3m tmpfs "{data}" && exec "{plicad}" "$@"\n')
    script.chmod(0o755)
    wrapper = tmp_path / "wrapper"
    wrapper.write_text(f'#!/bin/sh\nexec unshare --user --map-root-user --mount "{script}" "$@"\n')
    wrapper.chmod(0o755)
    probe = ["unshare", "--user", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "tmpfs", str(data)]
    if not shutil.which("unshare") or subprocess.run(probe, capture_output=True).returncode != 0:
        pytest.skip("this system lets nobody mount in a name space of his own")
    with running(str(wrapper), small, tmp_path / "plicad.log", data=data) as daemon, Client(daemon.endpoint) as client:
        filler = f"/proc/{daemon.process.pid}/root{data}/filler"
        made = submit(client, "full")
        with Motion(client) as motion:
            some_examples(client, made["id"])
            with contextlib.suppress(OSError), open(filler, "wb", buffering=0) as file:
                while file.write(b"\0" * 4096):
                    pass
            failed = until(client, made["id"], "failed")
            motion.check_that_ticks_go_on()
        assert "No space left on device" in failed["reason"] and "the disk is full: make room at" in failed["reason"], failed
        print(f"\n{failed['reason']}")
        refused = client.refused("job_submit", {"client_id": "another", "kind": "training"})
        assert refused.code == "jobs_unavailable" and "No space left on device" in refused.body["message"], refused
        assert (refused.body["retryable"], refused.body["done"]) == (True, "no"), "a full disk passes"
        os.remove(filler)
        client.rpc("job_resume", {"id": made["id"]})
        until(client, made["id"], "done")
        assert fetch(client, made["id"], "database") == undisturbed
        daemon.stop()


def plica(daemon, *arguments, **options):
    command = [str(PROGRAMS / "plica"), "jobs", *arguments, "--connect", daemon.endpoint, "--json"]
    return subprocess.run(command, capture_output=True, text=True, timeout=LONG_S, **options)


def test_the_command_does_it_all(daemon, client, small, tmp_path, undisturbed):
    submitted = plica(daemon, "submit", small, "--threads", "1", "--watch")
    assert submitted.returncode == 0, submitted.stderr
    done = json.loads(submitted.stdout.splitlines()[-1])
    assert done["state"] == "done" and done["done"] + done["rejected"] == 24, done
    out = tmp_path / "out.safetensors"
    fetched = plica(daemon, "fetch", done["id"], "--out", str(out))
    assert fetched.returncode == 0, fetched.stderr
    assert out.read_bytes() == undisturbed
    said = json.loads(fetched.stdout.splitlines()[-1])
    assert said["sha256"] == hashlib.sha256(undisturbed).hexdigest() and said["bytes"] == len(undisturbed)

    slow = tmp_path / "slow.toml"
    slow.write_text(SLOW)
    job_id = json.loads(plica(daemon, "submit", str(slow)).stdout)["id"]
    command = [str(PROGRAMS / "plica"), "jobs", "watch", job_id, "--connect", daemon.endpoint]
    watching = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert "is " in watching.stderr.readline()
    watching.send_signal(signal.SIGINT)
    _, notes = watching.communicate(timeout=60)
    assert watching.returncode == 130 and f"job {job_id} continues; `plica jobs watch" in notes, notes
    assert job(client, job_id)["state"] in ("queued", "running")
    assert json.loads(plica(daemon, "cancel", job_id).stdout)["state"] == "cancelled"
    watched = plica(daemon, "watch", job_id)
    assert watched.returncode == 1 and f"job {job_id} is cancelled" in watched.stderr, watched.stderr
    listed = json.loads(plica(daemon, "list").stdout)
    assert [(j["id"], j["state"]) for j in listed["jobs"]] == [(done["id"], "done"), (job_id, "cancelled")]
