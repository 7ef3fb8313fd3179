"""Speed of the environments on this machine: steps, frames, first visits, resets, start, memory."""
