"""Maps of cells beside OctoMap and FCL: rates, and the images for them."""
