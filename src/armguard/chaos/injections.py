"""Fault injection into a running guard: one function a kind of fault."""

import os
import signal
import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

from armguard.chaos.fault import Injection, Unplayable
from armguard.chaos.playground import Playground
from armguard.chaos.relay import Tamper, honest
from armguard.chaos.tampering import kind_of
from armguard.errors import NoServiceError, RefusedError
from armguard.geometry.pose import Pose
from armguard.service.client import Client
from armguard.service.wire import Cause, Kind, Outbox, Role, Seal
from armguard.service.wire.keys import keys_path
from armguard.service.wire.layout import HELLO, MOST, NO_COOKIE

# Readers that never read.
SLOW_READERS = 10

# Longest time a service takes to find that its port is taken [s].
LONG = 60.0

# What is seen of a clock before it is set back [s].
BEFORE = 0.1

# States and desired motions an intruder sends, and every how many seconds.
INTRUDES, EVERY = 40, 0.005


def tampered(make: Callable[[Playground], Tamper]) -> Injection:
    """The relay does something to messages."""

    @contextmanager
    def inject(ground: Playground) -> Iterator[None]:
        relay = ground.relay
        relay.tamper = make(ground)
        try:
            yield
        finally:
            relay.tamper = honest

    return inject


def killed(name: str) -> Injection:
    """A process is killed, kill -9, and started anew afterwards."""

    @contextmanager
    def inject(ground: Playground) -> Iterator[None]:
        crew = ground.stage.crew
        crew.send(name, signal.SIGKILL)
        crew[name].wait()
        yield
        if name == "service":
            ground.stage.start_service()
            ground.listen_again()
        elif name == "arms":
            ground.start_arms()
        else:
            ground.start_operator()

    return inject


def paused(name: str) -> Injection:
    """A process is stopped for a while, SIGSTOP, as by a debugger or a full machine."""

    @contextmanager
    def inject(ground: Playground) -> Iterator[None]:
        ground.stage.crew.send(name, signal.SIGSTOP)
        try:
            yield
        finally:
            ground.stage.crew.send(name, signal.SIGCONT)

    return inject


@contextmanager
def ended(ground: Playground) -> Iterator[None]:
    """The service is ended, SIGTERM, and started anew afterwards."""
    ground.stage.crew.send("service", signal.SIGTERM)
    yield
    ground.stage.crew.end_one("service")
    ground.stage.start_service()
    ground.listen_again()


@contextmanager
def second_commander(ground: Playground) -> Iterator[None]:
    """A client whose claim is refused sends desired motion all the same."""
    with Client(ground.stage.port, name="second commander", every=0) as other:
        other.connect()
        try:
            other.claim()
        except RefusedError:
            pass
        for _ in range(INTRUDES):
            other.send_velocities([9.0] * len(other.welcome.names))
            ground.watch(EVERY)
        yield


@contextmanager
def second_controller(ground: Playground) -> Iterator[None]:
    """Another client sends states of the same robots."""
    with Client(ground.stage.port, name="second controller", every=0) as other:
        other.connect()
        for _ in range(INTRUDES):
            other.send_state([0.1] * len(other.welcome.names))
            ground.watch(EVERY)
        if not other.latest.stops:
            raise AssertionError("the second controller is not stopped")
        yield


@contextmanager
def observer_commands(ground: Playground) -> Iterator[None]:
    """A client with the key for 'observe' claims with force, and sends all there is."""
    with Client(
        ground.stage.port, role=Role.OBSERVE, name="observer", every=0
    ) as other:
        other.connect()
        try:
            other.claim(force=True)
        except RefusedError:
            pass
        else:
            raise AssertionError("an observer has the command")
        for _ in range(INTRUDES):
            other.send_state([0.1] * len(other.welcome.names))
            other.send_velocities([9.0] * len(other.welcome.names))
            ground.watch(EVERY)
        yield


@contextmanager
def without_key(ground: Playground) -> Iterator[None]:
    """A client without a key says hello, and orders a stop."""
    outbox = Outbox(Seal(b"armguard-public-"), 4711)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.connect(("127.0.0.1", ground.stage.port))
        for _ in range(INTRUDES):
            for role in Role:
                hello = HELLO.pack(role, 1, NO_COOKIE)
                one.send(outbox.message(Kind.HELLO, hello))
            one.send(outbox.message(Kind.STOP))
            ground.watch(EVERY)
        if is_answered(one, Kind.CHALLENGE, Kind.WELCOME):
            raise AssertionError("a client without a key is answered")
        yield


@contextmanager
def hello_replayed(ground: Playground) -> Iterator[None]:
    """Both HELLOs of a client are sent again, from elsewhere, after it has left."""
    relay, heard = ground.relay, list[bytes]()

    def overhear(message: bytes, up: bool) -> Sequence[tuple[float, bytes]]:
        if up and kind_of(message) == Kind.HELLO:
            heard.append(message)
        return honest(message, up)

    relay.tamper = overhear
    try:
        keys = keys_path(ground.stage.port)
        with Client(relay.port, role=Role.OBSERVE, keys=keys, every=0) as other:
            other.connect()
    finally:
        relay.tamper = honest
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.connect(("127.0.0.1", ground.stage.port))
        for _ in range(INTRUDES):
            for message in heard:
                one.send(message)
            ground.watch(EVERY)
        if is_answered(one, Kind.WELCOME):
            raise AssertionError("a HELLO that was overheard is answered")
        yield


def is_answered(one: socket.socket, *kinds: Kind) -> bool:
    """Whether a message of one of some kinds came in."""
    one.setblocking(False)
    with suppress(OSError):
        while True:
            if kind_of(one.recv(MOST)) in kinds:
                return True
    return False


@contextmanager
def fixtures_removed(ground: Playground) -> Iterator[None]:
    """Clients remove what the scene does not call movable, with all keys there are."""
    objects = ground.scene.objects.items()
    names = [name for name, one in objects if not one.movable]
    if not names:
        raise Unplayable("the scene has no fixture")
    for role in Role:
        with Client(ground.stage.port, role=role, name="remover", every=0) as other:
            other.connect()
            for name in names:
                try:
                    other.call("remove", name=name)
                except RefusedError:
                    continue
                raise AssertionError(f"a client for '{role.word}' has removed '{name}'")
    yield


@contextmanager
def object_placed(ground: Playground) -> Iterator[None]:
    """A sensor places an object far from the arms; every answer says so."""
    objects = ground.scene.objects
    free = [name for name, one in objects.items() if one.movable and not one.present]
    if not free:
        raise Unplayable("the scene has no movable object that is not there yet")
    with Client(ground.stage.port, role=Role.SENSE, name="camera", every=0) as sensor:
        sensor.connect()
        seen: dict[str, Any] = {"name": free[0], "pose": Pose(xyz=FAR)}
        if objects[free[0]].top_speed > 0.0:
            # Where a moving object may be counts from when it was seen.
            seen["stamp"] = sensor.clock()
        sensor.call("place", **seen)
        yield
        ground.watch_until(lambda: any(a.objects_changed for a in ground.answers), BACK)
        if not any(answer.objects_changed for answer in ground.answers):
            raise AssertionError("the answers do not say that an object was placed")
        sensor.call("remove", name=free[0])


def wrongly_seen(
    wrong: Callable[[float], Mapping[str, Any]], refused: str
) -> Injection:
    """A sensor sees an object that moves, and then sees it as it cannot be.

    Args:
        wrong: What of the second sighting is wrong, by the time of the first.
        refused: Name of the reason that the service gives.
    """

    @contextmanager
    def inject(ground: Playground) -> Iterator[None]:
        objects = ground.scene.objects.items()
        moving = [name for name, one in objects if one.top_speed and not one.present]
        if not moving:
            raise Unplayable("the scene has no object with a top_speed to be placed")
        with Client(ground.stage.port, role=Role.SENSE, name="eye", every=0) as sensor:
            sensor.connect()
            seen: dict[str, Any] = {"name": moving[0], "pose": Pose(xyz=FAR)}
            first = sensor.clock()
            sensor.call("place", **seen, stamp=first)
            try:
                sensor.call("place", **{**seen, "stamp": first, **wrong(first)})
            except RefusedError as error:
                if error.reason != refused:
                    raise AssertionError(f"it was refused for {error}") from error
            else:
                raise AssertionError("a sighting that cannot be true was believed")
            yield
            sensor.call("remove", name=moving[0])

    return inject


@contextmanager
def calls_flood(ground: Playground) -> Iterator[None]:
    """An observer calls all the time, and does not wait for replies."""
    with Client(ground.stage.port, role=Role.OBSERVE, name="caller", every=0) as other:
        other.connect()
        for _ in range(INTRUDES):
            for _ in range(CALLS_AT_ONCE):
                with suppress(NoServiceError):
                    other.call("why", timeout=AT_ONCE)
            ground.watch(EVERY)
        yield


@contextmanager
def clients_come_and_go(ground: Playground) -> Iterator[None]:
    """Many clients connect and say good-bye, more than there is room for at a time."""
    for _ in range(COME):
        with Client(ground.stage.port, role=Role.OBSERVE, every=0) as one:
            one.connect()
        ground.watch(0.0)
    yield


@contextmanager
def killed_and_back(ground: Playground) -> Iterator[None]:
    """The service is killed in motion, kill -9, and is there again at once."""
    crew = ground.stage.crew
    crew.send("service", signal.SIGKILL)
    crew["service"].wait()
    ground.stage.start_service()
    ground.listen_again()
    ground.watch_until(lambda: says(ground, Cause.RESTARTED), BACK)
    if not says(ground, Cause.RESTARTED):
        raise AssertionError("the service does not say that it follows a killed one")
    yield


def says(ground: Playground, cause: Cause) -> bool:
    """Whether an answer has a cause."""
    return any(answer.cause is cause for answer in ground.answers)


@contextmanager
def stop_ordered(ground: Playground) -> Iterator[None]:
    """An observer orders a stop."""
    ground.stage.client.stop()
    yield


@contextmanager
def slow_readers(ground: Playground) -> Iterator[None]:
    """Clients that want every answer and never read one."""
    with ExitStack() as stack:
        for k in range(SLOW_READERS):
            one = stack.enter_context(Client(ground.stage.port, name=f"sleeper {k}"))
            one.connect()
            ground.watch(0.0)
        yield


@contextmanager
def port_taken(ground: Playground) -> Iterator[None]:
    """A second service is started on the same port; it has to give up in words."""
    words = ("-m", "armguard", "serve", "bay", "--port", str(ground.stage.port))
    log = ground.folder / "second service"
    with log.open("wb") as file:
        second = ground.stage.crew.start("second service", words, log=file)
    ground.watch_until(lambda: second.poll() is not None, LONG)
    code, text = second.poll(), log.read_text(errors="replace")
    if code != 2 or "port" not in text:
        raise AssertionError(
            f"a second service on a port that is taken ends with code {code}: "
            f"{text.strip()[-200:]}"
        )
    # Its start kept this machine busy; what counts is that the first one goes on.
    ground.settle()
    ground.begin()
    yield


@contextmanager
def flooded(ground: Playground) -> Iterator[None]:
    """Datagrams that are no messages arrive as fast as they can be sent."""
    noise = [bytes([k]) * (23 * k) for k in range(1, 50)]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        for _ in range(10):
            for message in noise:
                one.sendto(message, ("127.0.0.1", ground.stage.port))
            ground.watch(EVERY)
        yield


# An object in a corner of the bay, where no arm reaches [m].
FAR = (1.1, 1.1, 0.1)

# Another one, which nothing gets to in a cycle.
FARTHER = (1.1, -1.1, 0.1)

# Calls made at once, more than a client has between two heartbeats, and how long it
# waits for each reply [s].
CALLS_AT_ONCE, AT_ONCE = 30, 1e-4

# Clients that come and go.
COME = 200

# Longest time until arms hear of a service that is back, and until answers or frames
# show the injection [s].
BACK = 30.0

# The service with a wall clock that goes back by an hour when a file is there.
SET_BACK = """
import sys, time
from itertools import pairwise
from pathlib import Path
path, real, seen = Path(sys.argv.pop(1)), time.time, [False]
def time_of_day():
    seen[0] = seen[0] or path.exists()
    return real() - 3600.0 if seen[0] else real()
time.time = time_of_day
from armguard.cli import main
main()
"""


@contextmanager
def wall_clock_set_back(ground: Playground) -> Iterator[None]:
    """The service's wall clock goes back by an hour; it is recorded, nothing else."""
    path = ground.folder / "set back"
    ground.restart("-c", SET_BACK, str(path))
    ground.settle()
    frames = ground.stage.frames()
    ground.watch(BEFORE)
    ground.begin()
    path.touch()
    yield
    walls: list[float] = []

    def went_back() -> bool:
        walls.extend(row[3] for row in frames.unread())
        return any(b < a - 3000.0 for a, b in pairwise(walls))

    ground.watch_until(went_back, BACK)
    if not went_back():
        raise AssertionError("the frames do not show that the wall clock went back")


def companion_killed(name: str, module: str, option: Sequence[str]) -> Injection:
    """A process beside the service is killed."""

    @contextmanager
    def inject(ground: Playground) -> Iterator[None]:
        words = [word.format(folder=ground.folder) for word in option]
        ground.restart(options=tuple(words))
        ground.settle()
        found = [
            pid
            for pid in children(ground.stage.crew["service"].pid)
            if module in (Path(f"/proc/{pid}/cmdline").read_text(errors="replace"))
        ]
        if not found:
            raise Unplayable(f"the service started no '{name}' on this machine")
        ground.begin()
        for pid in found:
            signal_process(pid)
        yield

    return inject


def children(pid: int) -> list[int]:
    """Processes that a process has started, as Linux reports them.

    Raises:
        Unplayable: Linux does not report them.
    """
    try:
        text = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii")
    except OSError as error:
        raise Unplayable(f"this machine does not report children: {error}") from error
    return [int(word) for word in text.split()]


def signal_process(pid: int) -> None:
    """Kill a process that is none of our own children."""
    os.kill(pid, signal.SIGKILL)
