"""Lock-step over the bus gives the bytes of `plicad simulate`, and knows no wall clock."""

import json
import pathlib
import struct
import subprocess
import time

import numpy as np
import pytest

from client import Client, ErrorReply, wait_until
from conftest import STALE_S, Daemon

HIGH = {"tool": "probe", "position": [0.06, 0.03, 0.08], "orientation": [0, 0, 0, 1]}


def read_safetensors(path):
    """Tensors by name: a length, a JSON header, then the numbers."""
    data = path.read_bytes()
    n = struct.unpack_from("<Q", data)[0]
    kinds = {"F32": "<f4", "F64": "<f8", "U64": "<u8", "I64": "<i8", "U32": "<u4", "U8": "u1", "BOOL": "u1"}
    tensors = {}
    for name, entry in json.loads(data[8:8 + n]).items():
        if name != "__metadata__":
            first, last = entry["data_offsets"]
            values = np.frombuffer(data[8 + n + first:8 + n + last], kinds[entry["dtype"]])
            tensors[name] = values.reshape(entry["shape"])
    return tensors


def trajectory():
    """Pose per tick at 250 Hz: press, drag, turn, lift. Times are those of ticks."""
    for i in range(200):
        share = i / 200
        depth = 0.004 * np.sin(np.pi * share)
        angle = 0.1 * share
        position = [0.05 + 0.01 * share, 0.03 + 0.001 * np.sin(9 * share), 0.0275 + 0.007 + 0.001 - depth]
        yield 4 * i, position, [0.0, float(np.sin(angle / 2)), 0.0, float(np.cos(angle / 2))]


def test_lock_step_gives_the_bytes_of_simulate(client, plicad, scene, tmp_path):
    poses = list(trajectory())
    csv, out = tmp_path / "poses.csv", tmp_path / "run.safetensors"
    with csv.open("w") as file:
        file.write("time_s,tool,px,py,pz,qx,qy,qz,qw\n")
        for tick, position, orientation in poses:
            numbers = ",".join(repr(float(x)) for x in position + orientation)
            file.write(f"{tick / 1000!r},probe,{numbers}\n")
    command = [plicad, "simulate", scene, "--poses", str(csv), "--out", str(out), "--every", "1"]
    subprocess.run(command, check=True, timeout=300)
    simulated = read_safetensors(out)
    frame_of_tick = {int(tick): i for i, tick in enumerate(simulated["tick"])}

    client.rpc("pause")
    client.rpc("reset")
    compared = 0
    for tick, position, orientation in poses:
        pose = {"tool": "probe", "position": position, "orientation": orientation, "source_time_ns": tick * 1_000_000}
        assert client.rpc("step", {"ticks": 0, "poses": []})["tick"] == tick
        now = client.rpc("step", {"ticks": 4, "poses": [pose]})["tick"]
        if now % 20 == 0 and now in frame_of_tick:
            frame = client.frame()
            assert frame.tick == now
            expected = simulated["positions"][frame_of_tick[now]]
            assert frame.positions.tobytes() == expected.tobytes(), f"tick {now} differs"
            compared += 1
    wait_until(lambda: client.status()["tick"] == 800, "the status to follow")
    peak = np.linalg.norm(simulated["force"], axis=-1).max()
    print(f"\n{compared} frames of {frame.positions.shape[0]} vertices are equal byte by byte; peak force {peak:.2f} N")
    assert compared >= 30 and peak > 0.1


STALE_TICKS = 100


@pytest.fixture
def impatient(plicad, scene, tmp_path):
    """A client of a daemon in lock-step, whose tool is stale after a tenth of a second."""
    text = pathlib.Path(scene).read_text().replace(f"stale_after_ms = {1000 * STALE_S}", f"stale_after_ms = {STALE_TICKS}.0")
    file = tmp_path / "impatient.toml"
    file.write_text(text)
    running = Daemon(plicad, str(file), tmp_path / "plicad.log", options=("--lock-step",))
    try:
        running.wait()
        with Client(running.endpoint) as connected:
            assert connected.status()["tools"]["probe"]["stale_after_ms"] == STALE_TICKS
            yield connected
        running.stop()
    finally:
        running.kill()


def one(ticks, **pose):
    return {"ticks": ticks, "poses": [{**HIGH, **pose}]}


# Requests, and the code that each is answered with; none is a reply.
CONVERSATION = [
    ("reset", {}, None),
    ("step", one(1, source_id=3, sequence=10), None),
    ("step", one(1, source_id=4, sequence=1), "bad_pose"),
    ("step", one(1, source_id=3, sequence=5), "bad_pose"),
    ("step", one(0, source_id=3, sequence=11), None),
    ("step", one(0, source_id=4, sequence=1), "bad_pose"),
    ("step", {"ticks": STALE_TICKS}, None),
    # Taken at tick 1, and now is tick 101: just fresh.
    ("step", one(1, source_id=4, sequence=1), "bad_pose"),
    ("step", {"ticks": 1}, None),
    ("step", one(1, source_id=4, sequence=1), None),
    ("step", one(1, source_id=3, sequence=12), "bad_pose"),
    ("snapshot", {}, None),
    ("restore", {"id": "NEWEST"}, None),
    ("step", one(1, source_id=3, sequence=12), None),
    ("step", {"ticks": 1000}, None),
    ("step", one(1, source_id=9, sequence=1), None),
]


def converse(client, pause_s):
    answers, newest = [], None
    for method, request, code in CONVERSATION:
        time.sleep(pause_s)
        request = {"id": newest} if method == "restore" else request
        try:
            reply = client.rpc(method, request)
            assert code is None, f"{method} {request} was not refused with {code}: {reply}"
            newest = reply.pop("id", newest)
            answers.append(reply)
        except ErrorReply as error:
            assert error.code == code, f"{method} {request}: {error}"
            answers.append(error.body)
    return answers, client.frame().positions.tobytes()


def test_the_same_requests_give_the_same_answers_however_fast_they_come(impatient):
    back_to_back = converse(impatient, 0)
    assert converse(impatient, 1.5e-3 * STALE_TICKS) == back_to_back
    assert converse(impatient, 0) == back_to_back


def test_poses_of_a_step_without_ticks_wait_for_the_next_tick(impatient):
    impatient.rpc("step", one(0, sequence=7, source_id=1))
    assert impatient.status()["tools"]["probe"]["pose_age_s"] is None
    impatient.rpc("step", {"ticks": 1})
    wait_until(lambda: impatient.status()["tools"]["probe"]["pose_sequence"] == 7, "the pose to be used")
    # 256 fit into the queue: all of a request, or none.
    many = lambda n: {"ticks": 0, "poses": [{**HIGH, "source_id": 1}] * n}
    impatient.rpc("step", many(200))
    refused = impatient.refused("step", many(57))
    assert refused.code == "bad_pose" and "queue_full" in refused.body["message"]
    impatient.rpc("step", many(56))
