"""The attack on Zenoh, in short: everything is tried, and nothing has an effect."""

from attack.zenoh_bus import run

TRIES = 90


def test_nothing_forged_replayed_or_overheard_has_an_effect():
    for mode, found in run(TRIES).items():
        assert found["genuine_commands_taken"] > 0, mode
        assert found["claims_refused"] == TRIES
        for what in (
            "forged_commands_obeyed",
            "forged_wishes_accepted",
            "forged_replies_taken",
            "claims_granted",
            "tokens_overheard",
        ):
            assert found[what] == 0, (mode, what)
        if mode == "router":
            # It passes on what it gets: there the seal alone keeps commands apart.
            assert found["forged_commands_delivered"] > 0
            assert found["forged_replies"] > 0
        else:
            assert found["forged_commands_delivered"] == found["forged_replies"] == 0
