"""What recordings show: the lines of the machine, of its gears, and of what no gear explains."""
