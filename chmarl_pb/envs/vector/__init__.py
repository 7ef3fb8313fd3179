"""Many environments side by side, in some processes with shared memory."""
