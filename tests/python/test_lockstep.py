"""Lock-step over the bus gives the bytes of `plicad simulate`."""

import json
import struct
import subprocess

import numpy as np

from client import wait_until

TICK_S = 1e-3


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
