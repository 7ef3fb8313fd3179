"""What a home offers to a body of a size and reach: lattice, free space, surfaces, stand poses."""
