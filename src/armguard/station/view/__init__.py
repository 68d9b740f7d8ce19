"""The live view: a page in the browser that draws what the check used, and drives.

A process of its own. It reads frames from the loop's ring, or from a recording, and
draws the poses and numbers that are in them, never such as it worked out itself. What
its page asks for goes to the loop through a client like anybody else's.
"""
