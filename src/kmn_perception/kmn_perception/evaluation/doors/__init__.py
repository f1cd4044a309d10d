"""How estimates of doors in their walls are compared with labels, and are on rendered rooms."""
