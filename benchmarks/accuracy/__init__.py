"""How exact the distances are, judged by oracles that share no code with them.

`regimes` draws pairs of shapes, `ours` measures them, `bodies` holds the formulas of
the oracles, `certificate` judges cores that are apart, `depth` cores that overlap,
`exact` a few pairs with 50 digits, `judge` brings these together, and `peers` asks
other libraries about the same pairs. `benchmarks/accuracy_campaign.py` runs it all.
"""
