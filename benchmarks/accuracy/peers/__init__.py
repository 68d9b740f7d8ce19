"""Other libraries asked about the same pairs: `ask(pair)` gives a signed distance.

`None` where the library has no such pair. A rounding is no shape of theirs: they are
asked about the sharp shape, and the rounding is taken off their answer.
"""

from collections.abc import Callable

from accuracy.peers import coal_peer, fcl_peer, mujoco_peer
from accuracy.regimes import Pair

PEERS: dict[str, Callable[[Pair], float | None]] = {
    "Coal": coal_peer.ask,
    "FCL": fcl_peer.ask,
    "MuJoCo": mujoco_peer.ask,
}
