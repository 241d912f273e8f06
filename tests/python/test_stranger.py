"""A stranger's client: it reads layouts, kinds, codes and limits from the tables of PROTOCOL.md, and holds the daemon to them."""

import hashlib
import json
import re
import struct
import time

import numpy as np
import pytest
import zenoh

from client import wait_until
from conftest import REPOSITORY

PAGE = (REPOSITORY / "protocol" / "PROTOCOL.md").read_text()
ROOT = "plica/v1/main"
SIZES = {"u8": ("B", 1), "u16": ("H", 2), "u32": ("I", 4), "u64": ("Q", 8), "f32": ("f", 4), "f64": ("d", 8)}
HIGH, PRESSED = (0.06, 0.03, 0.08), (0.06, 0.03, 0.029)


def section(title):
    return PAGE.split(title, 1)[1].split("\n## ", 1)[0]


def rows(text):
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]


def layout(title, n_bytes):
    """Names, and a `struct` format, of the first table of a section; the table has neither gap nor overlap."""
    names, codes, end = [], "<", 0
    for offset, kind, name, *_ in [row for row in rows(section(title)) if len(row) == 4]:
        match = re.fullmatch(r"`(\w+)(?:\[(\d+)\])?`", kind)
        if not (offset.isdigit() and match) or end == n_bytes:
            continue
        code, size = SIZES[match[1]]
        count = int(match[2] or 1)
        assert int(offset) == end, f"{name} starts at {offset}, the field before it ends at {end}"
        names.append((name, count))
        codes, end = codes + (f"{count}s" if code == "B" else f"{count}{code}"), end + size * count
    assert end == n_bytes == struct.calcsize(codes), f"{title}: {end} bytes"
    return names, codes


class Layout:
    def __init__(self, title, n_bytes):
        self.names, self.format = layout(title, n_bytes)

    def pack(self, **fields):
        values = []
        for name, count in self.names:
            value = fields.get(name, [0] * count if count > 1 else 0)
            values += [value] if isinstance(value, bytes) or count == 1 else list(value)
        return struct.pack(self.format, *values)

    def read(self, data):
        values, fields = list(struct.unpack_from(self.format, data)), {}
        for name, count in self.names:
            take = 1 if name == "magic" else count
            fields[name], values = (values[0] if take == 1 else np.array(values[:take])), values[take:]
        return fields


class Stranger:
    def __init__(self, endpoint):
        config = zenoh.Config()
        for key, value in (("mode", '"client"'), ("connect/endpoints", json.dumps([endpoint])),
                           ("scouting/multicast/enabled", "false"), ("scouting/gossip/enabled", "false")):
            config.insert_json5(key, value)
        self.session = zenoh.open(config)
        self.codes = {code: retryable for code, retryable in codes_of_the_page()}
        self.held = 0

    def holds(self, condition, what):
        assert condition, what
        self.held += 1

    def ask(self, key, payload=None, timeout=20.0):
        return list(self.session.get(f"{ROOT}/{key}", payload=payload, timeout=timeout))

    def call(self, method, request):
        payload = request if isinstance(request, bytes) else json.dumps(request).encode()
        (reply,) = self.ask(f"rpc/{method}", payload)
        return json.loads((reply.ok or reply.err).payload.to_bytes())

    def refused(self, method, request, code):
        error = self.call(method, request)
        self.holds(error.get("code") == code, f"{method} {str(request)[:200]}: {error}, expected {code}")
        self.holds(error["retryable"] is self.codes[code] and error["done"] == "no", error)
        return error

    def status(self):
        return json.loads(self.ask("status")[0].ok.payload.to_bytes())


def codes_of_the_page():
    for first, retryable, *_ in rows(section("## 6. Methods")):
        for code in re.findall(r"`(\w+)`", first):
            if retryable.startswith(("no", "yes")):
                yield code, retryable.startswith("yes")


@pytest.fixture
def stranger(daemon):
    client = Stranger(daemon.endpoint)
    yield client
    client.session.close()


def pose_layout():
    return Layout("## 3. Pose", 96)


def step(ticks, position=HIGH, **fields):
    return {"ticks": ticks, "poses": [{"tool": "probe", "position": position, "orientation": [0, 0, 0, 1], **fields}]}


def test_lock_step_errors_and_limits_are_those_of_the_page(stranger):
    s, call = stranger, stranger.call
    s.holds(call("pause", {})["paused"] is True, "pause")
    s.holds(call("reset", b"") == {"tick": 0, "sim_time_s": 0.0, "paused": True}, "an empty payload is {}")
    call("step", step(1, source_id=3, sequence=10))
    s.refused("step", step(1, source_id=4, sequence=1), "bad_pose")
    s.refused("step", step(1, source_id=3, sequence=5), "bad_pose")
    stale_ms = s.status()["tools"]["probe"]["stale_after_ms"]
    call("step", {"ticks": round(stale_ms) + 1})
    s.holds("tick" in call("step", step(1, source_id=4, sequence=1)), "a stale tool is taken over")
    first = call("snapshot", {})["id"]
    for body in (b"[]", b"[1]", b"null", b"1", b'"x"', b'{"now": 1}', b"{"):
        for method in ("reset", "pause", "resume", "interrupt", "step", "snapshot", "restore", "activate", "job_list"):
            s.refused(method, body, "rpc_malformed")
    for other in ("+" + first, "0" + first, "x"):
        s.refused("restore", {"id": other}, "unknown_snapshot")
    s.refused("step", {"ticks": 10001}, "rpc_malformed")
    s.refused("step", {"ticks": 1, "poses": step(1)["poses"] * 1025}, "rpc_malformed")
    s.holds("tick" in call("step", {"ticks": 1, "poses": step(1, source_id=4)["poses"] * 1024}), "1,024 poses")
    for _ in range(8):
        newest = call("snapshot", {})["id"]
    s.refused("restore", {"id": first}, "unknown_snapshot")
    s.holds("tick" in call("restore", {"id": newest}), "the newest eight are kept")
    s.refused("job_get", {"id": "0001"}, "unknown_job")
    s.refused("explode", {}, "rpc_unknown")
    s.refused("step", step(1, tool="knife"), "unknown_tool")
    tick = call("step", {"ticks": 0})["tick"]
    s.holds(s.refused("step", {"ticks": 1, "from_tick": tick + 1}, "wrong_tick")["tick"] == tick, "wrong_tick tells the tick")
    s.holds(call("step", {"ticks": 1, "from_tick": tick})["tick"] == tick + 1, "from_tick")
    s.holds(call("interrupt", {})["tick"] == tick + 1, "nothing to interrupt")
    too_long = s.ask("rpc/reset", b" " * (4 << 20), timeout=1.0)
    s.holds(too_long and too_long[0].err.payload.to_bytes() == b"Timeout", "more than 4 MiB is dropped")
    s.holds(call("step", {"ticks": 0})["tick"] == tick + 1, "nothing of that has changed the state")
    for example in re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL):
        s.holds(isinstance(json.loads(example), dict), example)
    call("resume", {})
    s.refused("step", {"ticks": 1}, "not_paused")
    print(f"\n{s.held} checks hold")


def test_the_same_requests_give_the_same_bytes_with_pauses_between(stranger):
    """Faster and slower than the tool becomes stale on a wall clock."""
    s = stranger
    s.call("pause", {})
    runs = []
    for pause_s in (0.0, 0.3):
        s.call("reset", {})
        replies = [s.call("step", step(1, PRESSED, source_id=1, sequence=3))]
        for source, sequence in ((2, 1), (1, 3), (1, 2), (1, 4)):
            time.sleep(pause_s)
            replies.append(s.call("step", step(20, PRESSED, source_id=source, sequence=sequence)))
        runs.append((replies, s.ask("object/wedge/skin")[0].ok.payload.to_bytes()[64:]))
    s.holds(runs[0] == runs[1], "pauses change nothing")


def test_a_press_over_the_streams_reads_as_the_page_says(stranger):
    s, pose, wrench, skin = stranger, pose_layout(), Layout("## 5. Wrench", 192), Layout("## 4. Skin frame", 64)
    heard = []
    subscriber = s.session.declare_subscriber(f"{ROOT}/tool/probe/wrench", lambda m: heard.append(m.payload))
    publisher = s.session.declare_publisher(f"{ROOT}/tool/probe/pose", congestion_control=zenoh.CongestionControl.BLOCK)
    wait_until(lambda: publisher.matching_status.matching, "the daemon's subscription")
    whole, total = b"", None
    while total is None or len(whole) < total:
        reply = s.ask(f"object/wedge/mesh?offset={len(whole)}")[0].ok
        header = json.loads(reply.attachment.to_bytes())
        total, whole = header["total_bytes"], whole + reply.payload.to_bytes()
    s.holds(hashlib.sha256(whole).hexdigest() == header["sha256"] and whole[:4] == b"glTF", "mesh")
    rest = s.ask("object/wedge/skin")[0].ok.payload.to_bytes()
    sent = lambda n, position: pose.pack(magic=b"PLPS", version=1, bytes=96, sequence=n, source_time_ns=1000 + n, source_id=5,
                                         flags=1, position=position, orientation=(0, 0, 0, 1))
    for n in range(1, 51):
        z = HIGH[2] + (PRESSED[2] - HIGH[2]) * n / 50
        publisher.put(sent(n, (PRESSED[0], PRESSED[1], z)))
        time.sleep(0.004)
    s.holds(s.status()["tools"]["probe"]["poses_accepted"] == 50, "no pose is lost once there is a subscriber")
    newest = wait_until(lambda: next((w for w in (wrench.read(p.to_bytes()) for p in heard[-50:]) if w["flags"] & 1), None), "contact")
    s.holds(newest["magic"] == b"PLWR" and newest["bytes"] == 192 and newest["version"] == 1, newest)
    s.holds(newest["pose_source_time_ns"] == 1000 + newest["pose_sequence"], "the pose's time is echoed")
    s.holds(newest["force"][2] > 0 and newest["n_contacts"] > 0, newest)
    s.holds(newest["proxy position"][2] > PRESSED[2], "the proxy stays outside")
    s.holds(np.linalg.norm(newest["contact point"] - newest["proxy position"]) < 0.02, "the contact point is at the tool")
    s.holds(abs(np.linalg.norm(newest["proxy orientation"]) - 1) < 1e-9, "unit quaternion")
    frame = s.ask("object/wedge/skin")[0].ok.payload.to_bytes()
    header = skin.read(frame)
    n = header["n_vertices"]
    s.holds(header["magic"] == b"PLSK" and len(frame) == 64 + 12 * n and header["tick"] > 0, header)
    moved = np.frombuffer(frame, "<f4", 3 * n, 64) - np.frombuffer(rest, "<f4", 3 * n, 64)
    s.holds(5e-4 < np.abs(moved).max() < 0.03, "the skin is pressed in")

    # Of several kinds the first counts: 1,024 times x is no message of ours, whatever its length.
    before = s.status()["tools"]["probe"]["poses_rejected"]
    valid = sent(51, PRESSED)
    cases = [(b"x" * 1024, "bad_magic"), (b"PL", "too_short"), (valid + b"x", "bad_length"), (b"PLPS\x02\0\x60\0" + valid[8:], "bad_version"),
             (pose.pack(magic=b"PLPS", version=1, bytes=96, position=(2e3, 0, 0)), "out_of_range"), (sent(50, PRESSED), "repeated"),
             (sent(49, PRESSED), "out_of_order")]
    for payload, _ in cases:
        publisher.put(payload)
    expected = {kind: before.get(kind, 0) + 1 for _, kind in cases}
    counted = lambda: s.status()["tools"]["probe"]["poses_rejected"]
    wait_until(lambda: {**before, **expected} == counted(), f"{expected}; there is {counted()}")
    subscriber.undeclare()
    print(f"\n{s.held} checks hold")
