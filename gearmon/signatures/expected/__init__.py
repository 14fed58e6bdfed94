"""What a machine file foretells: lines of the healthy machine and of every fault of its gears."""
