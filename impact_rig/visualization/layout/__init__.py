"""How the view is laid out: tabs, and the views in them."""
