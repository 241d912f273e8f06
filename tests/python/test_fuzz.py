"""A small portion of tests/fuzz_bus.py, with a fixed seed."""

import sys

from conftest import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "tests"))
import fuzz_bus  # noqa: E402


def test_malformed_poses_and_requests_are_counted_and_change_nothing(client, daemon):
    fuzz_bus.fuzz(client, daemon.endpoint, seed=1, n_poses=20_000, n_requests=1_000)
