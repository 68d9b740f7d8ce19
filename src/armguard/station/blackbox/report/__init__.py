"""One page about a recording: what was near, what stopped, how fast it was judged."""
