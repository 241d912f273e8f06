"""Methods: what they reply, and how they refuse."""

import concurrent.futures
import pathlib

import numpy as np
import pytest

from client import Client, ErrorReply, wait_until
from conftest import Daemon

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
        *[(method, body, "rpc_malformed") for body in (b"[]", b"[1]", b"null", b'"x"', b"1", b" ", b"[{}]")
          for method in ("reset", "pause", "resume", "step", "interrupt", "snapshot", "restore", "activate", "job_list", "job_get")],
        ("step", b'{"ticks": 1, "poses": [["probe", 0, 0, 0, true, [0, 0, 0], [0, 0, 0, 1], 0, 0]]}', "rpc_malformed"),
        ("restore", b'["1"]', "rpc_malformed"),
        ("step", {"ticks": 1, "poses": [HIGH] * 1025}, "rpc_malformed"),
        ("step", {"ticks": 1, "from_tick": 7}, "wrong_tick"),
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
        assert (error.body["retryable"], error.body["done"]) == (False, "no")
    after = client.frame()
    assert after.tick == 0 and np.array_equal(after.positions, before.positions)
    client.rpc("resume")
    assert client.refused("step", {"ticks": 1, "poses": []}).code == "not_paused"

    codes = [code for *_, code in refusals] + ["not_paused"]
    expected = {code: codes.count(code) for code in set(codes)}
    counted = lambda: {k: v for k, v in client.status()["rejected"].items() if k in expected}
    wait_until(lambda: counted() == expected, f"{expected}; there is {client.status()['rejected']}")
    print(f"\n{len(codes)} refused requests: {expected}")


def test_the_id_of_a_snapshot_is_compared_as_text(client):
    client.rpc("pause")
    assert client.rpc("snapshot")["id"] == "1"
    for other in ("+1", "0001", "01", "1 ", " 1", "1.0", ""):
        assert client.refused("restore", {"id": other}).code == "unknown_snapshot", other
    client.rpc("restore", {"id": "1"})


def test_a_step_with_from_tick_can_be_repeated(client):
    client.rpc("pause")
    client.rpc("reset")
    step = {"ticks": 5, "poses": [HIGH], "from_tick": 0}
    assert client.rpc("step", step)["tick"] == 5
    again = client.refused("step", step)
    assert (again.code, again.body["tick"], again.body["done"]) == ("wrong_tick", 5, "no")
    assert client.rpc("step", {"ticks": 0})["tick"] == 5
    probe = client.status()["tools"]["probe"]
    assert (probe["poses_accepted"], probe["poses_rejected"]) == (1, {}), "the repeated one used up no pose"


def heavy(scene, folder):
    """A scene in which 10,000 ticks with contact take more than the limit of a step."""
    text = pathlib.Path(scene).read_text()
    assert "divisions = [8, 4, 4]" in text
    file = folder / "heavy.toml"
    file.write_text(text.replace("divisions = [8, 4, 4]", "divisions = [32, 14, 14]"))
    return str(file)


def test_a_long_step_stops_in_time_or_at_an_interrupt_and_tells_its_tick(plicad, scene, tmp_path):
    running = Daemon(plicad, heavy(scene, tmp_path), tmp_path / "plicad.log", options=("--lock-step",))
    try:
        running.wait()
        with Client(running.endpoint) as client, concurrent.futures.ThreadPoolExecutor() as pool:
            # Nobody interrupts: the daemon's own limit.
            error = client.refused("step", {"ticks": 10000, "poses": [PRESSED], "from_tick": 0})
            assert (error.code, error.body["retryable"], error.body["done"]) == ("timed_out", False, "partly"), error.body
            tick = error.body["tick"]
            assert 0 < tick < 10000 and error.body["ticks_done"] == tick, error.body
            assert client.rpc("step", {"ticks": 0})["tick"] == tick, "it stands where it said"

            # A client that gave up and asks again with from_tick is not stepped twice.
            again = client.refused("step", {"ticks": 10000, "poses": [PRESSED], "from_tick": 0})
            assert (again.code, again.body["tick"]) == ("wrong_tick", tick)

            step = pool.submit(client.refused, "step", {"ticks": 10000})
            wait_until(lambda: client.status()["tick"] > tick, "the step to run")
            state = client.rpc("interrupt")
            error = step.result()
            assert (error.code, error.body["done"], error.body["tick"]) == ("interrupted", "partly", state["tick"]), error.body
            assert error.body["ticks_done"] == state["tick"] - tick
            assert client.rpc("interrupt") == state, "nothing to interrupt"
            assert client.rpc("step", {"ticks": 1})["tick"] == state["tick"] + 1, "nothing is left over for the next step"

            # What waits behind a step for too long is refused, not carried out.
            first = pool.submit(client.refused, "step", {"ticks": 10000})
            wait_until(lambda: client.status()["tick"] > state["tick"] + 1, "the step to run")
            second = pool.submit(lambda: client.samples("rpc/step", b'{"ticks": 10000}')[0])
            third = pool.submit(lambda: client.samples("rpc/step", b'{"ticks": 1}')[0])
            reached = first.result().body["tick"]
            late = [one.result() for one in (second, third)]
            ticks = {"busy": 0, "timed_out": 0}
            for error in late:
                if isinstance(error, ErrorReply):
                    ticks[error.code] += error.body.get("ticks_done", 0)
                    assert error.code != "busy" or (error.body["done"], error.body["retryable"]) == ("no", True), error.body
                else:
                    ticks["ok"] = ticks.get("ok", 0) + 1
            assert client.rpc("step", {"ticks": 0})["tick"] == reached + sum(ticks.values()), (reached, ticks)
            print(f"\n{tick} ticks until the limit; every tick is accounted for: {ticks}")

            # A stop does not wait for a step.
            step = pool.submit(lambda: client.samples("rpc/step", b'{"ticks": 10000}'))
            wait_until(lambda: client.status()["tick"] > reached + sum(ticks.values()), "the step to run")
            running.stop()
            step.result()
    finally:
        running.kill()


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
