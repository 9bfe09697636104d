"""Records and modes: what they may hold, reading and checking them, writing them, and the resonances in them."""
