"""What somebody at the page asks for, and how it gets to the loop.

Nothing here is judged or held back: that is the loop's business. What is dropped is
what nobody asks for any more: a hand that let go, a page that is gone.
"""
