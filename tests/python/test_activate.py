"""Examples that a job has made enrich the skin: from activation on, without a lost frame, and only where they belong."""

import hashlib
import json
import os
import struct
import subprocess

import numpy as np
import pytest

from client import ENRICHED, Client, read_frame, read_wrench, wait_until
from test_jobs import SCENE, Motion, job, running, submit, until
from test_lockstep import read_safetensors

OTHER = SCENE.replace("young_modulus_pa = 3e4", "young_modulus_pa = 2e4")
PRESSED = {"tool": "probe", "position": [0.021, 0.02, 0.0235], "orientation": [0, 0, 0, 1]}


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "small.toml"
    path.write_text(SCENE)
    return str(path)


@pytest.fixture(scope="module")
def daemon(plicad, small, tmp_path_factory):
    place = tmp_path_factory.mktemp("daemon")
    (place / "databases").mkdir()
    options = ["--databases", str(place / "databases")]
    with running(plicad, small, place / "plicad.log", options=options) as daemon:
        daemon.databases = place / "databases"
        yield daemon


@pytest.fixture
def client(daemon):
    with Client(daemon.endpoint) as connected:
        yield connected


def made(client, name, kind="training", **request):
    """Id of a job that is done."""
    return until(client, submit(client, name, kind, **request)["id"], "done")["id"]


@pytest.fixture(scope="module")
def database(daemon):
    with Client(daemon.endpoint) as client:
        return made(client, "examples", examples=16, seed=3)


def pressed(client):
    """The frame of a press that is the same each time."""
    client.rpc("pause")
    client.rpc("reset")
    client.rpc("step", {"ticks": 400, "poses": [PRESSED]})
    return client.frame()


def test_activating_loses_no_frame_and_changes_the_skin(daemon, client, database):
    before = client.status()["objects"]["wedge"]
    generation = pressed(client).generation
    coarse = pressed(client)
    assert (before["enriched"], before["confidence"], generation, coarse.flags & ENRICHED) == (False, None, 0, 0)
    client.rpc("resume")
    skins = client.collect("object/wedge/skin", read_frame)
    wrenches = client.collect("tool/probe/wrench", read_wrench)
    with Motion(client) as motion:  # at its end: a frame for each tick
        reply = client.rpc("activate", {"database": database})
        motion.check_that_ticks_go_on()
    assert reply["database_generation"] == 1 and 8 <= reply["examples"] <= 16, reply
    frames = skins.messages()
    assert [f.generation for f in frames] == sorted(f.generation for f in frames)
    assert {f.generation for f in frames} == {0, 1}
    # Ticks count from reset on, and nothing was reset in between.
    assert all((f.tick > reply["tick"]) == (f.generation == 1) for f in frames), reply
    assert all(f.confidence == 0 and not f.flags & ENRICHED for f in frames if f.generation == 0)
    assert any(f.confidence > 0 and f.flags & ENRICHED for f in frames)
    assert any(w.confidence > 0 for w in wrenches.messages())

    enriched = pressed(client)
    off = np.linalg.norm(enriched.positions - coarse.positions, axis=1)
    assert enriched.tick == coarse.tick and enriched.generation == 1 and enriched.confidence > 0
    assert 1e-5 < off.max() < 5e-3, f"detail of up to {off.max()} m"
    after = wait_until(lambda: (now := client.status()["objects"]["wedge"])["confidence"] and now, "confidence")
    assert after["enriched"] and 0 < after["confidence"] <= 1, after
    assert np.array_equal(pressed(client).positions, enriched.positions), "the same poses, the same bytes"
    print(f"\n{len(frames)} frames over the change; detail of up to {1e3 * off.max():.3f} mm, "
          f"confidence {enriched.confidence:.2f}")
    client.rpc("resume")


def test_activating_again_is_another_generation(daemon, client, database):
    one = client.rpc("activate", {"database": database})["database_generation"]
    path = daemon.data / "jobs" / database / "database.safetensors"
    (daemon.databases / "mine.safetensors").write_bytes(path.read_bytes())
    (daemon.databases / "link").symlink_to("mine.safetensors")
    for generation, name in ((one + 1, "mine.safetensors"), (one + 2, "link")):
        other = client.rpc("activate", {"database": name})["database_generation"]
        assert other == generation == client.frame().generation


def test_what_does_not_belong_is_refused_for_its_reason(daemon, client, database, tmp_path):
    foreign = made(client, "foreign", examples=2, scene=OTHER)
    held_out = made(client, "held-out", "evaluation", examples=2)
    path = daemon.data / "jobs" / database / "database.safetensors"
    damaged, cut, empty = (daemon.databases / name for name in ("damaged", "cut", "empty"))
    (daemon.databases / "folder").mkdir()
    os.mkfifo(daemon.databases / "pipe")
    (daemon.databases / "out").symlink_to(path)
    (daemon.databases / "device").symlink_to("/dev/zero")
    with open(daemon.databases / "sparse", "wb") as sparse:
        sparse.truncate(4 << 30)
    whole = path.read_bytes()
    damaged.write_bytes(whole[:-5] + bytes([whole[-5] ^ 1]) + whole[-4:])
    cut.write_bytes(whole[:len(whole) // 2])
    empty.write_bytes(b"")
    slow = submit(client, "slow", examples=400)["id"]
    generation = client.frame().generation
    refusals = [
        ({"database": foreign}, "bad_database", "another scene"),
        ({"database": held_out}, "bad_database", "held-out"),
        ({"database": "damaged"}, "bad_database", "damaged: damaged: SHA-256"),
        ({"database": "cut"}, "bad_database", "cut: truncated"),
        ({"database": "empty"}, "bad_database", "empty: truncated"),
        ({"database": "folder"}, "bad_database", "folder: is no regular file"),
        ({"database": "pipe"}, "bad_database", "pipe: is no regular file"),
        ({"database": "out"}, "bad_database", "out: is a link that leads out"),
        ({"database": "device"}, "bad_database", "device: is a link that leads out"),
        ({"database": "sparse"}, "bad_database", "sparse: has 4294967296 bytes; at most"),
        ({"database": "none"}, "bad_database", "none: cannot be read: No such file"),
        *(({"database": bad}, "bad_database", "is no name of a file") for bad in
          ("", ".", "..", "/", "/dev/zero", "/proc/self/pagemap", "/proc/kmsg", "no/such", "../databases/cut", "./cut",
           "cut/", "a\\b", "a\0b", str(path))),
        ({"database": slow}, "job_state", "when it is done"),
        ({"database": "9999"}, "unknown_job", "9999"),
        ({}, "rpc_malformed", "database"),
        ({"database": database, "now": True}, "rpc_malformed", "now"),
    ]
    for request, code, reason in refusals:
        error = client.refused("activate", request)
        assert error.code == code and reason in error.body["message"], f"{request}: {error}"
        assert str(daemon.data) not in error.body["message"] or request["database"] == str(path)
        assert str(daemon.databases) not in error.body["message"], "where databases lie is nobody's business"
    client.rpc("job_cancel", {"id": slow})
    assert job(client, slow)["state"] == "cancelled"
    assert client.frame().generation == generation
    print("\n" + client.refused("activate", {"database": foreign}).body["message"])


def with_numbers(whole, name, change):
    """A database with one tensor changed by `change` (array to array), and the checksum made right."""
    (n,) = struct.unpack_from("<Q", whole)
    header = json.loads(whole[8:8 + n])
    body = bytearray(whole[8 + n:])
    tensors = {key: value for key, value in header.items() if key != "__metadata__"}
    first, last = tensors[name]["data_offsets"]
    kind = {"F32": "<f4", "F64": "<f8"}[tensors[name]["dtype"]]
    array = np.frombuffer(bytes(body[first:last]), kind).reshape(tensors[name]["shape"])
    body[first:last] = change(array.copy()).astype(kind).tobytes()
    about = header["__metadata__"]["plica"]
    old = json.loads(about)["sha256"]
    total = hashlib.sha256(about.replace(old, "0" * 64).encode())
    for key in sorted(tensors):
        tensor = tensors[key]
        total.update(f"{key} {tensor['dtype']} [{','.join(map(str, tensor['shape']))}]\n".encode())
        total.update(bytes(body[slice(*tensor["data_offsets"])]))
    text = whole[8:8 + n].replace(old.encode(), total.hexdigest().encode())
    return whole[:8] + text + bytes(body)


def test_numbers_that_the_object_cannot_have_are_refused(daemon, client, database):
    whole = (daemon.data / "jobs" / database / "database.safetensors").read_bytes()
    same = with_numbers(whole, "d", lambda d: d)
    assert same == whole, "the checksum of this test is that of the page"
    fill = lambda value: lambda array: np.full_like(array, value)
    absurd = [
        ("d", fill(1e30), "d[0] is 1.732e30 m long"),
        ("d", fill(3e38), "d[0] is "),
        ("d", fill(1.0), "d[0] is 1.732e0 m long; at most the object's diagonal of 0.0600 m"),
        ("d", fill(np.nan), "not finite"),
        ("u", fill(0.1), "u[0] is "),
        ("contact_frame", fill(0.0), "is not orthonormal"),
        ("contact_frame", fill(1e300), "is not orthonormal"),
        ("contact_frame", lambda frame: 1.00001 * frame, "is not orthonormal"),
        ("contact_point", fill(1.0), "lies off the object"),
        ("tool_pose", fill(1e9), "tool_pose"),
    ]
    generation = client.frame().generation
    for name, change, why in absurd:
        (daemon.databases / "absurd").write_bytes(with_numbers(whole, name, change))
        error = client.refused("activate", {"database": "absurd"})
        assert error.code == "bad_database" and why in error.body["message"], error
        assert "example " in error.body["message"], error
    assert client.frame().generation == generation


def test_simulate_gives_the_enriched_bytes_of_the_daemon(daemon, plicad, small, client, database, tmp_path):
    path = daemon.data / "jobs" / database / "database.safetensors"
    csv, out = tmp_path / "poses.csv", tmp_path / "run.safetensors"
    place = ",".join(repr(float(x)) for x in PRESSED["position"] + PRESSED["orientation"])
    csv.write_text("time_s,tool,px,py,pz,qx,qy,qz,qw\n" + "".join(f"{t},probe,{place}\n" for t in (0.0, 0.399)))
    command = [plicad, "simulate", small, "--poses", str(csv), "--out", str(out), "--database", str(path)]
    subprocess.run(command, check=True, timeout=60)
    simulated = read_safetensors(out)
    client.rpc("activate", {"database": database})
    frame = pressed(client)
    assert simulated["tick"][-1] == frame.tick == 400
    assert np.array_equal(simulated["positions"][-1], frame.positions)
    assert simulated["confidence"][-1] == np.float32(frame.confidence) > 0
    client.rpc("resume")


def test_a_daemon_starts_with_a_database(daemon, plicad, small, client, database, tmp_path):
    path = daemon.data / "jobs" / database / "database.safetensors"
    beside = tmp_path / "named.toml"
    beside.write_text(SCENE + '[objects.wedge.enrichment]\ndatabase = "mine.safetensors"\n')
    (tmp_path / "mine.safetensors").write_bytes(path.read_bytes())
    client.rpc("activate", {"database": database})
    expected = pressed(client)
    for scene, options in ((small, ["--database", str(path)]), (str(beside), [])):
        log = tmp_path / "plicad.log"
        with running(plicad, scene, log, options=options) as started, Client(started.endpoint) as other:
            frame = pressed(other)
            assert frame.generation == 1 and np.array_equal(frame.positions, expected.positions)
            started.stop()
    client.rpc("resume")
    refused = subprocess.run([plicad, "serve", str(beside), "--listen", "tcp/127.0.0.1:0", "--database", "no/such"],
                             capture_output=True, text=True, timeout=60)
    assert refused.returncode == 1 and "no/such: cannot be read" in refused.stderr, refused.stderr
