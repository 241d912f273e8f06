"""Methods: what they reply, and how they refuse."""

import numpy as np
import pytest

from client import ErrorReply, wait_until

HIGH = {"tool": "probe", "position": [0.06, 0.03, 0.08], "orientation": [0, 0, 0, 1]}
PRESSED = {"tool": "probe", "position": [0.06, 0.03, 0.028], "orientation": [0, 0, 0, 1]}


def test_pause_step_reset_resume(client):
    assert client.rpc("pause")["paused"] is True
    tick = client.rpc("reset")
    assert (tick["tick"], tick["sim_time_s"], tick["paused"]) == (0, 0.0, True)
    stepped = client.rpc("step", {"ticks": 25, "poses": [HIGH]})
    assert stepped["tick"] == 25 and abs(stepped["sim_time_s"] - 0.025) < 1e-12
    assert client.rpc("step", {"ticks": 0, "poses": []})["tick"] == 25
    assert client.frame().tick == 25
    wait_until(lambda: client.status()["tick"] == 25 and client.status()["paused"], "the status to say so")
    assert client.rpc("resume")["paused"] is False
    wait_until(lambda: client.status()["tick"] > 25, "ticks to go on")
    # An empty payload is {}.
    client.ask("rpc/pause", b"")


def test_snapshot_and_restore(client):
    client.rpc("pause")
    client.rpc("reset")
    client.rpc("step", {"ticks": 200, "poses": [HIGH]})
    client.rpc("step", {"ticks": 200, "poses": [{**PRESSED, "source_time_ns": 200_000_000}]})
    kept, snapshot = client.frame(), client.rpc("snapshot")["id"]
    assert isinstance(snapshot, str)
    client.rpc("step", {"ticks": 100, "poses": [{**HIGH, "source_time_ns": 400_000_000}]})
    assert not np.array_equal(client.frame().positions, kept.positions)
    assert client.rpc("restore", {"id": snapshot})["tick"] == 400
    assert np.array_equal(client.frame().positions, kept.positions)
    assert client.refused("restore", {"id": "no such"}).code == "unknown_snapshot"


def test_refusals_have_codes_are_counted_and_change_nothing(client):
    client.rpc("pause")
    client.rpc("reset")
    before = client.frame()
    refusals = [
        ("explode", {}, "rpc_unknown"),
        ("step", b"{ticks", "rpc_malformed"),
        ("step", b"\xff\xff", "rpc_malformed"),
        ("step", b"", "rpc_malformed"),
        ("step", {"ticks": -1, "poses": []}, "rpc_malformed"),
        ("step", {"ticks": 10001, "poses": []}, "rpc_malformed"),
        ("step", {"ticks": 1, "poses": [], "speed": 2}, "rpc_malformed"),
        ("pause", {"now": True}, "rpc_malformed"),
        ("restore", {}, "rpc_malformed"),
        ("restore", {"id": "17"}, "unknown_snapshot"),
        ("step", {"ticks": 1, "poses": [{**PRESSED, "orientation": [0, 0, 0, 3]}]}, "bad_pose"),
        ("step", {"ticks": 1, "poses": [PRESSED, {**PRESSED, "position": [1e9, 0, 0]}]}, "bad_pose"),
        ("step", {"ticks": 1, "poses": [{**PRESSED, "tool": "knife"}]}, "unknown_tool"),
    ]
    for method, request, code in refusals:
        error = client.refused(method, request)
        assert error.code == code, f"{method} {request}: {error}"
        assert error.body["retryable"] is False
    after = client.frame()
    assert after.tick == 0 and np.array_equal(after.positions, before.positions)
    client.rpc("resume")
    assert client.refused("step", {"ticks": 1, "poses": []}).code == "not_paused"

    codes = [code for *_, code in refusals] + ["not_paused"]
    expected = {code: codes.count(code) for code in set(codes)}
    counted = lambda: {k: v for k, v in client.status()["rejected"].items() if k in expected}
    wait_until(lambda: counted() == expected, f"{expected}; there is {client.status()['rejected']}")
    print(f"\n{len(codes)} refused requests: {expected}")


@pytest.mark.parametrize("key", ["main/rpc/*", "main/rpc/**", "main/rpc/res$*", "*/rpc/reset", "**"])
def test_a_wildcard_is_refused(client, key):
    client.rpc("pause")
    tick = client.status()["tick"]
    replies = client.session.get(f"plica/v1/{key}", payload=b"{}", timeout=5.0)
    replies = [ErrorReply(r.err.payload.to_bytes()) for r in replies if r.ok is None]
    assert replies and all(isinstance(r, ErrorReply) and r.code == "rpc_wildcard" for r in replies), replies
    status = client.status()
    assert status["paused"] and status["tick"] == tick and status["rejected"]["rpc_wildcard"] >= 1


def test_mesh_and_skin_of_what_is_not_there(client):
    for key, code in (("object/wedge/mesh?offset=abc", "bad_offset"), ("object/wedge/mesh?offset=999999999", "bad_offset"),
                      ("object/pillow/mesh", "unknown_object"), ("object/pillow/skin", "unknown_object")):
        with pytest.raises(ErrorReply) as refused:
            client.ask(key)
        assert refused.value.code == code, key
