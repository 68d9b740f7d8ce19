"""The live view: a page in the browser that draws what the check used, and drives.

A separate process. It reads frames from the loop's ring, or from a recording, and
draws their poses and numbers, none that it computed itself but the two of
`computed_drawables`. Requests of its page go to the loop through a client.
"""
