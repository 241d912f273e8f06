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

Frame = namedtuple("Frame", "sequence tick sim_time_s pose_time_ns flags confidence generation positions normals")
Wrench = namedtuple("Wrench", "sequence tick sim_time_s pose_sequence pose_time_ns force torque contact_point proxy_position "
                              "proxy_orientation flags n_contacts confidence")


class ErrorReply(Exception):
    """An error reply of the daemon: code, message, retryable, done, and of steps the tick."""

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
        self.rest = {}

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
            assert set(error.body) >= {"code", "message", "retryable", "done"}, error.body
            assert isinstance(error.body["retryable"], bool) and error.body["message"], error.body
            assert error.body["done"] == "no" or not error.body["retryable"], error.body
            return error
        raise AssertionError(f"rpc/{method} was not refused: {reply}")

    def status(self):
        return json.loads(self.ask("status").payload.to_bytes())

    def frame(self, name="wedge"):
        return self.read_frame(self.ask(f"object/{name}/skin").payload.to_bytes(), name)

    def read_frame(self, data, name="wedge"):
        """A frame in either format; the 16-bit one holds offsets from the mesh, which is fetched once."""
        if data[44] & SIXTEEN_BIT and name not in self.rest:
            self.rest[name] = mesh_positions(self.mesh(name))
        return read_frame(data, self.rest.get(name))

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


def read_frame(data, rest=None):
    """A skin frame; in the 16-bit format positions are offsets from `rest`, the positions of the mesh."""
    magic, version, size, sequence, tick, sim_time, pose_time, n, flags, confidence, generation, scale, _ = SKIN.unpack_from(data)
    assert (magic, version, size) == (b"PLSK", 1, 64)
    short, has_normals = bool(flags & SIXTEEN_BIT), bool(flags & NORMALS_FOLLOW)
    kind = np.dtype("<i2" if short else "<f4")
    assert len(data) == 64 + (2 if has_normals else 1) * 3 * n * kind.itemsize and (scale > 0) == short
    vectors = np.frombuffer(data, kind, offset=64).reshape(-1, n, 3)
    positions, normals = vectors[0], vectors[1] if has_normals else None
    if short:
        assert rest is not None and len(rest) == n, "the 16-bit format needs the rest positions of the mesh"
        positions = rest + np.float32(scale) * positions
        normals = normals / 32767 if has_normals else None
    return Frame(sequence, tick, sim_time, pose_time, flags, confidence, generation, positions, normals)


def read_wrench(data):
    assert len(data) == 192
    v = WRENCH.unpack(data)
    assert v[:3] == (b"PLWR", 1, 192)
    return Wrench(*v[3:8], force=np.array(v[8:11]), torque=np.array(v[11:14]), contact_point=np.array(v[14:17]),
                  proxy_position=np.array(v[17:20]), proxy_orientation=np.array(v[20:24]), flags=v[24], n_contacts=v[25],
                  confidence=v[26])


def mesh_positions(glb):
    """Rest positions of a GLB as frames have them: without the transform of its node."""
    text_bytes = struct.unpack_from("<I", glb, 12)[0]
    scene, binary = json.loads(glb[20:20 + text_bytes]), glb[28 + text_bytes:]
    accessor = scene["accessors"][scene["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    view = scene["bufferViews"][accessor["bufferView"]]
    first = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    assert accessor["componentType"] == 5126 and view.get("byteStride", 12) == 12
    return np.frombuffer(binary, "<f4", 3 * accessor["count"], first).reshape(-1, 3)


def wait_until(condition, what, timeout_s=TIMEOUT_S):
    """Polls until the condition holds; says what was waited for when it never does."""
    deadline = time.monotonic() + timeout_s
    while not (value := condition()):
        assert time.monotonic() < deadline, f"waited {timeout_s} s for: {what}"
        time.sleep(0.02)
    return value
