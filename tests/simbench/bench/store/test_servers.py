"""Runs at URLs of real servers on the loopback: the bits of a run on disk, whatever ended the
process that wrote it.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest
from bench_fixtures import SMALL

from simbench.bench.execute.run import run_grid
from simbench.bench.store.place import place_of
from simbench.bench.store.reading import read_table

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the servers
METHODS = ["he", "yamashita"]
CODE = """
import json, sys
from simbench.scenarios.grid import make_grid
from simbench.bench.execute.run import run_grid
grid = make_grid(json.loads(sys.argv[2]), "small", {"repeats": 2})
run_grid(grid, sys.argv[1], ["he", "yamashita"])
"""


@pytest.fixture(scope="module")
def s3():
    pytest.importorskip("s3fs")
    server = pytest.importorskip("moto.server").ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    host, port = server.get_host_and_port()
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {
            "ACCESS_KEY_ID": "k",
            "SECRET_ACCESS_KEY": "s",
            "DEFAULT_REGION": "us-east-1",
        }.items():
            patch.setenv(f"AWS_{name}", value)
        patch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
        yield "s3://bucket"
    server.stop()


@pytest.fixture(scope="module")
def ftp(tmp_path_factory):
    authorizers = pytest.importorskip("pyftpdlib.authorizers")
    from pyftpdlib.handlers import FTPHandler
    from pyftpdlib.servers import ThreadedFTPServer

    users = authorizers.DummyAuthorizer()
    users.add_user("me", "secret", str(tmp_path_factory.mktemp("ftp")), perm="elradfmwMT")
    handler = type("Handler", (FTPHandler,), {"authorizer": users})
    listening = socket.create_server(("127.0.0.1", 0))
    server = ThreadedFTPServer(listening, handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"ftp://me:secret@127.0.0.1:{listening.getsockname()[1]}"
    server.close_all()


@pytest.fixture(params=["s3", "ftp"])
def server(request):
    return request.getfixturevalue(request.param)


def same(one, other) -> bool:
    kinds = ("scenarios", "verdicts")
    tables = [[read_table(run, kind) for kind in kinds] for run in (one, other)]
    return all(
        a.equals(b) or a.drop_columns(["runtime_s"]).equals(b.drop_columns(["runtime_s"]))
        for a, b in zip(*tables)
    )


def test_a_run_on_a_server_has_the_bits_of_one_on_disk(server, small, finished):
    run = run_grid(small, f"{server}/whole", METHODS)
    assert same(run, finished)
    assert place_of(run).names() == sorted(f.name for f in finished.iterdir())
    assert b"secret" not in place_of(run).read("manifest.json")


def test_a_killed_run_goes_on_where_it_stopped(server, small, finished):
    url = f"{server}/killed"
    process = subprocess.Popen([sys.executable, "-c", CODE, url, json.dumps(SMALL)], env=os.environ)
    deadline = time.monotonic() + 120
    while len(place_of(url).names("receipts")) < 2 and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    run_grid(small, url, METHODS, resume=True)
    assert same(url, finished)
    assert place_of(url).names() == sorted(f.name for f in finished.iterdir())
