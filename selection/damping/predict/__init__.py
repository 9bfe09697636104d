"""Response: lumped masses to modes, first-harmonic steady states and their branches, time integration for reference."""
