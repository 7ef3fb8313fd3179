"""Play in the browser: people and policies drive the robots of one episode, in 3D."""
