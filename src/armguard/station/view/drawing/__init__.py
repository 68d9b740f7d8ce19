"""What stands in the page's scene: each file draws one kind of thing."""
