"""Peers asked in processes of their own: they may hang or die, the campaign not."""

import multiprocessing
import os
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from accuracy.judge import judge
from accuracy.peers import PEERS
from accuracy.regimes import REGIMES, Pair
from accuracy.summary import NAMES
from armguard.geometry import ShapeKind

# A peer that has not answered by then hangs [s].
PATIENCE = 1.0

# Errors above this count, relative to the scale; as do those of the oracle [-].
NOTABLE = 1e-6

# What may be wrong with an answer, the unsafe side first.
VERDICTS = {
    "too far": "apart, and farther than the truth",
    "too shallow": "overlapping, and the depth too small",
    "not seen": "overlapping, and reported apart",
    "too near": "apart, and nearer than the truth, or reported overlapping",
    "too deep": "overlapping, and the depth too large",
    "no number": "NaN, infinite or ±1.8e308",
    "refused": "an exception",
    "hung": f"no answer within {PATIENCE:g} s",
    "died": "the process was gone",
}


def serve(pipe: Connection, peer: str) -> None:
    """Answer pairs, in the child."""
    # What libraries print about themselves is not part of the report.
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    pipe.send("ready")
    while True:
        pair = pipe.recv()
        try:
            pipe.send(PEERS[peer](pair))
        except Exception as error:
            pipe.send(str(error).strip().splitlines()[-1:] or [type(error).__name__])


class Asked:
    """A peer in a child that is started again when it is lost."""

    def __init__(self, peer: str) -> None:
        """Start it."""
        self.peer = peer
        self.start()

    def start(self) -> None:
        """Start a child."""
        # Forked, so that one is soon back: what it needs is loaded already.
        context = multiprocessing.get_context("fork")
        self.pipe, theirs = context.Pipe()
        self.child = context.Process(
            target=serve, args=(theirs, self.peer), daemon=True
        )
        self.child.start()
        theirs.close()
        self.pipe.recv()

    def ask(self, pair: Pair) -> Any:
        """A distance, None, a list with a message, or the word hung or died."""
        try:
            self.pipe.send(pair)
            if self.pipe.poll(PATIENCE):
                return self.pipe.recv()
            lost = "hung"
        except (EOFError, OSError):
            lost = "died"
        self.stop()
        self.start()
        return lost

    def stop(self) -> None:
        """End the child."""
        self.child.kill()
        self.child.join()
        self.pipe.close()


def verdict(answer: Any, lower: float, upper: float, margin: float) -> str | None:
    """What is wrong with an answer, if anything."""
    if isinstance(answer, list):
        return "refused"
    if isinstance(answer, str):
        return answer
    if not np.isfinite(answer) or abs(answer) > 1e300:
        return "no number"
    if answer > upper + margin:
        if upper > 0.0:
            return "too far"
        return "not seen" if answer > margin else "too shallow"
    if answer < lower - margin:
        return "too near" if lower > 0.0 else "too deep"
    return None


def compare(task: tuple[str, str, int]) -> dict[str, Any]:
    """Ask a peer about pairs of all kinds in one regime and judge its answers."""
    peer, regime, count = task
    asked = Asked(peer)
    found: dict[str, Any] = {}
    for name in NAMES:
        if ShapeKind.SUPPORT in NAMES[name]:
            # Known by its support alone: no peer has it.
            continue
        found[name] = entry = {"asked": 0, "unsupported": 0, "worst": 0.0, "wrong": {}}
        batch = judge(*NAMES[name], regime, range(count))
        for k, answer in enumerate(answers(asked, batch.pairs)):
            if answer is None:
                entry["unsupported"] += 1
                continue
            entry["asked"] += 1
            size = batch.scale[k]
            lower, upper = float(batch.lower[k]), float(batch.upper[k])
            error = 0.0
            if isinstance(answer, float) and abs(answer) < 1e300:
                error = max(answer - upper, lower - answer) / size
            entry["worst"] = max(entry["worst"], error)
            word = verdict(answer, lower, upper, NOTABLE * size)
            if word:
                case = entry["wrong"].setdefault(word, {"count": 0, "error": -1.0})
                case["count"] += 1
                if error > case["error"]:
                    case.update(
                        error=error,
                        regime=regime,
                        number=k,
                        answer=answer if isinstance(answer, float) else None,
                        truth=lower,
                        ours=float(batch.out[k, 0]),
                    )
    asked.stop()
    return found


def answers(asked: Asked, pairs: list[Pair]) -> Iterator[Any]:
    """Answers, in order; nothing is asked after two in a row were lost."""
    lost = 0
    for pair in pairs:
        answer = None if lost == 2 else asked.ask(pair)
        lost = lost + 1 if answer in ("hung", "died") else lost * (lost == 2)
        yield answer


def tasks(peers: list[str], count: int) -> list[tuple[str, str, int]]:
    """Work for all regimes."""
    return [(peer, regime, count) for regime in REGIMES for peer in peers]
