"""Poses in at 250 Hz, skin out at 1 kHz, wrenches out: every message is accounted for. Rates are not asserted."""

import pathlib
import time

import numpy as np

from client import Client, Source, mesh_positions, read_frame, read_wrench, wait_until
from conftest import Daemon

SECONDS = 4
POSE_HZ = 250


def press(client, seconds):
    """Presses the middle of the wedge and drags; returns how many poses were sent."""
    rest = client.frame().positions
    middle = (rest[:, :2].min(0) + rest[:, :2].max(0)) / 2
    top = rest[np.hypot(*(rest[:, :2] - middle).T) < 0.003, 2].max()
    source, publisher = Source(), client.publisher()
    n = seconds * POSE_HZ
    began = time.monotonic()
    for i in range(n):
        depth = 0.005 * min(1.0, 4 * i / n)
        position = (middle[0] + 0.005 * i / n, middle[1], top + 0.007 - depth)
        publisher.put(source.pose(position))
        time.sleep(max(0.0, began + (i + 1) / POSE_HZ - time.monotonic()))
    return n


def counters(client):
    status = client.status()
    return status["objects"]["wedge"]["frames_published"], status["drops"], status["tick"]


def settled(collector):
    """Waits until nothing arrives any more."""
    size = -1
    while size != len(collector):
        size = len(collector)
        time.sleep(0.5)


def check_sequence(messages):
    """Messages come in order and once; returns how many between the first and the last never came."""
    sequence = np.array([m.sequence for m in messages], dtype=np.int64)
    steps = np.diff(sequence)
    assert (steps > 0).all(), "a message came twice or too late"
    return int((steps - 1).sum())


def test_every_frame_and_wrench_is_accounted_for(client):
    client.rpc("pause")
    skins = client.collect("object/wedge/skin", read_frame)
    wrenches = client.collect("tool/probe/wrench", read_wrench)
    time.sleep(0.5)  # the daemon learns that somebody listens
    published_before, drops_before, tick_before = counters(client)
    client.rpc("resume")
    sent = press(client, SECONDS)
    client.rpc("pause")
    settled(skins), settled(wrenches)
    published_after, drops_after, tick_after = counters(client)
    status = client.status()
    frames, forces = skins.messages(), wrenches.messages()
    skins.close(), wrenches.close()

    # Received, and lost on the way as the gaps tell: together what the daemon published.
    lost = check_sequence(frames)
    published = published_after - published_before
    assert len(frames) > 100 and frames[0].sequence > published_before
    missed_at_the_ends = (frames[0].sequence - published_before - 1) + (published_after - frames[-1].sequence)
    assert len(frames) + lost + missed_at_the_ends == published
    # Published, and dropped before publishing as the status tells: together one for each tick.
    dropped = drops_after["frames"] - drops_before["frames"]
    assert published + dropped == tick_after - tick_before

    lost_wrenches = check_sequence(forces)
    dropped_wrenches = drops_after["wrenches"] - drops_before["wrenches"]
    assert len(forces) > 100
    # A tool has no wrench before its first pose, so only the ticks from then on count.
    ticks_with_tool = tick_after - forces[0].tick + 1
    lost_at_the_ends = ticks_with_tool - len(forces) - lost_wrenches - dropped_wrenches
    assert 0 <= lost_at_the_ends <= 1000, "the tail of a stream may be lost, no more"

    print(f"\nskin: {len(frames)} received, {lost} lost, {dropped} dropped; wrench: {len(forces)} received, "
          f"{lost_wrenches} lost, {dropped_wrenches} dropped, {lost_at_the_ends} at the end; {sent} poses")

    tool = status["tools"]["probe"]
    rejected = sum(tool.get("poses_rejected", {}).values())
    assert rejected == 0 and 0 < tool["poses_accepted"] <= sent
    assert max(np.linalg.norm(w.force) for w in forces) > 0.1, "the tool was pressed into the object"
    assert max(w.n_contacts for w in forces) > 0 and any(w.flags & 1 for w in forces)
    assert all(np.isfinite(f.positions).all() for f in frames)
    assert np.abs(frames[-1].positions - frames[0].positions).max() > 1e-3, "the skin gave way"
    assert [f.tick for f in frames] == sorted({f.tick for f in frames}), "one frame per tick"


def test_wrenches_echo_the_pose_that_they_answer(client):
    wrenches = client.collect("tool/probe/wrench", read_wrench)
    source, publisher = Source(), client.publisher(lossless=True)
    sent = {}
    for i in range(50):
        time_ns = time.monotonic_ns()
        publisher.put(source.pose((0.06, 0.03, 0.08), time_ns=time_ns))
        sent[source.sequence] = time_ns
        time.sleep(0.01)
    wait_until(lambda: any(w.pose_sequence == 50 for w in wrenches.messages()), "a wrench that echoes the last pose")
    for wrench in wrenches.messages():
        assert sent[wrench.pose_sequence] == wrench.pose_time_ns
    wrenches.close()


def test_status_is_published_and_names_everything(client):
    import json

    heard = client.collect("status", json.loads)
    wait_until(lambda: len(heard) >= 2, "two status messages")
    status = heard.messages()[-1]
    heard.close()
    expected = {"versions", "session", "scene", "uptime_s", "tick", "sim_time_s", "paused", "realtime", "tick_us",
                "stages", "lateness_us", "overruns", "skipped_ticks", "objects", "tools", "rejected", "drops", "jobs",
                "jobs_unavailable"}
    assert expected <= set(status), expected - set(status)
    assert list(status["tools"]) == ["probe"] and list(status["objects"]) == ["wedge"]
    assert {"count", "min", "p50", "p90", "p99", "p999", "max"} <= set(status["tick_us"])
    assert "contact" in status["stages"]


def test_both_formats_hold_the_same_skin_with_unit_normals(plicad, scene, tmp_path):
    """The same press in f32 and in 16-bit offsets, each with normals: every field of this client's frames and wrenches."""
    frames, wrenches = {}, {}
    for name, publish in (("f32", 'format = "f32"'), ("i16", 'format = "i16"')):
        text = (pathlib.Path(scene).read_text().replace('format = "f32"', publish)
                .replace("normals = false", "normals = true"))
        assert publish in text and "normals = true" in text
        file = tmp_path / f"{name}.toml"
        file.write_text(text)
        running = Daemon(plicad, str(file), tmp_path / f"{name}.log", options=("--lock-step",))
        try:
            running.wait()
            with Client(running.endpoint) as client:
                heard = client.collect("tool/probe/wrench", read_wrench)
                rest = mesh_positions(client.mesh())
                pressed = {"tool": "probe", "position": [0.06, 0.03, 0.03], "orientation": [0, 0, 0, 1]}
                client.rpc("step", {"ticks": 300, "poses": [pressed]})
                frames[name] = client.frame()
                wait_until(lambda: heard.messages() and heard.messages()[-1].n_contacts > 0, "a wrench with contact")
                wrenches[name] = heard.messages()[-1]
                heard.close()
            running.stop()
        finally:
            running.kill()
    exact, short = frames["f32"], frames["i16"]
    moved = np.abs(exact.positions - rest).max()
    error = np.abs(short.positions - exact.positions).max()
    assert moved > 5e-4 and error <= 0.51 * moved / 32767 + 1e-7, (moved, error)
    for frame in (exact, short):
        assert np.allclose(np.linalg.norm(frame.normals, axis=1), 1, atol=1e-4)
    assert np.abs(short.normals - exact.normals).max() < 1e-4
    for wrench in wrenches.values():
        assert wrench.force[2] > 0 and wrench.proxy_position[2] > 0.03, wrench
        assert np.linalg.norm(wrench.contact_point - wrench.proxy_position) < 0.0075, "on the tool, a capsule of radius 7 mm"
        assert abs(np.linalg.norm(wrench.proxy_orientation) - 1) < 1e-9
