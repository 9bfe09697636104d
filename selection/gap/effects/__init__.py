"""The effects: a contract, one small file each, and the catalogue."""
