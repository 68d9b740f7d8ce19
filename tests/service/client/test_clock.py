"""The service's clock, estimated from round trips."""

import time

import pytest

from armguard.service.client.clock import ServiceClock


@pytest.mark.parametrize(("out", "back"), [(4_000_000, 10_000), (10_000, 4_000_000)])
def test_the_earliest_time_is_never_later_than_the_services_clock(
    out, back, monkeypatch
):
    """However the way there and the way back share the time of the round trip."""
    ahead = 1_000_000_000_000
    clock = ServiceClock()
    assert clock.earliest() <= time.monotonic()
    clock.learn(5_000, 5_000 + out + ahead, 5_000 + out + back)
    monkeypatch.setattr(time, "monotonic", lambda: 7.0)
    service = 7.0 + ahead * 1e-9
    assert service - (out + back) * 1e-9 <= clock.earliest() <= service
    # The estimate itself may be later.
    assert (clock() > service) is (out > back)


def test_before_the_first_round_trip_it_is_this_machines_clock(monkeypatch):
    monkeypatch.setattr(time, "monotonic", lambda: 7.0)
    assert ServiceClock().earliest() == 7.0
