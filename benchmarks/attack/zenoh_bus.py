"""Attack on Zenoh: forged, replayed and moved messages, forced claims, listening.

The attacker reaches the bridge as a peer, as a client, or through a router of Zenoh
that passes everything on. It has no key, or the key for `observe`. It writes seals by
docs/zenoh.md, not with the code under attack.
"""

import json
import os
import struct
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from hashlib import blake2s
from pathlib import Path
from socket import SOCK_STREAM
from tempfile import TemporaryDirectory
from typing import IO, Any

import zenoh

from armguard.bridges.zenoh_bridge import ZenohClient
from armguard.recording.rights import Role
from attack.target import Target, free_port, started

ROOT = "armguard/guard"

# How the attacker reaches the bridge.
MODES = ("peer", "client", "router")

# Messages that are sent without a pause, and the pause: the bridge keeps 1024 waiting.
BURST, PAUSE = 50, 0.002

# Queries that wait for a reply at a time.
OPEN = 64

# Nothing takes longer than that [s].
PATIENCE = 120.0

# The attacker does not attack itself.
OTHERS = zenoh.Locality.REMOTE

# A speed that no command has [rad/s]: it marks forged ones.
FORGED = 9.75


@contextmanager
def opened(
    mode: str, listen: tuple[str, ...], connect: tuple[str, ...]
) -> Iterator[Any]:
    """A session of Zenoh that finds no peer by itself."""
    config = zenoh.Config()
    for key, value in (
        ("mode", mode),
        ("listen/endpoints", list(listen)),
        ("connect/endpoints", list(connect)),
        ("scouting/multicast/enabled", False),
        ("scouting/gossip/enabled", False),
        ("transport/shared_memory/enabled", False),
    ):
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        yield session


class Tap:
    """A session of Zenoh that keeps what was sent through it last: the loot."""

    def __init__(self, session: Any) -> None:
        self._session = session
        self.sent: dict[str, tuple[bytes, bytes]] = {}
        self.count: Counter[str] = Counter()

    def put(
        self, key: str, payload: bytes, *, attachment: bytes, **options: Any
    ) -> None:
        """Put a message."""
        self.sent[key] = payload, attachment
        self.count[key.removeprefix(f"{ROOT}/")] += 1
        self._session.put(key, payload, attachment=attachment, **options)

    def get(
        self, key: str, *, payload: bytes, attachment: bytes, **options: Any
    ) -> Any:
        """Send a query."""
        self.sent[key] = payload, attachment
        self.count["call"] += 1
        return self._session.get(key, payload=payload, attachment=attachment, **options)

    def declare_subscriber(self, key: str, heard: Any) -> Any:
        """Receive messages."""
        return self._session.declare_subscriber(key, heard)


def sealed(
    key: bytes, role: int, macs: int, name: str, payload: bytes, loot: bytes
) -> bytes:
    """A seal under a key, with all else taken from another seal; by docs/zenoh.md."""
    _, _, _, sequence, stamp, session, about = struct.unpack_from("<4sHHQq16s16s", loot)
    text = name.encode()
    header = struct.pack(
        *("<4sHHQq16s16s", b"AGZ1", role, len(text), sequence + 1000, stamp),
        *(session, about),
    )
    mac = blake2s(header + text + payload, key=key, digest_size=16).digest()
    return header + mac * macs


class Victims:
    """A controller and commander with the right keys, which obeys commands it takes."""

    def __init__(self, session: Any, port: int) -> None:
        self.tap = Tap(session)
        self.client = ZenohClient(
            self.tap,  # type: ignore[arg-type]
            role=Role.ADMINISTER,
            port=port,
            root=ROOT,
        )
        welcome = self.client.connect(PATIENCE)
        self.names, self.home = welcome["names"], welcome["home"]
        self.obeyed = self.taken = self.delivered = self.deceived = 0
        self.counts: dict[str, int] = {}
        self._ends = [
            self.client.subscribe("command", self._command),
            self.client.subscribe("heartbeat", self._heartbeat),
            session.declare_subscriber(f"{ROOT}/command", self._deliver),
        ]
        self._enough = threading.Event()
        self._thread = threading.Thread(target=self._work)
        self._thread.start()

    def _command(self, message: dict[str, Any]) -> None:
        self.taken += 1
        self.obeyed += message["velocities"][0] == FORGED

    def _heartbeat(self, message: dict[str, Any]) -> None:
        self.counts = message["counts"]

    def _deliver(self, sample: Any) -> None:
        self.delivered += f"[{FORGED}" in sample.payload.to_string()

    def _work(self) -> None:
        """Command: nothing is desired, so that nothing but an attacker moves robots."""
        self.client.call("claim", name="victim", force=True)
        while not self._enough.wait(0.01):
            self.deceived += self.client.call("ping", timeout=PATIENCE) == FORGED
            self.client.put("state", {"names": self.names, "positions": self.home})
            nothing = [0.0] * len(self.names)
            self.client.put(
                "wish/velocities", {"names": self.names, "velocities": nothing}
            )

    def settle(self) -> None:
        """Wait until the bridge has handled what was sent so far."""
        for _ in range(2):
            self.client.call("clock", timeout=PATIENCE)
            time.sleep(0.1)

    def close(self) -> None:
        """End."""
        self._enough.set()
        self._thread.join()
        for end in self._ends:
            end.undeclare()


class Attacker:
    """A session that has no key but that for `observe`."""

    def __init__(self, session: Any, loot: Tap, key: bytes) -> None:
        self.session, self._loot, self._key = session, loot, key
        self.heard: dict[str, tuple[bytes, bytes]] = {}
        self.overheard = 0
        self.replies: Counter[str] = Counter()
        self._secrets: list[bytes] = []
        self._ends = [
            session.declare_subscriber("**", self._listen, allowed_origin=OTHERS),
            session.declare_queryable(
                f"{ROOT}/call/*", self._reply, allowed_origin=OTHERS
            ),
        ]
        self.asked = 0

    def listen_for(self, secrets: list[bytes]) -> None:
        """Count messages that hold a secret, or a token."""
        self._secrets = [*secrets, b'"token"']

    def _listen(self, sample: Any) -> None:
        payload = sample.payload.to_bytes()
        seal = b"" if sample.attachment is None else sample.attachment.to_bytes()
        self.heard[str(sample.key_expr)] = payload, seal
        self.overheard += any(word in payload + seal for word in self._secrets)

    def _reply(self, query: Any) -> None:
        """Reply in the place of the bridge."""
        self.asked += 1
        name = str(query.key_expr)
        payload = json.dumps({"ok": True, "result": FORGED}).encode()
        loot = query.attachment.to_bytes()
        loot = loot[:40] + loot[-16:] + loot[-16:]
        with query:
            query.reply(name, payload, attachment=loot)
            seal = sealed(self._key, 0, 4, name, payload, loot)
            query.reply(name, payload, attachment=seal)

    def commands(self, count: int) -> None:
        """Forge what the bridge says."""
        key = f"{ROOT}/command"
        end = time.monotonic() + PATIENCE
        while not {key, f"{ROOT}/verdict"} <= self.heard.keys():
            assert time.monotonic() < end
            time.sleep(0.01)
        for k in range(count):
            payload, seal = self.heard[key]
            verdict, moved = self.heard[f"{ROOT}/verdict"]
            found = json.loads(payload)
            found["velocities"] = [FORGED] * len(found["velocities"])
            forged = json.dumps(found).encode()
            own = sealed(self._key, 0, 4, key, forged, seal)
            asked = sealed(self._key, 1, 4, key, forged, seal)
            self._put(
                k,
                *(
                    (key, forged, None),
                    (key, forged, os.urandom(len(seal))),
                    (key, forged, seal),
                    (key, payload, seal),
                    (key, verdict, moved),
                    (key, forged, own),
                    (key, forged, asked),
                    (f"{ROOT}/*", forged, own),
                    (f"{ROOT}/heartbeat", forged, own),
                )[k % 9],
            )

    def desired_motions(self, count: int) -> None:
        """Forge, replay and move what the commander says."""
        topic, state = f"{ROOT}/wish/velocities", f"{ROOT}/state"
        for k in range(count):
            payload, seal = self._loot.sent[topic]
            other, moved = self._loot.sent[state]
            forged = payload.replace(b"0.0", str(FORGED).encode())
            observer = sealed(self._key, 1, 1, topic, forged, seal)
            commander = sealed(self._key, 3, 1, topic, forged, seal)
            self._put(
                k,
                *(
                    (topic, forged, None),
                    (topic, forged, seal),
                    (topic, payload, seal),
                    (state, other, moved),
                    (topic, other, moved),
                    (f"{ROOT}/wish/positions", payload, seal),
                    (topic, forged, observer),
                    (topic, forged, commander),
                    (f"{ROOT}/stop", b"{}", None),
                )[k % 9],
            )

    def claims(self, count: int) -> None:
        """Claim the command with force."""
        key = f"{ROOT}/call/claim"
        payload, seal = self._loot.sent[key]
        forged = json.dumps({"name": "thief", "force": True}).encode()
        gate = threading.Semaphore(OPEN)

        def replied(reply: Any) -> None:
            if reply.ok is None:
                self.replies["refused"] += 1
            else:
                found = json.loads(reply.ok.payload.to_bytes())
                self.replies["granted" if found["ok"] else "refused"] += 1

        for k in range(count):
            text, attachment = (
                (forged, None),
                (payload, seal),
                (forged, seal),
                (forged, sealed(self._key, 1, 1, key, forged, seal)),
                (forged, sealed(self._key, 4, 1, key, forged, seal)),
            )[k % 5]
            assert gate.acquire(timeout=PATIENCE)
            self.session.get(
                key,
                zenoh.handlers.Callback(replied, gate.release),
                payload=text,
                attachment=attachment,
                timeout=PATIENCE,
            )
        for _ in range(OPEN):
            assert gate.acquire(timeout=PATIENCE)

    def _put(self, k: int, key: str, payload: bytes, seal: bytes | None) -> None:
        block = zenoh.CongestionControl.BLOCK
        self.session.put(key, payload, attachment=seal, congestion_control=block)
        if k % BURST == BURST - 1:
            time.sleep(PAUSE)


def attack(mode: str, count: int, target: Target, log: IO[bytes]) -> dict[str, int]:
    """Attack a bridge in one mode.

    Args:
        mode: One of `MODES`.
        count: Tries of each kind.
        target: The service.
        log: Where the bridge writes its errors.
    """
    port, keys = target.port, target.keys
    here = f"tcp/127.0.0.1:{free_port(SOCK_STREAM)}"
    bridge = ["armguard.bridges.zenoh_bridge", "--port", str(port), "--listen", here]
    with ExitStack() as stack:
        place = here
        if mode == "router":
            place = f"tcp/127.0.0.1:{free_port(SOCK_STREAM)}"
            stack.enter_context(opened("router", (place,), ()))
            bridge += ["--connect", place]
        process = stack.enter_context(started(bridge, log)[0])
        stack.callback(process.kill)
        kind = "client" if mode == "router" else mode
        victims = Victims(stack.enter_context(opened(kind, (), (place,))), port)
        stack.callback(victims.close)
        session = stack.enter_context(opened(kind, (), (place,)))
        attacker = Attacker(session, victims.tap, keys[Role.OBSERVE])
        attacker.listen_for(list(keys.values()))
        end = time.monotonic() + PATIENCE
        while not victims.counts.get("accepted_wish/velocities"):
            assert time.monotonic() < end, victims.counts
            time.sleep(0.05)
        attacker.commands(count)
        attacker.desired_motions(count)
        attacker.claims(count)
        victims.settle()
        sent, counts = victims.tap.count, victims.counts
        return {
            "forged_commands": count,
            "forged_commands_delivered": victims.delivered,
            "forged_commands_obeyed": victims.obeyed,
            "genuine_commands_taken": victims.taken,
            "forged_wishes": count,
            "forged_wishes_accepted": sum(
                max(0, counts.get(f"accepted_{name}", 0) - sent[name])
                for name in ("wish/velocities", "wish/positions", "state", "stop")
            ),
            "forged_wishes_dropped": sum(
                number for cause, number in counts.items() if cause in DROPPED
            ),
            "forged_replies": 2 * attacker.asked,
            "forged_replies_taken": victims.deceived,
            "claims": count,
            "claims_refused": attacker.replies["refused"],
            "claims_granted": attacker.replies["granted"],
            "tokens_overheard": attacker.overheard,
        }


# Causes under which the bridge counts what is not sealed for it, or not now.
DROPPED = tuple(f"dropped_{word}" for word in ("seal", "out_of_order", "late", "role"))


def run(count: int) -> dict[str, dict[str, int]]:
    """Attack in every mode.

    Args:
        count: Tries of each kind in each mode.

    Returns:
        By mode: what was tried, and what of it had an effect.
    """
    with TemporaryDirectory() as name, Target(Path(name)) as target:
        with (Path(name) / "bridge.log").open("wb") as log:
            return {mode: attack(mode, count, target, log) for mode in MODES}
