"""A client of plicad that knows nothing but protocol/PROTOCOL.md: eclipse-zenoh, numpy, and the tables of that page."""

import hashlib
import json
import random
import struct
import threading
import time
from collections import namedtuple

import numpy as np
import zenoh

POSE = struct.Struct("<4sHHQQII3d4dIf")
SKIN = struct.Struct("<4sHHQQdQIIfIfI")
WRENCH = struct.Struct("<4sHHQQdQQ3d3d3d3d4dIIfI")
assert (POSE.size, SKIN.size, WRENCH.size) == (96, 64, 192)

ENRICHED, NORMALS_FOLLOW, SIXTEEN_BIT, SLEEPING = 1, 8, 16, 4
TIMEOUT_S = 20.0

Frame = namedtuple("Frame", "sequence tick sim_time_s pose_time_ns flags confidence generation positions")
Wrench = namedtuple("Wrench", "sequence tick sim_time_s pose_sequence pose_time_ns force torque flags n_contacts confidence")


class ErrorReply(Exception):
    """An error reply of the daemon: code, message, retryable."""

    def __init__(self, payload):
        body = json.loads(payload)
        super().__init__(f"{body['code']}: {body['message']}")
        self.body = body
        self.code = body["code"]


class Client:
    """A connection to one daemon."""

    def __init__(self, endpoint, session="main"):
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("scouting/gossip/enabled", "false")
        self.root = f"plica/v1/{session}"
        self.session = zenoh.open(config)

    def close(self):
        self.session.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def samples(self, key, payload=None):
        """All replies to one query: samples, or ErrorReply objects."""
        replies = self.session.get(f"{self.root}/{key}", payload=payload, timeout=TIMEOUT_S)
        return [r.ok if r.ok is not None else ErrorReply(r.err.payload.to_bytes()) for r in replies]

    def ask(self, key, payload=None):
        """The one reply to a query, or the error that was replied."""
        replies = self.samples(key, payload)
        assert len(replies) == 1, f"{key}: {len(replies)} replies"
        if isinstance(replies[0], ErrorReply):
            raise replies[0]
        return replies[0]

    def rpc(self, method, request=None):
        payload = request if isinstance(request, (bytes, type(None))) else json.dumps(request).encode()
        return json.loads(self.ask(f"rpc/{method}", payload).payload.to_bytes())

    def refused(self, method, request=None):
        """The error that a method replies with."""
        try:
            reply = self.rpc(method, request)
        except ErrorReply as error:
            assert set(error.body) >= {"code", "message", "retryable"}, error.body
            assert isinstance(error.body["retryable"], bool) and error.body["message"], error.body
            return error
        raise AssertionError(f"rpc/{method} was not refused: {reply}")

    def status(self):
        return json.loads(self.ask("status").payload.to_bytes())

    def frame(self, name="wedge"):
        return read_frame(self.ask(f"object/{name}/skin").payload.to_bytes())

    def mesh(self, name="wedge"):
        """The GLB, piece by piece."""
        whole, header = b"", None
        while header is None or len(whole) < header["total_bytes"]:
            sample = self.ask(f"object/{name}/mesh?offset={len(whole)}")
            piece, header = sample.payload.to_bytes(), json.loads(sample.attachment.to_bytes())
            assert header["offset"] == len(whole) and 0 < len(piece) <= 524288
            whole += piece
        assert len(whole) == header["total_bytes"]
        assert hashlib.sha256(whole).hexdigest() == header["sha256"]
        return whole

    def publisher(self, tool="probe", lossless=False):
        """As the protocol advises; `lossless` waits for room instead of dropping, for tests that count."""
        control = zenoh.CongestionControl.BLOCK if lossless else zenoh.CongestionControl.DROP
        return self.session.declare_publisher(f"{self.root}/tool/{tool}/pose", express=True,
                                              priority=zenoh.Priority.REAL_TIME, congestion_control=control)

    def collect(self, key, read):
        """Everything that arrives on a stream, read, in a list that grows."""
        return Collector(self.session, f"{self.root}/{key}", read)


class Collector:
    """Stores messages in the callback and reads them later, as the protocol advises."""

    def __init__(self, session, key, read):
        self._raw, self._lock, self._read = [], threading.Lock(), read
        self._subscriber = session.declare_subscriber(key, self._store)

    def _store(self, sample):
        with self._lock:
            self._raw.append(sample.payload)

    def __len__(self):
        with self._lock:
            return len(self._raw)

    def messages(self):
        with self._lock:
            raw = list(self._raw)
        return [self._read(payload.to_bytes()) for payload in raw]

    def close(self):
        self._subscriber.undeclare()


class Source:
    """One start of a tracker: a random id, and poses numbered from 1."""

    def __init__(self):
        self.source_id = random.getrandbits(32)
        self.sequence = 0

    def pose(self, position, **overrides):
        self.sequence += 1
        return pose(position, sequence=self.sequence, source_id=self.source_id, **overrides)


def pose(position, *, sequence=0, source_id=1, time_ns=None, orientation=(0, 0, 0, 1), valid=True, magic=b"PLPS",
         version=1, size=96):
    time_ns = time.monotonic_ns() if time_ns is None else time_ns
    return POSE.pack(magic, version, size, sequence, time_ns, source_id, int(valid), *position, *orientation, 0, 0.0)


def read_frame(data):
    magic, version, size, sequence, tick, sim_time, pose_time, n, flags, confidence, generation, scale, _ = SKIN.unpack_from(data)
    assert (magic, version, size) == (b"PLSK", 1, 64)
    assert not flags & SIXTEEN_BIT, "this client reads the f32 format"
    assert len(data) == 64 + (24 if flags & NORMALS_FOLLOW else 12) * n and scale == 0
    positions = np.frombuffer(data, "<f4", 3 * n, 64).reshape(n, 3)
    return Frame(sequence, tick, sim_time, pose_time, flags, confidence, generation, positions)


def read_wrench(data):
    assert len(data) == 192
    v = WRENCH.unpack(data)
    assert v[:3] == (b"PLWR", 1, 192)
    return Wrench(*v[3:8], force=np.array(v[8:11]), torque=np.array(v[11:14]), flags=v[24], n_contacts=v[25],
                  confidence=v[26])


def wait_until(condition, what, timeout_s=TIMEOUT_S):
    """Polls until the condition holds; says what was waited for when it never does."""
    deadline = time.monotonic() + timeout_s
    while not (value := condition()):
        assert time.monotonic() < deadline, f"waited {timeout_s} s for: {what}"
        time.sleep(0.02)
    return value
