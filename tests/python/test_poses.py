"""Malformed and unwelcome poses: counted by kind, and nothing moves."""

import json
import pathlib
import struct
import time

import numpy as np
import zenoh

from client import POSE, Client, Source, pose, wait_until
from conftest import STALE_S, Daemon

# Each of these would press the tool deep into the object if it were taken.
INSIDE = (0.06, 0.03, 0.02)
NAN = float("nan")


def json_pose(**fields):
    return json.dumps({"position": INSIDE, "orientation": [0, 0, 0, 1], **fields}).encode()


BINARY = [
    ("too_short", b""),
    ("too_short", pose(INSIDE)[:95]),
    ("too_short", b"PLPS"),
    ("bad_length", pose(INSIDE) + b"\0"),
    ("bad_length", pose(INSIDE, size=95)),
    ("bad_magic", pose(INSIDE, magic=b"PLSK")),
    ("bad_version", pose(INSIDE, version=2)),
    ("non_finite", pose((NAN, 0.03, 0.02))),
    ("non_finite", pose((0.06, float("inf"), 0.02))),
    ("non_finite", pose(INSIDE, orientation=(0, 0, NAN, 1))),
    ("non_finite", POSE.pack(b"PLPS", 1, 96, 1, 1, 1, 1, *INSIDE, 0, 0, 0, 1, 0, NAN)),
    ("not_unit", pose(INSIDE, orientation=(0, 0, 0, 0))),
    ("not_unit", pose(INSIDE, orientation=(0, 0, 0, 1.1))),
    ("not_unit", pose(INSIDE, orientation=(0, 0, 0, 0.98))),
    ("out_of_range", pose((1000.5, 0, 0))),
    ("out_of_range", pose((0, 0, -1e300))),
    ("invalid", pose(INSIDE, valid=False)),
]
JSON = [
    ("bad_json", b"{"),
    ("bad_json", b"\xff\xfe"),
    ("bad_json", b"[]"),
    ("bad_json", json.dumps({"position": INSIDE}).encode()),
    ("bad_json", json_pose(position=[0, 0])),
    ("bad_json", json_pose(sequence=-1)),
    ("bad_json", json_pose(colour="red")),
    ("bad_json", b'{"position": [NaN, 0, 0], "orientation": [0, 0, 0, 1]}'),
    ("not_unit", json_pose(orientation=[0, 0, 0, 2])),
    ("out_of_range", json_pose(position=[0, 2e3, 0])),
    ("invalid", json_pose(valid=False)),
]


def probe(client):
    return client.status()["tools"]["probe"]


def wait_for_counts(client, expected):
    wait_until(lambda: probe(client)["poses_rejected"] == expected, f"{expected}; there is {probe(client)['poses_rejected']}")


def count(kinds):
    return {kind: kinds.count(kind) for kind in set(kinds)}


def test_malformed_poses_are_counted_by_kind_and_change_nothing(client):
    rest, tick = client.frame().positions, client.status()["tick"]
    publisher = client.publisher(lossless=True)
    for _, payload in BINARY:
        publisher.put(payload)
    for _, payload in JSON:
        publisher.put(payload, encoding=zenoh.Encoding.APPLICATION_JSON)
    wait_for_counts(client, count([kind for kind, _ in BINARY + JSON]))

    wait_until(lambda: client.status()["tick"] > tick + 50 or client.status()["objects"]["wedge"]["sleeping"], "ticks")
    status = client.status()
    assert status["tools"]["probe"]["poses_accepted"] == 0 and status["tools"]["probe"]["pose_age_s"] is None
    assert status["objects"]["wedge"]["rollbacks"] == 0
    assert np.array_equal(client.frame().positions, rest), "nothing moved"
    print(f"\n{len(BINARY + JSON)} malformed poses: {status['tools']['probe']['poses_rejected']}")

    publisher.put(Source().pose((0.06, 0.03, 0.08)))
    wait_until(lambda: probe(client)["poses_accepted"] == 1, "a good pose to be taken after all that")


def test_a_quaternion_near_unit_length_is_taken(client):
    publisher, source = client.publisher(lossless=True), Source()
    publisher.put(source.pose((0.06, 0.03, 0.08), orientation=(0, 0, 0, 1.009)))
    publisher.put(json_pose(position=[0.06, 0.03, 0.08], orientation=[0, 0, 0, 0.991], source_id=source.source_id),
                  encoding=zenoh.Encoding.APPLICATION_JSON)
    wait_until(lambda: probe(client)["poses_accepted"] == 2, "both to be taken")
    assert probe(client)["poses_rejected"] == {}


def test_a_tracker_in_millimetres_is_judged_after_its_scale(plicad, scene, tmp_path):
    text = pathlib.Path(scene).read_text().replace("position_scale = 1.0", "position_scale = 1e-3", 1)
    path = tmp_path / "millimetres.toml"
    path.write_text(text)
    daemon = Daemon(plicad, str(path), tmp_path / "plicad.log")
    try:
        daemon.wait()
        with Client(daemon.endpoint) as client:
            publisher, source = client.publisher(lossless=True), Source()
            publisher.put(source.pose((2000, 30, 80)))
            publisher.put(source.pose((1.1e6, 0, 0)))
            wait_for_counts(client, {"out_of_range": 1})
            assert probe(client)["poses_accepted"] == 1
    finally:
        daemon.kill()


def test_poses_of_unknown_tools_are_counted(client):
    for name in ("knife", "pro", "probe2"):
        client.publisher(name, lossless=True).put(pose(INSIDE))
    wait_until(lambda: client.status()["rejected"].get("unknown_tool") == 3, "three unknown tools")
    assert list(client.status()["tools"]) == ["probe"]


def test_repeated_and_late_sequences_are_counted(client):
    publisher = client.publisher(lossless=True)
    high = (0.06, 0.03, 0.08)
    for sequence in (1, 2, 2, 5, 4, 3, 5, 6):
        publisher.put(pose(high, sequence=sequence, source_id=7))
    wait_for_counts(client, {"repeated": 2, "out_of_order": 2})
    assert probe(client)["poses_accepted"] == 4
    wait_until(lambda: probe(client)["pose_sequence"] == 6, "the newest pose to be used in a tick")


def test_a_second_publisher_is_a_conflict_and_a_restarted_one_takes_over(client):
    publisher = client.publisher(lossless=True)
    high = (0.06, 0.03, 0.08)
    first, second = Source(), Source()
    for _ in range(10):
        publisher.put(first.pose(high))
        publisher.put(second.pose(INSIDE))
    wait_for_counts(client, {"conflict": 10})
    assert probe(client)["poses_accepted"] == 10 and not probe(client)["stale"]
    assert probe(client)["n_contacts"] == 0, "the second publisher's poses moved nothing"

    wait_until(lambda: probe(client)["stale"], "the tool to be stale")
    time.sleep(0.2 * STALE_S)
    restarted = Source()
    publisher.put(restarted.pose(high))
    wait_until(lambda: probe(client)["poses_accepted"] == 11, "a restarted client to take over")
    wait_until(lambda: probe(client)["pose_sequence"] == 1, "its pose to be used in a tick")
    wait_for_counts(client, {"conflict": 10})
    publisher.put(first.pose(high))
    wait_for_counts(client, {"conflict": 11})


def test_a_teleporting_tool_is_counted_and_harmless(client):
    publisher, source = client.publisher(lossless=True), Source()
    for i in range(200):
        height = 0.5 if i % 2 else 0.015
        publisher.put(source.pose((0.06, 0.03, height)))
        time.sleep(0.004)
    wait_until(lambda: probe(client)["placements"] > 0, "jumps to be counted")
    publisher.put(source.pose((0.06, 0.03, 0.5)))
    wait_until(lambda: probe(client)["n_contacts"] == 0, "the tool to let go")
    frame = client.frame().positions
    rest_box = np.array([[0.0, 0.0, 0.0], [0.12, 0.06, 0.04]])
    assert np.isfinite(frame).all()
    assert (frame > rest_box[0] - 0.05).all() and (frame < rest_box[1] + 0.05).all(), "nothing exploded"


def test_unread_bytes_are_checked_before_they_are_believed(client):
    """Random bytes of the right length with the right magic: whatever they hold, the daemon lives and stays finite."""
    generator = np.random.default_rng(1)
    publisher = client.publisher(lossless=True)
    for _ in range(300):
        publisher.put(struct.pack("<4sHH", b"PLPS", 1, 96) + generator.bytes(88))
    seen = lambda: probe(client)["poses_accepted"] + sum(probe(client)["poses_rejected"].values())
    wait_until(lambda: seen() == 300, "300 poses to be judged")
    assert np.isfinite(client.frame().positions).all()
