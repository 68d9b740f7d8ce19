"""Attacks on the service's port: keys, roles, replayed messages, fixtures, floods."""

import itertools
import os
import secrets
import socket
import struct
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from multiprocessing import get_context
from multiprocessing.synchronize import Event
from pathlib import Path
from random import Random
from typing import Any

from armguard import bay_scene
from attack.raw import HEADER, LONGEST, NO_COOKIE, SEAL, Kind, Raw, Role, sealed
from attack.row import Row, none
from attack.target import Arms, Target, commanding, new_keys

# Messages that are under way at most: more, and the system drops some unread.
BURST = 32

# Longest wait until those are read [s].
READ = 0.05

# A speed that only an attacker desires [rad/s].
FORGED = 0.5

# Clients of each role that attack at a time: the service does some calls of each only.
CROWD = 8

# A flood to another port: what it costs this machine, and not the service.
ELSEWHERE = "elsewhere"

# Keys of who has none: what sealed messages in older versions, and what can be guessed.
GUESSES = (b"armguard", b"armguard-public-", bytes(16), b"0123456789abcdef")

# Another user of the machine.
OTHER_USER = 65534

# Far from everything, as a pose.
AWAY = [[1, 0, 0, 9], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]

# Calls that need more than the key for 'sense', with arguments that they would take.
ORDERS: Sequence[tuple[str, Mapping[str, object]]] = (
    ("engage", {}),
    ("reset", {}),
    ("retreat", {"name": "left"}),
    ("grasp", {"robot": "left", "name": "box4"}),
    ("release", {"robot": "left", "name": "box4"}),
    ("allow", {"a": "left/link7", "b": "rack", "depth": 0.5}),
    ("configure", {"mode": "speed"}),
    ("configure", {"response": "stop"}),
    ("remove", {"name": "rack"}),
    ("place", {"name": "bench", "pose": AWAY}),
)  # fmt: skip


class Ledger:
    """What a service has counted since some instant, less what its own arms did.

    Args:
        target: The service.
        arms: Arms that it moves meanwhile.
    """

    def __init__(self, target: Target, arms: Arms) -> None:
        self._target, self._arms = target, arms
        self._before = target.counters.values()
        self._strange, self._sent, self._calls = arms.strange, arms.sent, arms.calls

    def risen(self, *names: str) -> int:
        """By how much counters have risen."""
        now = self._target.counters.values()
        return sum(now[name] - self._before[name] for name in names)

    @property
    def refused(self) -> int:
        """Messages that were dropped, and calls that were refused."""
        drops = (name for name in self._before if name.startswith("dropped_"))
        return self.risen(*drops, "calls_refused", "claims_refused")

    def had(self, *more: str) -> int:
        """Messages of an attacker that had an effect.

        Args:
            more: Counters that rise with what an attacker may not do in this attack.
        """
        # The arms' messages are counted when they are sent.
        sent = self._arms.sent - self._sent + 2
        own = max(self.risen("states") - sent, 0) + max(self.risen("wishes") - sent, 0)
        strange = self._arms.strange - self._strange
        done = self.risen("calls") - self.risen("calls_refused")
        own += max(done - (self._arms.calls - self._calls), 0)
        always = self.risen("claims", "commander_lost", "cycle_faults")
        return own + strange + always + self.risen(*more)


def paced(
    target: Target, messages: Iterator[tuple[Raw, bytes]], done: Callable[[], bool]
) -> None:
    """Send messages as fast as a service reads them.

    Args:
        target: The service.
        messages: Messages and who sends them.
        done: Whether it is enough.
    """
    while not done():
        burst(target, messages)


def burst(target: Target, messages: Iterator[tuple[Raw, bytes]]) -> int:
    """Send some messages and wait until the service has read them; how many."""
    read, sent = target.counters.value("received"), 0
    for raw, message in itertools.islice(messages, BURST):
        raw.send(message)
        sent += 1
    end = time.monotonic() + READ
    while target.counters.value("received") - read < BURST:
        if time.monotonic() > end:
            break
        time.sleep(0.0002)
    return sent


def lies(raw: Raw, arms: Arms, rng: Random) -> Iterator[tuple[Raw, bytes]]:
    """Messages of an attacker that knows all but a key: of each kind, under any number.

    Args:
        raw: The client that sends them, with keys that are wrong.
        arms: Whose number, session, scene and token are known.
        rng: Which of them.
    """
    victim = arms.raw
    forged = [FORGED] * len(arms.q)
    while True:
        raw.key = rng.choice(
            [*GUESSES, secrets.token_bytes(16), secrets.token_bytes(32)]
        )
        raw.session = rng.choice([victim.session, 0])
        raw.scene = victim.scene
        sequence = {"sequence": victim.sequence + rng.randrange(1000)}
        sender = {"sender": victim.sender, **sequence} if rng.random() < 0.5 else {}
        token = victim.token
        role = rng.randrange(6)
        cookie = rng.choice([NO_COOKIE, secrets.token_bytes(16)])
        kind, payload = rng.choice(
            [
                (Kind.HELLO, struct.pack("<II16s", role, 1, cookie) + b"stranger"),
                (Kind.CLAIM, struct.pack("<II", 1, 0)),
                (Kind.GIVE_BACK, struct.pack("<Q", token)),
                (Kind.STATE, raw.state(arms.q, forged, raw.desired(forged, token))),
                (Kind.WISH, raw.desired(forged, token)),
                (Kind.CALL, raw.calling("remove", name="rack")),
                (Kind.CALL, raw.calling("engage")),
                (Kind.STOP, b""),
                (Kind.BYE, b""),
                (Kind.HEARTBEAT, b""),
            ]
        )
        yield raw, raw.message(kind, payload, **sender)


def without_key(target: Target, arms: Arms, count: int) -> Row:
    """Messages of all kinds under keys that can be guessed, and random ones."""
    ledger = Ledger(target, arms)
    with Raw(target.port, bytes(16)) as raw:
        messages = lies(raw, arms, Random(1))
        paced(target, messages, lambda: ledger.refused >= count)
    had = ledger.had("hellos", "stop_orders")
    return none("client without a key", ledger.refused, had, wanted=count)


def other_user(target: Target, arms: Arms, count: int) -> Row:
    """The same by another user of the machine, who looks for the keys first."""
    attack = "another user (uid 65534) without a key"
    if os.getuid() != 0:
        note = "not tried: it takes root to become another user"
        return Row(attack, 0, 0, "accepted", "0", True, note)
    ledger = Ledger(target, arms)
    secret = (
        target.key_file,
        target.key_file.parent,
        target.ring,
        target.ring.with_name(target.ring.name + ".counters"),
        Path(f"/proc/{target.process.pid}/mem"),
        Path(f"/proc/{target.process.pid}/environ"),
    )
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.setgroups([])
            os.setgid(OTHER_USER)
            os.setuid(OTHER_USER)
            opened = sum(map(opens, secret))
            with Raw(target.port, bytes(16)) as raw:
                messages = lies(raw, arms, Random(2))
                for _ in range(count // BURST + 1):
                    for one, message in itertools.islice(messages, BURST):
                        one.send(message)
                    time.sleep(0.008)
            os.write(writer, bytes([opened]))
        finally:
            os._exit(0)
    os.close(writer)
    found = os.read(reader, 1)
    os.close(reader)
    os.waitpid(child, 0)
    opened = found[0] if found else len(secret)
    had = ledger.had("hellos", "stop_orders") + opened
    return none(
        attack, ledger.refused, had, wanted=count // 2,
        note=f"{opened} of {len(secret)} files opened: keys, ring, counters, memory",
        files_opened=opened,
    )  # fmt: skip


def opens(path: Path) -> bool:
    """Whether this user can read a file or a folder."""
    try:
        if path.is_dir():
            list(path.iterdir())
        else:
            with path.open("rb") as file:
                file.read(1)
    except OSError:
        return False
    return True


def crowd_of(stack: ExitStack, target: Target, *roles: int) -> list[Raw]:
    """Some clients with the right key for each of some roles."""
    clients = [target.raw(role) for role in roles for _ in range(CROWD)]
    return [stack.enter_context(client) for client in clients]


def beyond_role(target: Target, arms: Arms, role: int, count: int) -> Row:
    """What a role does not include, with its key, and with the commander's token."""
    ledger = Ledger(target, arms)
    forged = [FORGED] * len(arms.q)
    token = arms.raw.token
    with ExitStack() as stack:
        crowd = crowd_of(stack, target, role)

        def messages() -> Iterator[tuple[Raw, bytes]]:
            orders = itertools.cycle(ORDERS if role < Role.COMMAND else ORDERS[:-2])
            for k in itertools.count():
                raw = crowd[k % CROWD]
                call, arguments = next(orders)
                claims = struct.pack("<II", 1, 0)
                yield raw, raw.message(Kind.CLAIM, claims)
                yield raw, raw.message(Kind.WISH, raw.desired(forged, token))
                state = raw.state(arms.q, forged, raw.desired(forged, token))
                yield raw, raw.message(Kind.STATE, state)
                yield raw, raw.message(Kind.GIVE_BACK, struct.pack("<Q", token))
                yield raw, raw.message(Kind.CALL, raw.calling(call, **arguments))
                # Under the commander's number, with a key that is good for less.
                lie = {"sender": arms.raw.sender, "sequence": arms.raw.sequence + 5}
                other = crowd[(k + 1) % CROWD]
                yield (
                    other,
                    other.message(Kind.WISH, other.desired(forged, token), **lie),
                )

        paced(target, messages(), lambda: ledger.refused >= count)
        had = ledger.had()
    word = Role(role).name.lower()
    second = " of a second client" if role >= Role.COMMAND else ""
    attack = f"key for '{word}'{second}: commands, claims with force, sends states"
    return none(attack, ledger.refused, had, wanted=count)


def fixtures(target: Target, arms: Arms, count: int) -> Row:
    """Fixtures removed or placed elsewhere, with every key, while an arm moves."""
    ledger = Ledger(target, arms)
    names = fixed()
    with ExitStack() as stack:
        crowd = crowd_of(stack, target, *Role)

        def messages() -> Iterator[tuple[Raw, bytes]]:
            for k in itertools.count():
                raw, name = crowd[k % len(crowd)], names[k // len(crowd) % len(names)]
                if k % 2:
                    payload = raw.calling("remove", name=name)
                else:
                    payload = raw.calling("place", name=name, pose=AWAY)
                yield raw, raw.message(Kind.CALL, payload)

        paced(target, messages(), lambda: ledger.risen("calls_refused") >= count)
        tried = ledger.risen("calls_refused")
        time.sleep(0.2)
        had = ledger.had()
        had += crowd[0].call("objects", first=0)["result"]["count"]
    return none(
        f"the {len(names)} fixtures removed or moved, with each of the keys",
        tried, had, unit="changed", wanted=count,
    )  # fmt: skip


def fixed() -> list[str]:
    """Names of the fixtures of the bay: they have no top speed."""
    return [name for name, item in bay_scene().objects.items() if not item.top_speed]


def replayed_hellos(folder: Path, count: int) -> Row:
    """Both HELLOs of a client that were overheard, sent again in all circumstances."""
    keys = new_keys(folder)
    thief_got = thief_sent = had = tried = 0
    with Target(folder, keys=keys) as target:
        port = target.port
        owner = Raw(port, target.keys[Role.OBSERVE], Role.OBSERVE)
        overheard = owner.connect()
        with owner, Raw(port, bytes(16)) as thief:
            share = count // 4
            for raw, leaves in (
                (owner, False),
                (thief, False),
                (owner, True),
                (thief, True),
            ):
                if leaves:
                    owner.say(Kind.BYE)
                    time.sleep(0.1)
                sent, got, effect = again(target, raw, overheard, share)
                tried, had = tried + sent, had + effect
                if raw is thief:
                    thief_sent, thief_got = thief_sent + sent, thief_got + got
    with Target(folder, keys=keys, port=port) as target, Raw(port, bytes(16)) as thief:
        sent, got, effect = again(target, thief, overheard, share)
        tried, had = tried + sent, had + effect
        thief_sent, thief_got = thief_sent + sent, thief_got + got
    bytes_sent = thief_sent * sum(map(len, overheard)) / 2
    ratio = thief_got / bytes_sent
    found = none(
        "HELLOs overheard and replayed: from its address and another, after BYE, "
        "after a restart with the same keys", tried, had, wanted=count,
        unit="answered with a WELCOME",
        note=f"{ratio:.2f} bytes come back for each byte sent",
        reflected=ratio,
    )  # fmt: skip
    return found


def again(
    target: Target, raw: Raw, overheard: tuple[bytes, bytes], count: int
) -> tuple[int, int, int]:
    """Send messages again; how many, bytes that came back, WELCOMEs."""
    hellos = target.counters.value("hellos")
    before = target.counters.value("received")
    got = welcomes = 0
    messages = ((raw, message) for message in itertools.cycle(overheard))
    raw.socket.setblocking(False)
    sent = 0
    while target.counters.value("received") - before < count:
        sent += burst(target, itertools.islice(messages, min(BURST, count)))
        while True:
            try:
                message = raw.socket.recv(LONGEST)
            except OSError:
                break
            if message[5] != Kind.HEARTBEAT:
                got += len(message)
            welcomes += message[5] == Kind.WELCOME
    return sent, got, welcomes + target.counters.value("hellos") - hellos


def floods(folder: Path, seconds: float) -> list[Row]:
    """Floods beside a controller: faults, and the share of cycles without a state."""
    rows: list[Row] = []
    context = get_context("fork")
    with Target(folder) as target, commanding(target) as arms:
        arms.wait_until(lambda answer: any(answer.velocities))
        shares: dict[str, float] = {}
        for name in (ELSEWHERE, "garbage", "HELLO", "CALL"):
            before = target.counters.values()
            strange = arms.strange
            sent, enough = context.Value("q", 0), context.Event()
            words = (name, target.port, target.keys[Role.OBSERVE], sent, enough)
            flooder = context.Process(target=flood, args=words)
            flooder.start()
            time.sleep(seconds)
            enough.set()
            flooder.join()
            after = target.counters.values()
            rose = {key: after[key] - before[key] for key in after}
            shares[name] = share = rose["cycles_without_state"] / max(rose["cycles"], 1)
            if name == ELSEWHERE:
                continue
            had = rose["cycle_faults"] + arms.strange - strange
            rows.append(
                Row(
                    f"flood of {name} beside a controller",
                    sent.value,
                    had,
                    "faults",
                    "0; the share of cycles is reported",
                    had == 0,
                    f"{sent.value / seconds:,.0f} a second; {share:.1%} of cycles "
                    f"had no new state; {shares[ELSEWHERE]:.1%} while garbage goes to "
                    "another port of this machine",
                    {"share": share, "share_elsewhere": shares[ELSEWHERE]},
                )
            )
    return rows


def flood(name: str, port: int, key: bytes, count: Any, enough: Event) -> None:
    """Send messages as fast as a process can until it is enough."""
    rng = Random(5)
    sent = 0
    with ExitStack() as stack:
        drain = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        drain.bind(("127.0.0.1", 0))
        to = drain.getsockname()[1] if name == ELSEWHERE else port
        raw = stack.enter_context(Raw(to, key, Role.OBSERVE))
        if name == "CALL":
            raw.connect()
        noise = [rng.randbytes(rng.randrange(1, 300)) for _ in range(BURST)]
        hello = struct.pack("<II16s", Role.OBSERVE, 0, NO_COOKIE)
        while not enough.is_set():
            for one in noise:
                if name == "HELLO":
                    raw.say(Kind.HELLO, hello)
                elif name == "CALL":
                    raw.say(Kind.CALL, raw.calling("why"))
                else:
                    raw.send(one)
                sent += 1
    count.value = sent


def scan(target: Target, arms: Arms, count: int, seed: int) -> Row:
    """Messages of every kind with wrong contents, well sealed with each of the keys."""
    rng = Random(seed)
    ledger = Ledger(target, arms)
    before = target.counters.value("received")
    with ExitStack() as stack:
        crowd = crowd_of(stack, target, *Role)

        def messages() -> Iterator[tuple[Raw, bytes]]:
            while True:
                raw = rng.choice(crowd)
                yield raw, mutant(raw, arms, rng)

        paced(
            target, messages(),
            lambda: target.counters.value("received") - before >= count,
        )  # fmt: skip
        tried = target.counters.value("received") - before
        time.sleep(0.2)
        had = ledger.had() + (target.process.poll() is not None)
        had += crowd[0].call("objects", first=0)["result"]["count"]
    attack = "messages of wrong contents, well sealed with each of the keys"
    return none(attack, tried, had, unit="had an effect", wanted=count)


# Numbers in which code that reads others' numbers goes wrong.
EDGES = (0, 1, 2, 255, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1)
FLOATS = (0.0, float("nan"), float("inf"), float("-inf"), 1e308, 5e-324, -1.0, 2.0**53)


def mutant(raw: Raw, arms: Arms, rng: Random) -> bytes:
    """A message that is wrong in some field and well sealed, or not sealed at all.

    What its sender may do is left out: an order to stop, and the command taken with the
    key for 'administer'.
    """
    count = rng.choice([0, 1, 13, 14, 15, 28, 200])
    numbers = struct.pack(f"<{count}d", *rng.choices(FLOATS, k=count))
    words = struct.pack("<4I", *(rng.choice(EDGES) & 0xFFFFFFFF for _ in range(4)))
    name = rng.choice(["rack", "left", "", "bench", "\0", "a" * 3000])
    junk: dict[str, object] = {
        key: rng.choice([None, name, -1, [], {}, [[float("inf")] * 4] * 4, 1e308, True])
        for key in rng.sample(["name", "robot", "pose", "q", "a", "b", "region"], 3)
    }
    call = rng.choice([*(each for each, _ in ORDERS), "__init__", "", "stop "])
    kind, payload = rng.choice(
        [
            (Kind.HELLO, words + words[:8] + rng.randbytes(rng.randrange(90))),
            (Kind.STATE, words + numbers),
            (
                Kind.STATE,
                struct.pack("<IId", 3, rng.randrange(4), rng.choice(FLOATS)) + numbers,
            ),
            (Kind.WISH, words + numbers),
            (Kind.CALL, raw.calling(call, **junk)),
            (Kind.CALL, b"[" * rng.randrange(8000)),
            (Kind.CALL, rng.randbytes(rng.randrange(500))),
            (Kind.GIVE_BACK, words[:8]),
            (Kind.CLAIM, struct.pack("<II", 0, rng.choice(EDGES) & 0xFFFFFFFF)),
            (Kind.HEARTBEAT, rng.randbytes(rng.randrange(3))),
            (rng.randrange(14, 256), words),
        ]
    )
    field = rng.choice(["", "", "", "session", "scene", "sender", "stamp"])
    lie = {field: rng.choice(EDGES) & 0x7FFFFFFFFFFFFFFF} if field else {}
    message = bytearray(
        raw.message(kind, payload[: LONGEST - HEADER.size - SEAL], **lie)
    )
    way = rng.randrange(6)
    if way == 0:
        message[rng.randrange(len(message))] ^= 1 << rng.randrange(8)
    elif way == 1:
        del message[rng.randrange(len(message)) :]
    elif way == 2 and len(message) > HEADER.size + SEAL:
        for _ in range(rng.randrange(1, 9)):
            if kind != Kind.CLAIM:
                message[rng.randrange(HEADER.size, len(message) - SEAL)] = (
                    rng.randrange(256)
                )
        return sealed(bytes(message[:-SEAL]), raw.key)
    return bytes(message)


def run(count: int) -> list[Row]:
    """All attacks on one service whose arms move meanwhile, then those on others.

    Args:
        count: Tries of each kind.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with Target(folder) as target, commanding(target) as arms:
            arms.wait_until(lambda answer: any(answer.velocities))
            rows = [
                without_key(target, arms, count),
                other_user(target, arms, count),
                *(
                    beyond_role(target, arms, role, count)
                    for role in (Role.OBSERVE, Role.SENSE, Role.COMMAND)
                ),
                fixtures(target, arms, count),
                scan(target, arms, count, 7),
            ]
        rows.append(replayed_hellos(folder, count))
        rows += floods(folder, min(max(count / 2500, 0.5), 4.0))
    return rows
