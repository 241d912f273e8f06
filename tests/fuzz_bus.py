#!/usr/bin/env python3
"""Malformed poses and requests by the million: each is refused and counted under its kind, and nothing changes.

Needs eclipse-zenoh and numpy; starts a daemon of its own:

    PLICAD=target/release/plicad target/python-venv/bin/python tests/fuzz_bus.py --poses 1000000 --requests 60000 --seed 1

The end-to-end tests run a small portion with a fixed seed (tests/python/test_fuzz.py).
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import random
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter

import zenoh

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "python"))
from client import POSE, Client, ErrorReply, wait_until  # noqa: E402

INSIDE = (0.06, 0.03, 0.02)
PRESSED = {"tool": "probe", "position": [0.06, 0.03, 0.028], "orientation": [0, 0, 0, 1]}
METHODS = ["reset", "pause", "resume", "step", "interrupt", "snapshot", "restore", "activate", "job_submit", "job_list", "job_get",
           "job_cancel", "job_resume", "job_fetch"]
UNKNOWN = ["", "Reset", "resets", "stop", "a" * 64, "job_", "step2"]
ODD = [float("nan"), float("inf"), float("-inf")]
FAR = [1000.1, -1e4, 1e154, 1e308, -1.7976931348623157e308]
CLIENTS = 4


def sound(sequence, position=INSIDE, orientation=(0.0, 0.0, 0.0, 1.0), grip=0.0):
    """A pose that lacks nothing but the valid flag, so that it is never taken."""
    return POSE.pack(b"PLPS", 1, 96, sequence, sequence, 7, 0, *position, *orientation, 0, grip)


def with_one(values, i, value):
    return tuple(value if k == i else v for k, v in enumerate(values))


def binary_pose(rng):
    """A malformed pose, and the kind under which the page counts it."""
    sequence = rng.getrandbits(64)
    draw = rng.randrange(10)
    if draw == 0:
        return sound(sequence)[:rng.randrange(96)], "too_short"
    if draw == 1:
        return sound(sequence) + rng.randbytes(rng.randrange(1, 900)), "bad_length"
    if draw == 2:
        return b"X" + rng.randbytes(rng.randrange(95, 1024)), "bad_magic"
    if draw == 3:
        bit, message = rng.randrange(64), bytearray(sound(sequence))
        message[bit // 8] ^= 1 << bit % 8
        return bytes(message), ["bad_magic", "bad_magic", "bad_version", "bad_length"][bit // 16]
    if draw == 4:
        i, odd = rng.randrange(8), rng.choice(ODD)
        if i == 7:
            return sound(sequence, grip=odd), "non_finite"
        numbers = with_one(INSIDE + (0.0, 0.0, 0.0, 1.0), i, odd)
        return sound(sequence, numbers[:3], numbers[3:]), "non_finite"
    if draw == 5:
        return sound(sequence, with_one(INSIDE, rng.randrange(3), rng.choice(FAR))), "out_of_range"
    if draw == 6:
        length = rng.choice([0.0, 5e-324, 1e-200, 0.5, 0.98, 1.02, 2.0, 1e154, 1e308])
        return sound(sequence, orientation=with_one((0.0,) * 4, rng.randrange(4), length)), "not_unit"
    if draw == 7:
        # Denormal and tiny numbers, unknown flags and buttons are no fault.
        message = bytearray(sound(sequence, (5e-324, -1e-310, 0.0), grip=rng.uniform(-9, 9)))
        struct.pack_into("<I", message, 28, rng.getrandbits(32) & ~1)
        struct.pack_into("<I", message, 88, rng.getrandbits(32))
        return bytes(message), "invalid"
    message = bytearray(sound(sequence))
    bit = rng.choice([b for b in range(64, 224)] + [b for b in range(225, 256)])
    message[bit // 8] ^= 1 << bit % 8
    return bytes(message), "invalid"


def json_pose(rng):
    """A malformed JSON pose, and its kind."""
    base = {"position": list(INSIDE), "orientation": [0, 0, 0, 1], "valid": False}
    changed = lambda **fields: json.dumps({**base, **fields}).encode()
    return rng.choice([
        (changed(), "invalid"),
        (changed(orientation=[0, 0, 0, 2]), "not_unit"),
        (changed(position=[0, 2e3, 0]), "out_of_range"),
        (changed(position=[0, 0]), "bad_json"),
        (changed(position=[float("nan"), 0, 0]), "bad_json"),
        (changed(sequence=rng.choice([-1, 1.5, 2**64, "1", None])), "bad_json"),
        (changed(**{rng.choice(["Position", "tool", "colour", ""]): 1}), "bad_json"),
        (b"\xef\xbb\xbf" + changed(), "bad_json"),
        (changed()[:-1] + b', "valid": false}', "bad_json"),
        (json.dumps([0, 0, 5, True, INSIDE, [0, 0, 0, 1], 0, 0]).encode(), "bad_json"),
        (b"[" * rng.randrange(1, 100_000), "bad_json"),
        (rng.randbytes(rng.randrange(200)) + b"\xff", "bad_json"),
        (changed()[:rng.randrange(len(changed()))], "bad_json"),
    ])


def request(rng):
    """A method and a payload that it refuses."""
    method = rng.choice(METHODS + UNKNOWN[1:])
    depth = rng.randrange(1, 100_000) if rng.random() < 0.02 else rng.randrange(1, 200)
    long = 3_000_000 if rng.random() < 0.0005 else rng.randrange(1, 2000)
    valid = {"step": {"ticks": 5}, "restore": {"id": "1"}, "activate": {"database": "0001"}}.get(method, {})
    return method, rng.choice([
        b"[]", b"[1]", b"[{}]", b"null", b"true", b"0", b"1e999", b'""', b" ", b"\0", b"{", b"}", b"{}{}", b"{} x",
        b"[" * depth, b'{"a":' * depth, b"[" * depth + b"]" * depth,
        rng.randbytes(rng.randrange(1, 300)) + b"\xff",
        json.dumps("x" * long).encode(),
        json.dumps({**valid, rng.choice(["now", "Ticks", "", "\ud800", "tick", "x" * long]): 1}).encode(),
        b'{"ticks": 1, "ticks": 1, "id": "1", "id": "1", "x": 1}',
        json.dumps({"ticks": rng.choice([-1, 1.5, 10_001, 2**32, 2**64, "1", None, [], {}]), "id": 7}).encode(),
        json.dumps([valid]).encode(),
        json.dumps({**valid, "poses": [["probe", 0, 0, 7, True, INSIDE, [0, 0, 0, 1], 0, 0]], "id": 1, "database": 1}).encode(),
        b"\xef\xbb\xbf" + json.dumps(valid).encode(),
    ])


def fuzz_poses(client, rng, n):
    """Publishes `n` malformed poses; the number of each kind."""
    counts = lambda: Counter(client.status()["tools"]["probe"]["poses_rejected"])
    before, expected = counts(), Counter()
    publisher = client.publisher(lossless=True)
    wait_until(lambda: publisher.matching_status.matching, "the daemon's subscription")
    for i in range(n):
        is_json = i % 16 == 0
        payload, kind = json_pose(rng) if is_json else binary_pose(rng)
        expected[kind] += 1
        publisher.put(payload, encoding=zenoh.Encoding.APPLICATION_JSON if is_json else zenoh.Encoding.ZENOH_BYTES)
    wait_until(lambda: (counts() - before).total() >= n, f"{n} poses to be counted", 120)
    counted = counts() - before
    assert counted == expected, f"counted {counted}, expected {expected}"
    return expected


def fuzz_requests(clients, rng, n):
    """Sends `n` requests that are to be refused; the number of each code."""
    status = lambda: Counter(clients[0].status()["rejected"])
    before, seeds = status(), [rng.getrandbits(64) for _ in clients]
    share = [n // len(clients) + (i < n % len(clients)) for i in range(len(clients))]
    with concurrent.futures.ThreadPoolExecutor() as pool:
        codes = sum(pool.map(refusals, clients, seeds, share), Counter())
    assert codes.total() == n, codes
    wait_until(lambda: status() - before == codes, f"{codes} to be counted; {status() - before} are")
    return codes


def refusals(client, seed, n):
    """Codes of `n` refused requests, each as the page has it."""
    rng, codes = random.Random(seed), Counter()
    for _ in range(n):
        method, payload = request(rng)
        (reply,) = client.samples(f"rpc/{method}", payload)
        assert isinstance(reply, ErrorReply), f"rpc/{method} {payload[:200]} was not refused"
        expected = {"rpc_malformed", "busy"} if method in METHODS else {"rpc_unknown", "busy"}
        assert reply.code in expected and reply.body["done"] == "no", f"rpc/{method} {payload[:200]}: {reply.body}"
        codes[reply.code] += 1
    return codes


def fuzz(client, endpoint, seed, n_poses, n_requests):
    """Both, on a paused simulation with a pressed tool; asserts that the state and its future keep their bytes."""
    rng = random.Random(seed)
    client.rpc("pause")
    client.rpc("reset")
    client.rpc("step", {"ticks": 50, "poses": [PRESSED]})
    kept = client.rpc("snapshot")["id"]
    present = lambda: (client.frame().tick, client.frame().positions.tobytes(), client.rpc("step", {"ticks": 0}))
    before = present()
    future = client.rpc("step", {"ticks": 200}), client.frame().positions.tobytes()
    client.rpc("restore", {"id": kept})
    began = time.monotonic()
    kinds = fuzz_poses(client, rng, n_poses)
    pose_s = time.monotonic() - began
    assert present() == before, "poses have changed the state"
    others = [Client(endpoint) for _ in range(CLIENTS)]
    began = time.monotonic()
    codes = fuzz_requests(others, rng, n_requests)
    request_s = time.monotonic() - began
    for other in others:
        other.close()
    assert present() == before, "requests have changed the state"
    assert (client.rpc("step", {"ticks": 200}), client.frame().positions.tobytes()) == future, "the next 200 ticks differ"
    tool = client.status()["tools"]["probe"]
    assert tool["poses_accepted"] == 1, tool
    print(f"\n{n_poses} malformed poses in {pose_s:.1f} s: {dict(kinds)}")
    print(f"{n_requests} refused requests in {request_s:.1f} s: {dict(codes)}")
    print("all counted, same state, same bytes 200 ticks later")


def rss_kb(process):
    lines = pathlib.Path(f"/proc/{process.pid}/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1])


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--poses", type=int, default=1_000_000)
    arguments.add_argument("--requests", type=int, default=60_000)
    arguments.add_argument("--seed", type=int, default=1)
    options = arguments.parse_args()
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    plicad = os.environ.get("PLICAD", "plicad")
    folder = pathlib.Path(tempfile.mkdtemp(prefix="fuzz_bus."))
    with open(folder / "plicad.log", "w") as log:
        command = [plicad, "serve", "--listen", endpoint, "--data", str(folder / "data")]
        process = subprocess.Popen(command, stdout=log, stderr=log)

    def connected():
        assert process.poll() is None, f"plicad ended; see {folder}/plicad.log"
        try:
            return Client(endpoint)
        except zenoh.ZError:
            return None

    try:
        with wait_until(connected, "the daemon", 60) as client:
            wait_until(lambda: client.samples("status"), "the daemon to answer", 60)
            before = rss_kb(process)
            fuzz(client, endpoint, options.seed, options.poses, options.requests)
            assert process.poll() is None, f"plicad ended; see {folder}/plicad.log"
            print(f"memory of the daemon: {before / 1000:.1f} MB before, {rss_kb(process) / 1000:.1f} MB after")
    finally:
        process.terminate()
        assert process.wait(timeout=30) == 0, f"see {folder}/plicad.log"
    shutil.rmtree(folder)


if __name__ == "__main__":
    main()
