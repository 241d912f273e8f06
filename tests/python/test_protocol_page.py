"""The example at the end of PROTOCOL.md runs as it is printed."""

import re
import subprocess
import sys

from conftest import REPOSITORY


def test_the_pages_example_presses_the_object(daemon):
    page = (REPOSITORY / "protocol" / "PROTOCOL.md").read_text()
    (example,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert "tcp/127.0.0.1:7447" in example
    example = example.replace("tcp/127.0.0.1:7447", daemon.endpoint)
    run = subprocess.run([sys.executable, "-c", example], capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert lines[0] == "tools: ['probe']"
    forces = [[float(x) for x in re.search(r"\((.*?)\)", line)[1].split(",")] for line in lines[1:]]
    assert all(" ms after its pose; skin moved " in line for line in lines[1:]), run.stdout
    assert len(forces) > 5 and max(z for *_, z in forces) > 0.1, run.stdout


def test_the_page_installs_the_version_that_is_tested():
    page = (REPOSITORY / "protocol" / "PROTOCOL.md").read_text()
    (pinned,) = re.findall(r"pip install (eclipse-zenoh==[0-9.]+) numpy", page)
    assert pinned in (REPOSITORY / "tests" / "run").read_text()
