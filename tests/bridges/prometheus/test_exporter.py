"""The exporter serves what the service counted and wrote down."""

import http.client
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from prometheus_client.parser import text_string_to_metric_families

from armguard.bridges.prometheus.metrics import (
    COUNTS,
    EDGES,
    GAUGES,
    TIMES,
    buckets_of,
    reason_name,
)
from armguard.guard import layout
from armguard.guard.layout import IN_HEADER, IN_ROBOT
from armguard.guard.levels import Reason
from armguard.recording.counters import (
    BUCKETS,
    COUNTERS,
    FIRST_CAUSE,
    HISTOGRAMS,
    CountersReader,
    Histogram,
    bucket_of,
    counters_path,
)
from armguard.recording.frames import Kind, frame_of
from armguard.recording.ring import RingReader, beat, end_pulse
from armguard.service.client import Client
from armguard.service.wire import Cause

# Nothing here takes longer than that, whatever else the machine does [s].
PATIENCE = 120.0

# State of a socket that listens, as Linux reports it.
LISTENS = "0A"


def started(*words):
    """A module as a process, and the first line it wrote."""
    process = subprocess.Popen(
        [sys.executable, "-m", *words], stdout=subprocess.PIPE, text=True
    )
    watch = threading.Timer(PATIENCE, process.kill)
    watch.start()
    line = process.stdout.readline()
    watch.cancel()
    return process, line


class Station(NamedTuple):
    """What runs."""

    service: subprocess.Popen
    ring: Path
    page: str
    exporter: subprocess.Popen


@pytest.fixture(scope="module")
def station():
    """A service of the bay that has been busy, and an exporter beside it."""
    words = ("armguard", "serve", "bay", "--port", "0", "--no-self-test")
    service, line = started(*words)
    port = int(line.partition(",")[0].rpartition(":")[2])
    ring = Path(line.strip().rpartition("ring ")[2])
    exporter, line = started(
        *("armguard.bridges.prometheus", "--ring", str(ring), "--port", "0"),
        *("--counters", str(counters_path(ring))),
    )
    page = line.split()[-1]
    with Client(port, name="test") as client:
        client.connect()
        home = client.welcome.home
        for _ in range(100):
            client.cycle(home, np.zeros(len(home)), velocity=np.zeros(len(home)))
            time.sleep(0.004)
        # A WISH without the token, a datagram that is no message, an ordered stop.
        with Client(port, name="other") as other:
            other.connect()
            other.send_velocities(np.zeros(len(home)))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            for _ in range(3):
                stranger.sendto(b"x" * 100, ("127.0.0.1", port))
        client.stop()
        for _ in range(10):
            client.cycle(home, np.zeros(len(home)), velocity=np.zeros(len(home)))
            time.sleep(0.004)
        # No process counts while the loop is paused.
        service.send_signal(signal.SIGSTOP)
        yield Station(service, ring, page, exporter)
    for process in (exporter, service):
        process.kill()
        process.communicate(timeout=PATIENCE)


@pytest.fixture(scope="module")
def scraped(station):
    """What was scraped, by name of the sample and labels."""
    with urllib.request.urlopen(station.page, timeout=PATIENCE) as answer:
        text = answer.read().decode()
    return {
        (sample.name, *sorted(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def test_every_counter_is_exported(station, scraped):
    values = CountersReader(counters_path(station.ring)).values()
    for name in COUNTERS:
        if name.startswith("dropped_"):
            cause = name.removeprefix("dropped_")
            found = scraped[("armguard_messages_dropped_total", ("cause", cause))]
        elif name in GAUGES:
            found = scraped[(f"armguard_{name}",)]
        else:
            assert name in COUNTS
            found = scraped[(f"armguard_{name}_total",)]
        assert found == values[name], name
    assert values["dropped_magic"] == 3
    assert values["dropped_not_commander"] == 1
    assert values["stop_orders"] == 1
    assert values["cycles"] >= 100


def test_stops_are_counted_by_name(station, scraped):
    stops = CountersReader(counters_path(station.ring)).stops()
    assert stops
    for number, count in stops.items():
        key = ("armguard_stops_total", ("reason", reason_name(number)))
        assert scraped[key] == count


def test_times_are_a_histogram_with_all_of_them(station, scraped):
    reader = CountersReader(counters_path(station.ring))
    assert set(TIMES) == set(HISTOGRAMS)
    for name in HISTOGRAMS:
        found = reader.histogram(name)
        first = f"armguard_{name}_seconds"
        assert scraped[(f"{first}_count",)] == found.count > 0
        assert scraped[(f"{first}_sum",)] == pytest.approx(found.total)
        buckets = {
            float(key[1][1]): value
            for key, value in scraped.items()
            if key[0] == f"{first}_bucket"
        }
        counts = [buckets[edge] for edge in sorted(buckets)]
        assert counts == sorted(counts) and counts[-1] == found.count
        # The median lies where the finer buckets have it.
        median = found.percentile(0.5)
        below = [edge for edge in buckets if edge < 0.94 * median]
        assert all(buckets[edge] <= 0.5 * found.count for edge in below)
        assert buckets[min(e for e in buckets if e >= median)] >= 0.5 * found.count


def test_the_newest_cycle_is_exported(station, scraped):
    frame = None
    for row in RingReader(station.ring).unread():
        found = frame_of(row)
        frame = found if found.kind == Kind.CYCLE else frame
    assert scraped[("armguard_last_cycle",)] == frame.cycle
    assert scraped[("armguard_time_left_seconds",)] == pytest.approx(
        frame.verdict[IN_HEADER.least_time_left]
    )
    for r, robot in enumerate(("left", "right")):
        row = frame.verdict[layout.HEADER + r * layout.ROBOT_WIDTH :]
        for name, place in (
            ("robot_level", IN_ROBOT.level),
            ("robot_speed_scale", IN_ROBOT.scale),
            ("robot_state_age_seconds", IN_ROBOT.age),
        ):
            assert scraped[(f"armguard_{name}", ("robot", robot))] == row[place]
    # At home nothing is near.
    assert scraped[("armguard_nearest_headroom_metres",)] > 0.0
    about = [key for key in scraped if key[0] == "armguard_scene_info"]
    assert len(about) == 1 and ("version" in dict(about[0][1:]))


def test_silence_of_the_loop_is_seen(station, scraped):
    """The service is paused: the age of its last cycle grows."""
    before = scraped[("armguard_last_cycle_age_seconds",)]
    time.sleep(0.1)
    with urllib.request.urlopen(station.page, timeout=PATIENCE) as answer:
        text = answer.read().decode()
    (line,) = [
        line
        for line in text.splitlines()
        if line.startswith("armguard_last_cycle_age_seconds ")
    ]
    assert float(line.split()[1]) >= before + 0.1


def test_the_process_is_exported(station, scraped):
    assert scraped[("armguard_process_resident_memory_bytes",)] > 1e7
    assert scraped[("armguard_process_open_fds",)] > 0


def test_a_port_that_is_taken_is_said_in_words(station):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        words = ("armguard.bridges.prometheus", "--ring", str(station.ring))
        found = subprocess.run(
            [sys.executable, "-m", *words, "--port", port],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
    assert found.returncode == 2
    assert f"127.0.0.1:{port}" in found.stderr


def test_without_a_service_it_ends_with_a_sentence(tmp_path):
    words = ("armguard.bridges.prometheus", "--ring", str(tmp_path / "none"))
    found = subprocess.run(
        [sys.executable, "-m", *words, "--port", "0", "--wait", "0.1"],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert found.returncode == 2
    assert "no ring is there" in found.stderr


def test_edges_of_buckets_split_no_count():
    """Each bucket of the service is below an edge as a whole, or above it."""
    for edge in EDGES:
        assert bucket_of(edge - 1) == bucket_of(edge) - 1
    counts = np.zeros(BUCKETS, np.int64)
    rng = np.random.default_rng(5)
    values = np.exp(rng.uniform(np.log(1e3), np.log(1e9), 3000)).astype(int)
    for value in values:
        counts[bucket_of(int(value))] += 1
    rows = buckets_of(Histogram(counts, len(values), 0.0, 1.0))
    for (name, found), edge in zip(rows[:-1], EDGES, strict=True):
        assert float(name) == pytest.approx(edge * 1e-9)
        assert found == (values < edge).sum()
    assert rows[-1] == ("+Inf", len(values))


def test_reasons_have_names():
    assert reason_name(Reason.STATE_STALE) == "STATE_STALE"
    assert reason_name(FIRST_CAUSE + Cause.FAULT) == "FAULT"
    assert reason_name(199) == "199"


def test_the_page_is_on_loopback_only(station):
    """Only this machine can read the metrics."""
    port = int(station.page.rpartition(":")[2].partition("/")[0])
    rows = Path("/proc/net/tcp").read_text(encoding="ascii").splitlines()[1:]
    here = [row.split()[1] for row in rows if row.split()[3] == LISTENS]
    assert [a for a in here if a.endswith(f":{port:04X}")] == [f"0100007F:{port:04X}"]


@pytest.mark.parametrize(
    ("host", "code"),
    [
        ("127.0.0.1:{port}", 200),
        ("localhost:{port}", 200),
        ("evil.example:{port}", 421),
        ("evil.example", 421),
        ("127.0.0.1", 421),
        ("127.0.0.1:1", 421),
        ("127.0.0.1:{port}.evil.example", 421),
        ("", 421),
    ],
)
def test_a_page_that_calls_itself_this_machine_gets_no_answer(station, host, code):
    port = int(station.page.rpartition(":")[2].split("/")[0])
    ask = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    ask.putrequest("GET", "/metrics", skip_host=True)
    if host:
        ask.putheader("Host", host.format(port=port))
    ask.endheaders()
    answer = ask.getresponse()
    assert answer.status == code
    assert (b"armguard_cycles" in answer.read()) is (code == 200)
    ask.close()


def test_the_age_of_the_recording_is_exported_where_there_is_one(station):
    def ages():
        with urllib.request.urlopen(station.page, timeout=PATIENCE) as answer:
            lines = answer.read().decode().splitlines()
        return [
            float(line.split()[1])
            for line in lines
            if line.startswith("armguard_recorder_age_seconds ")
        ]

    assert ages() == []
    beat(station.ring)
    (age,) = ages()
    assert 0.0 <= age < PATIENCE
    assert ages()[0] > age
    end_pulse(station.ring)
    assert ages() == []


def test_it_ends_with_the_service(station):
    """Also with one that was killed, so that nothing keeps the port; the last test."""
    station.service.kill()
    station.service.communicate(timeout=PATIENCE)
    assert station.exporter.wait(PATIENCE) == 0
    for path in (station.ring, counters_path(station.ring)):
        path.unlink(missing_ok=True)
