"""Parts of the campaign of fleets."""
