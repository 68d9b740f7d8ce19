"""Engines: the same bytes, inputs that end their process, and work that goes on."""

import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from armguard.fleet import engine as engines
from armguard.fleet import manifest as manifests
from armguard.fleet import worker as workers
from armguard.fleet.engine import Cluster, Here, Processes, Tls, check_address
from armguard.fleet.job import FleetError, JobModel
from armguard.fleet.manifest import Manifest
from armguard.fleet.run import run_job
from armguard.fleet.store import part_of, query
from armguard.processes import Crew
from datasets_of_fleets import write_dataset

# Time for a scheduler or a worker to start [s].
PATIENCE = 60.0


@pytest.fixture
def shards(monkeypatch):
    """About three episodes are a shard."""
    monkeypatch.setattr(manifests, "SHARD_SECONDS", 7e-3)


def job_of(folder, *inputs, **more):
    job = JobModel(inputs=[*inputs], scenes=["cell.yaml"], **more)
    return Manifest.of("audit", job, folder)


def episodes(count, seed=0):
    """Episodes that begin at home; some touch the ball."""
    rng = np.random.default_rng(seed)
    share = np.linspace(0.0, 1.0, 40)[:, None]
    return [
        [-1.0, 0.0] + share * rng.uniform([-0.5, -1.0], [2.5, 1.0])
        for _ in range(count)
    ]


def parts(out):
    """Bytes of all parts by name."""
    return {path.name: path.read_bytes() for path in sorted(out.glob("part-*"))}


@contextmanager
def cluster(count, *tls):
    """A scheduler and so many workers: its address, and their processes."""
    with Crew() as crew:
        with open_log("scheduler") as log:
            crew.start("s", cli("scheduler", "--port", "0", *tls), log=log)
        address = line_of("scheduler")
        for k in range(count):
            with open_log(f"worker{k}") as log:
                crew.start(f"w{k}", cli("worker", address, *tls), log=log)
        for k in range(count):
            line_of(f"worker{k}")
        yield address, crew


def cli(*words):
    return ["-m", "armguard", "fleet", *words]


def open_log(name):
    return Path(f"{name}.log").open("wb")


def line_of(name):
    """The address that a program printed first."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        lines = Path(f"{name}.log").read_text().splitlines()
        found = [line for line in lines if line.startswith(("tcp://", "tls://"))]
        if found:
            return found[0]
        time.sleep(0.1)
    raise AssertionError(Path(f"{name}.log").read_text())


def test_engines_write_the_same_bytes_and_other_code_is_refused(
    cell, moving, shards, monkeypatch
):
    """A real cluster of two worker processes, of which one is killed, is among them."""
    write_dataset(cell / "d", "v3.0", episodes(14), per_file=5)
    made = job_of(cell, "d")
    assert len(made.ends) == 5
    first = run_job(made, cell / "here", Here())
    right = parts(cell / "here")
    assert (first.items, first.shards, first.before) == (14, 5, 0)
    assert 0 < first.clear < 14
    assert run_job(made, cell / "two", Processes(2)).items == 14
    assert parts(cell / "two") == right
    with cluster(2) as (address, crew):

        def kill_one(_):
            if crew.lives("w0"):
                # Its nanny would start it again.
                os.killpg(crew["w0"].pid, signal.SIGKILL)

        # What a killed worker began, the other one does.
        found = run_job(made, cell / "dask", Cluster(address), kill_one)
        crew["w0"].wait()
        assert found.items == 14
        assert parts(cell / "dask") == right
        # A closed loop on a cluster is the one in this process.
        (cell / "loops.yaml").write_text(moving)
        job = JobModel(inputs=["random:0-1"], scenes=["loops.yaml"], duration=0.5)
        loops = Manifest.of("run", job, cell)
        for name, engine in (("far", Cluster(address)), ("near", Here())):
            assert run_job(loops, cell / name, engine).failed == 0
        assert len(parts(cell / "far")) == 2
        assert parts(cell / "far") == parts(cell / "near")
        # To a command of other code, these workers have other code.
        monkeypatch.setattr(engines, "code_digest", lambda: "0.0.0-other")
        with pytest.raises(
            FleetError,
            match=r"worker tcp://\S+ has the code \S+, this command 0.0.0",
        ):
            run_job(made, cell / "refused", Cluster(address))
        assert not parts(cell / "refused")


def test_a_worker_refuses_the_work_of_other_code(cell, shards, monkeypatch):
    write_dataset(cell / "d", "v2.1", episodes(3))
    made = job_of(cell, "d")
    monkeypatch.setattr(workers, "code_digest", lambda: "0.0.0-other")
    with pytest.raises(FleetError, match=r"worker .*:\d+: it has the code 0.0.0-other"):
        run_job(made, cell / "out", Here())
    assert not parts(cell / "out")


def test_inputs_that_end_their_process_are_named_and_all_others_are_done(
    cell, monkeypatch, poisoned
):
    """One kills its process, one never ends, one needs more memory than there is."""
    monkeypatch.setattr(manifests, "SHARD_SECONDS", 2.9e-4)
    monkeypatch.setattr(workers, "LEAST_LIMIT", 1.5)
    rows = [np.array([[-1.0, 0.0], [-0.9, 0.1], [-0.8, 0.2]]) for _ in range(9)]
    for k, name in enumerate("abcdefghi"):
        np.save(cell / f"{name}.npy", rows[k])
    (cell / "b.npy").rename(cell / "b-kills.npy")
    (cell / "e.npy").rename(cell / "e-hangs.npy")
    # A file of four gigabytes that takes no room on the disk.
    np.save(cell / "g.npy", np.zeros((0, 2)))
    head = np.lib.format.header_data_from_array_1_0(np.zeros((0, 2)))
    with (cell / "g.npy").open("wb") as file:
        np.lib.format.write_array_header_1_0(file, head | {"shape": (1 << 28, 2)})
        file.truncate(file.tell() + (1 << 32))
    made = job_of(cell, "*.npy", memory=0.5, time_limit=1.5, guard=False)
    found = run_job(made, cell / "out", Processes(2))
    assert (found.items, found.failed) == (9, 3)
    _, bad = query(
        cell / "out",
        "select input, error from results where error is not null order by item",
    )
    assert bad == [
        ("b-kills.npy", "it ended its process by SIGSEGV"),
        ("e-hangs.npy", "there was no answer within the time limit"),
        ("g.npy", "its memory ran out"),
    ]
    _, good = query(cell / "out", "select count(*) from results where clear")
    assert good == [(6,)]


def test_work_goes_on_where_a_killed_client_left_it(cell, monkeypatch):
    """Nothing is lost and nothing is there twice."""
    monkeypatch.setattr(manifests, "SHARD_SECONDS", 1e-4)
    write_dataset(cell / "d", "v2.1", episodes(14))
    code = (
        "from armguard.fleet import manifest\n"
        "manifest.SHARD_SECONDS = 1e-4\n"
        "from armguard.cli import main\n"
        "main()\n"
    )
    words = ["fleet", "audit", "d", "--scene", "cell.yaml", "--no-guard", "--out"]
    client = subprocess.Popen([sys.executable, "-c", code, *words, "out"])
    end = time.monotonic() + PATIENCE
    while not parts(cell / "out") and time.monotonic() < end:
        time.sleep(0.005)
    client.kill()
    client.wait()
    made, out = job_of(cell, "d", guard=False), cell / "out"
    # The worker of the killed client ends with it, and may end a part before.
    before = parts(out)
    assert 0 < len(before) < 14
    # A part that is lost is done again.
    part_of(out, 0).unlink()
    done = []
    again = run_job(made, out, Here(), lambda receipt: done.append(receipt.number))
    assert again.items == 14 and again.before + len(done) == 14
    right = parts(out)
    assert len(right) == 14 and before.items() <= right.items()
    _, found = query(out, "select count(*), count(distinct item) from results")
    assert found == [(14, 14)]
    assert not [*out.glob(".part-*")]


def test_results_of_another_job_are_refused(cell, shards, fleet):
    write_dataset(cell / "d", "v2.1", episodes(3))
    words = ["audit", "d", "--scene", "cell.yaml", "--no-guard", "--out", "out"]
    assert fleet(*words)[0] in (0, 1)
    kept = (cell / "cell.yaml").read_text()

    def refused(*more):
        return fleet(*words, *more)[1]

    assert "other settings" in refused("--set", "scene.buffer=0.01")
    (cell / "cell.yaml").write_text(kept.replace("buffer: 0.02", "buffer: 0.03"))
    assert "a scene changed" in refused()
    (cell / "cell.yaml").write_text(kept)
    file = cell / "d" / "data" / "chunk-000" / "episode_000001.parquet"
    state = file.stat()
    os.utime(file, ns=(state.st_atime_ns, state.st_mtime_ns + 1))
    assert "input d, episode 1 changed" in refused()
    os.utime(file, ns=(state.st_atime_ns, state.st_mtime_ns))
    part = part_of(cell / "out", 0)
    whole = part.read_bytes()
    part.write_bytes(b"PAR1")
    assert "it is no Parquet file" in refused()
    # A part of the same length, of another manifest.
    part.write_bytes(
        whole.replace(Manifest.read(cell / "out").hash.encode(), b"0" * 64)
    )
    assert "it was written for another job, or by other code" in refused()
    part.write_bytes(whole)
    path = cell / "out" / "manifest.json"
    path.write_text(path.read_text().replace("0.05", "0.06"))
    assert "it was changed" in refused()


def test_a_full_disk_ends_the_work_and_loses_nothing(cell, monkeypatch):
    """After the first part no file may grow: so the system refuses the second."""
    monkeypatch.setattr(manifests, "SHARD_SECONDS", 5e-4)
    write_dataset(cell / "d", "v2.1", episodes(14))
    made, out = job_of(cell, "d", guard=False), cell / "out"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        with pytest.raises(FleetError, match=r"part-00001.*free space"):
            run_job(
                made,
                out,
                Here(),
                lambda _: resource.setrlimit(resource.RLIMIT_FSIZE, (16, limits[1])),
            )
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [*parts(out)] == ["part-00000.parquet"]
    assert run_job(made, out, Here()).before == 1


@pytest.mark.parametrize(
    ("address", "sentence"),
    [
        ("tcp://192.0.2.1:8786", "is not on this machine"),
        ("tcp://example.org:8786", "is not on this machine"),
        ("tls://192.0.2.1:8786", "give --tls-ca"),
        ("http://127.0.0.1:8786", "is no address"),
        ("127.0.0.1:8786", "is no address"),
    ],
)
def test_an_address_that_others_reach_needs_tls(address, sentence):
    with pytest.raises(FleetError, match=sentence):
        check_address(address, None)


@pytest.mark.skipif(not shutil.which("openssl"), reason="there is no openssl")
def test_a_cluster_with_tls_admits_none_with_another_certificate(
    cell, shards, monkeypatch
):
    for name in ("own", "other"):
        subprocess.run(
            [
                *("openssl", "req", "-x509", "-newkey", "ec", "-nodes", "-days", "2"),
                *("-pkeyopt", "ec_paramgen_curve:prime256v1", "-subj", "/CN=localhost"),
                *("-keyout", f"{name}.key", "-out", f"{name}.pem"),
            ],
            check=True,
            capture_output=True,
        )
    own, other = (
        Tls(Path(f"{n}.pem"), Path(f"{n}.pem"), Path(f"{n}.key"))
        for n in ("own", "other")
    )
    write_dataset(cell / "d", "v3.0", episodes(4), per_file=5)
    made, flags = job_of(cell, "d"), ("ca", "cert", "key")
    words = [w for f in flags for w in (f"--tls-{f}", str(getattr(own, f)))]
    run_job(made, cell / "here", Here())
    with cluster(1, *words) as (address, _):
        assert address.startswith("tls://127.0.0.1:")
        run_job(made, cell / "dask", Cluster(address, own))
        assert parts(cell / "dask") == parts(cell / "here")
        monkeypatch.setattr(engines, "PATIENCE", 2.0)
        with pytest.raises(FleetError, match=r"no scheduler .*certificate does not"):
            run_job(made, cell / "wrong", Cluster(address, other))
        plain = address.replace("tls", "tcp")
        with pytest.raises(FleetError, match="no scheduler with a worker answers"):
            run_job(made, cell / "wrong", Cluster(plain))
        assert not parts(cell / "wrong")


def test_a_scheduler_that_does_not_answer(cell, shards, monkeypatch):
    monkeypatch.setattr(engines, "PATIENCE", 1.0)
    with pytest.raises(FleetError, match="no scheduler with a worker answers"):
        Cluster("tcp://127.0.0.1:9").open()
