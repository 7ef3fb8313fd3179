"""Pictures of the world: views of the empty home, the bodies that move drawn over them, and what is visible in them."""
